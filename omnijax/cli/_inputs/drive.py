"""The drive of one run: constant values and ramps, the sphere's Ω, tables in files, recordings."""

import re
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from ..._errors import InputError, tell
from .motion import MotionOptions
from .options import numbers

_UNIT = re.compile(r"[^\d.eE+\-\s].*\Z")
EVEN = 1e-3  # of a step, up to which steps differ by the digits of a file


class AskedDrive(NamedTuple):
    """The drive, the sample times in s, and what is wrong with the recording."""

    drive: Any
    times: Any
    faults: list


class Studied(NamedTuple):
    """The drive of a study, the length of its runs in s (None: steady state), samples per s."""

    drive: Any
    duration: float | None
    rate: float | None


def asked(rig: Any, motion: MotionOptions, recording: Path | None) -> AskedDrive:
    """The drive that the options describe; `InputError` where they describe none or two."""
    from ...simulation import drive_for

    _one_of(motion, recording)
    if recording is not None:
        plan = _from_file(rig, motion, recording)
    else:
        times = _times(motion)
        plan = AskedDrive(_typed(rig, motion, float(times[-1])), times, [])
    return plan._replace(drive=drive_for(rig, plan.drive))


def studied(rig: Any, motion: MotionOptions, recording: Path | None) -> Studied:
    """The same for a study, whose runs begin at 0; without a length, of the steady state."""
    import numpy as np

    _one_of(motion, recording)
    if recording is None:
        end = None if motion.seconds is None else float(_times(motion)[-1])
        return Studied(_typed(rig, motion, end), motion.seconds, motion.hertz)
    plan = _from_file(rig, motion, recording)
    start, steps = float(plan.times[0]), np.diff(plan.times)
    length = float(plan.times[-1]) - start
    if np.ptp(steps) > EVEN * length / len(steps):
        told = "is not sampled evenly: a study takes as many samples at even times."
        tell([f"{recording.name} {told}"])
    return Studied(plan.drive.since(start), length, len(steps) / length)


def _times(motion: MotionOptions) -> Any:
    """Samples of a run of the length that is asked for, s."""
    from ...simulation import sample_times

    return sample_times(motion.seconds or 8.0, motion.hertz)


def _one_of(motion: MotionOptions, recording: Path | None) -> None:
    given: dict[str, str | Path | None]
    given = {"--speed": motion.speed, "--omega": motion.omega, "--torque": motion.torque}
    given["--drive"] = recording
    named = [option for option, value in given.items() if value is not None]
    if len(named) != 1:
        told = f", but {' and '.join(named)} are given" if named else ""
        raise InputError(f"give one of {', '.join(given)}{told}.")


def _typed(rig: Any, motion: MotionOptions, end: float | None) -> Any:
    """The drive by values on the command line; ramps go from 0 to `end` in s."""
    from ...simulation import speeds, torques

    push = _signal("force", motion.force or "0,0,0", "N", 3, "components", end)
    if motion.torque is not None:
        return torques(_signal("torque", motion.torque, "N m", rig.size, "wheels", end), push)
    if motion.speed is not None:
        return speeds(_signal("speed", motion.speed, "rad/s", rig.size, "wheels", end), push)
    return speeds(_turning(rig, str(motion.omega), end), push)


def _signal(name: str, text: str, unit: str, count: int, what: str, end: float | None) -> Any:
    """Constant values, or ramps `from..to` over the whole run."""
    before, after = _ends(name, text, unit, count, what)
    return before if after is None else _ramp(name, end, before, after)


def _ends(
    name: str, text: str, unit: str, count: int, what: str
) -> tuple[list[float], list[float] | None]:
    """Values at the beginning and, where one of them is a ramp, at the end."""
    if ".." not in text:
        return numbers(name, text, unit, count, what), None
    first, last = [], []
    for part in text.split(","):
        begin, _, end = part.strip().rpartition("..")
        numbers(name, end, unit, 1, what)  # before its unit is given to the other end
        shared = _UNIT.search(end)  # "0..30 rpm": the unit is that of both
        begin = begin or end
        first.append(f"{begin} {shared[0]}" if shared and not _UNIT.search(begin) else begin)
        last.append(end)
    return (
        numbers(name, ",".join(first), unit, count, what),
        numbers(name, ",".join(last), unit, count, what),
    )


def _ramp(name: str, end: float | None, before: Sequence[float], after: Sequence[float]) -> Any:
    from ...simulation import ramp

    if end is None:
        raise InputError(f"`{name}` is a ramp over a whole run: give its length by --duration.")
    return ramp(0.0, end, before, after)


def _turning(rig: Any, text: str, end: float | None) -> Any:
    """Wheel speeds that turn the sphere with Ω, which may be a ramp."""
    from ...dynamics import fitting_speeds

    before, after = _ends("omega", text, "rad/s", 3, "components")
    begin = fitting_speeds(rig, before)
    return begin if after is None else _ramp("omega", end, begin, fitting_speeds(rig, after))


def _from_file(rig: Any, motion: MotionOptions, file: Path) -> AskedDrive:
    """A table of speeds, or a recording's torques, force and first wheel angles."""
    from ...recording import read_recording, speed_table
    from ...simulation import drive_from_recording, sample_times, speeds, table

    if motion.force is not None:
        raise InputError("--drive brings its own force: leave out --force.")
    by_time = speed_table(file, rig.names)
    if by_time is not None:
        length = motion.seconds or float(by_time.time[-1])
        push = (0.0, 0.0, 0.0) if by_time.force is None else table(by_time.time, by_time.force)
        drive = speeds(table(by_time.time, by_time.speed), push)
        return AskedDrive(drive, sample_times(length, motion.hertz), [])
    if motion.duration is not None or motion.rate is not None:
        raise InputError("a recording brings its own times: leave out --duration and --rate.")
    run = read_recording(file, rig)
    for fault in run.faults:
        print(f"warning: {fault}", file=sys.stderr)
    return AskedDrive(drive_from_recording(run), run.time, run.faults)
