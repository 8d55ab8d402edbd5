"""`omnijax case new`: a case from a stranger's log."""

import textwrap
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from ._inputs import Force


def case(
    action: Literal["new"],
    logs: list[Path],
    /,
    *,
    out: Path | None = None,
    input: str | None = None,  # the option's name
    position: str | None = None,
    velocity: str | None = None,
    time: str | None = None,
    rate: float | None = None,
    unit: Annotated[list[str] | None, Parameter(negative="")] = None,
    held_out: Annotated[list[Path] | None, Parameter(negative="")] = None,
    yes: Annotated[bool, Parameter(negative="")] = False,
    force: Force = False,
) -> int:
    """Look at logs of one axis, guess what they hold, and write a case after a yes.

    Example: omnijax case new motor.csv --yes, then: omnijax diagnose motor

    Parameters
    ----------
    action
        `new`: a new case.
    logs
        Tables of runs: CSV and other text, Parquet, MAT, NetCDF, TDMS, UFF, MDF4, JSON, MCAP.
    out
        Folder of the case; default: the first log's name.
    input
        Column of the input, where the guess is wrong.
    position
        Column of the measured position.
    velocity
        Column of the measured velocity, of logs that have no position.
    time
        Column of the time.
    rate
        Sampling rate in Hz of logs without a time.
    unit
        Unit of a channel (time, input, position, velocity) that the log does not say, as
        `position="360/4096 deg"`; may be given several times.
    held_out
        A further log that is never fitted but judges; may be given several times. Without one the
        last third of every log plays it.
    yes
        Write without asking.
    """
    from .._errors import InputError
    from .._files import claim, write_text
    from .._reading import existing
    from ..machine import case_files, guess, of_one_machine
    from ..recording import stem_of

    held = [log.resolve() for log in held_out or []]
    logs = [x for x in logs if x.resolve() not in held]  # all of a folder by *, some held out
    if not logs:
        raise InputError("every log is held out; at least one must be there to learn from.")
    for log in (*logs, *held):
        existing(log)
    if position and velocity:
        raise InputError("give --position or --velocity: an axis is compared by one of both.")
    columns = {"time": time, "given": input, "position": position, "velocity": velocity}
    units = _units(unit or [])
    folder = out or Path(stem_of(logs[0]))
    claim(folders=[folder], force=force)
    guesses = of_one_machine([guess(log, rate, **columns, units=units) for log in (*logs, *held)])
    if len({one.measured for one in guesses}) > 1:
        raise InputError("some logs give a position, others a velocity alone: name one of both "
                         "with --position or --velocity.")  # fmt: skip
    names = [stem_of(one.log) for one in guesses]
    if len(set(names)) < len(names):
        twice = next(x for x in names if names.count(x) > 1)
        raise InputError(f"two logs are named {twice}: rename one, a case has one NAME.toml each.")
    for one in guesses:
        print(f"{one.log.name}")
        for key, value in one.rows():
            print(f"  {key:<20} {value}")
    files = case_files(guesses, [one.log for one in guesses if one.log.resolve() in held])
    print(f"machine.toml, to begin with\n{textwrap.indent(files['machine.toml'], '  ')}")
    if not yes:
        try:
            answer = input_line(f"Write the case {folder}? [y/N] ")
        except EOFError:
            raise InputError("no answer: say --yes to write without being asked.") from None
        if answer.strip().lower() not in ("y", "yes"):
            print("Nothing was written.")
            return 0
    for name, text in files.items():
        write_text(folder / name, text)
    print(f"Wrote {folder}: {', '.join(files)}. Now: omnijax diagnose {folder}")
    return 0


def _units(said: list[str]) -> dict[str, str]:
    """Units by channel of `CHANNEL=UNIT`."""
    from .._errors import InputError

    out = {}
    for one in said:
        channel, mark, unit = one.partition("=")
        channel = {"time": "t"}.get(channel.strip(), channel.strip())
        if not mark or channel not in ("t", "input", "position", "velocity"):
            raise InputError(
                "--unit must be time, input, position or velocity with its unit, as "
                f'position="360/4096 deg", but is {one!r}.'
            )
        out[channel] = unit.strip()
    return out


input_line = input
