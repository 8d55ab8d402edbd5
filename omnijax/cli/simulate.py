"""`omnijax simulate`: one run of a rig."""

from pathlib import Path
from typing import Any, NamedTuple

from ._axis import is_machine, simulate_machine
from ._motion import Motion, Numerics
from ._options import Json, Overwrite, check_picture, command_line, emit
from ._simulate_summary import show, summarise

LONGEST = 5_000_000  # samples; more is a misread unit


def simulate(
    rig: str,
    /,
    *,
    motion: Motion = Motion(),
    drive: Path | None = None,
    out: Path | None = None,
    plot: Path | None = None,
    numerics: Numerics = Numerics(),
    resume: bool = False,
    overwrite: Overwrite = False,
    json: Json = False,
) -> int:
    """Simulate one run: prescribed wheel speeds, motor torques, or the inputs of a recording.

    Example: omnijax simulate atlas --speed 0.1,1.2,0.3 --duration 8s --out run.nc

    Example: omnijax simulate rig.toml --drive run-1.csv.gz --out run.csv.gz --plot run.png

    Parameters
    ----------
    rig
        A rig file, the name of a bundled rig, or a machine file (an axis).
    drive
        A recording: its torques, force and first wheel angles; the run is sampled at its times.
    out
        File of the run: .nc (every channel), or .csv, .csv.gz, .parquet (a recording).
    plot
        Picture of the run (.png, .svg, .pdf).
    resume
        Go on with the interrupted run in --out (.nc); the other options must be the same.
    """
    _keep_programs()
    if is_machine(rig):
        return simulate_machine(rig, drive, out, json)
    _check_files(out, plot)
    numerics.checked()
    from ..rig import load_rig

    machine = load_rig(rig)
    asked = _asked(machine, motion, drive)
    _claim(rig, machine, out, plot, resume, overwrite)
    run, end = _run(machine, asked, numerics, out if resume else None, resume)
    summary = summarise(run, machine) | {"rig": rig, "faults": [str(f) for f in asked.faults]}
    summary |= _written(run, end, rig, machine, out, plot)
    emit(json, summary, lambda: show(summary))
    return _code(run, out)


def _keep_programs() -> None:
    """A failed check inside the compiled solve gives NaN, hence a status.

    It then needs no call back to Python; without one, JAX keeps the program for the next process.
    """
    import os

    os.environ.setdefault("EQX_ON_ERROR", "nan")


class Asked(NamedTuple):
    """The drive, the sample times in s, and what is wrong with the recording."""

    drive: Any
    times: Any
    faults: list


def _asked(rig: Any, motion: Motion, recording: Path | None) -> Asked:
    import sys

    from .._errors import InputError
    from ..recording import read_recording
    from ..simulation import drive_from_recording

    if sum(x is not None for x in (motion.speed, motion.torque, recording)) != 1:
        raise InputError("give one of --speed, --torque and --drive.")
    if recording is None:
        return Asked(motion.drive(rig.size), _times(motion), [])
    if any(x is not None for x in (motion.force, motion.duration, motion.rate)):
        raise InputError("--drive brings its own force and times: leave out the other options.")
    run = read_recording(recording, rig)
    for fault in run.faults:
        print(f"warning: {fault}", file=sys.stderr)
    return Asked(drive_from_recording(run), run.time, run.faults)


def _times(motion: Motion) -> Any:
    import numpy as np

    from .._errors import InputError

    length, frequency = motion.seconds or 8.0, motion.hertz or 500.0
    count = round(length * frequency)
    if not 1 <= count <= LONGEST:
        raise InputError(
            f"`duration` times `rate` must give 1 to {LONGEST} samples, but gives {count}."
        )
    return np.arange(count + 1) / frequency


def _run(
    rig: Any, asked: Asked, numerics: Numerics, before: Path | None, resume: bool
) -> tuple[Any, Any]:
    """The run and, where it was interrupted, the state to go on from."""
    from ._simulate_run import interrupted_run, perform

    begun = interrupted_run(before, rig, numerics.model, _command()) if resume else None
    return perform(
        rig, asked.drive, asked.times, begun, model=numerics.model, solver=numerics.solver,
        rtol=numerics.rtol or 1e-8, max_steps=numerics.max_steps or 200_000,
    )  # fmt: skip


def _written(
    run: Any, end: Any, name: str, rig: Any, out: Path | None, plot: Path | None
) -> dict[str, str]:
    """The files that were asked for."""
    from ..simulation import save_trajectory

    files = {}
    if out is not None:
        beside = _rig_file(name, rig, out)
        files["out"] = str(save_trajectory(run, out, rig, beside, _command(), end))
    if plot is not None:
        files["plot"] = str(_plot(run, name, plot))
    return files


def _command() -> str:
    """This command; resumed, it is still the same."""
    return command_line(without=("--resume",))


def _code(run: Any, out: Path | None) -> int:
    """The exit code, and on stderr what to do about a run that did not reach its end."""
    import sys

    from .._status import Status
    from ._frame import FAILED, INTERRUPTED, OK

    if run.ok:
        return OK
    print(run.message(), file=sys.stderr)
    if int(run.status) != Status.INTERRUPTED:
        return FAILED
    if out is not None and out.name.endswith(".nc"):
        print(f"Go on with: {_command()} --resume", file=sys.stderr)
    return INTERRUPTED


def _check_files(out: Path | None, plot: Path | None) -> None:
    if out is not None:
        from ..simulation import check_suffix

        check_suffix(out)
    check_picture(plot)


def _claim(
    name: str, rig: Any, out: Path | None, plot: Path | None, resume: bool, force: bool
) -> None:
    """Every file that this run will write, before it begins."""
    from .._files import claim
    from ..recording import files_of_recording
    from ..rig import files_of_rig

    files = [plot]
    if out is not None:
        files += [out] if out.name.lower().endswith(".nc") else files_of_recording(out)
        copy = _copy_of_rig(name, out)
        files += [] if copy is None else files_of_rig(rig, copy)
    claim(files, force=force, resumed=out if resume else None)


def _rig_file(name: str, rig: Any, out: Path) -> Path | None:
    """The rig file that NAME.toml of a recording names; of a bundled rig, a copy beside the run."""
    from ..rig import rig_path, save_rig

    copy = _copy_of_rig(name, out)
    return rig_path(name) if copy is None else save_rig(rig, copy)


def _copy_of_rig(name: str, out: Path) -> Path | None:
    """Where the copy of a bundled rig goes; None for a rig file of the user's, and for .nc."""
    from ..rig import bundled_rigs, rig_path

    if out.name.lower().endswith(".nc") or rig_path(name) != bundled_rigs().get(name):
        return None
    return out.with_name(f"{out.name.split('.')[0]}-rig.toml")


def _plot(run: Any, name: str, path: Path) -> Path:
    from .._files import writing
    from ..report import figure, style
    from ..simulation import plot_run

    with writing(path) as part, style():
        picture, axes = figure(4)
        plot_run(run, axes)
        axes[0].set_title(Path(name).stem if run.ok else f"{Path(name).stem}: {run.message()}")
        picture.savefig(part, dpi=150)
    return path
