"""A file and its NAME.toml into a `Recording`, with everything that is wrong said."""

import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from .._errors import InputError
from .._reading import existing
from ._columns import INPUTS, channels, columns, count_wheels, group_of, unit_of
from ._formats import CsvTable, read_table, stem_of
from ._recording import Fault, Recording, spans
from ._sidecar import Sidecar, check_wheels, hint, is_gravity, read_sidecar, to_si
from ._time import usable_rows
from ._turns import unwrap
from ._units import mend_units
from ._values import clean, far_inputs, mend_inputs

FINER = (("ms", 1e3), ("us", 1e6), ("ns", 1e9))
LONG = {"ms": "milliseconds", "us": "microseconds", "µs": "microseconds"}
SLOW = 0.2  # s; a longer sampling step is one in milliseconds


def read_recording(path: str | Path, rig: Any = None) -> Recording:
    """Read one run: CSV, CSV.gz, Parquet, MAT, NetCDF, TDMS, UFF or MDF4, and NAME.toml beside it.

    With `rig` the number of wheels and the plausible size of every channel are checked too.  What
    is wrong but usable stands in `Recording.faults`; `InputError` where nothing can be used.

    Columns are SI.  Raises `InputError` where nothing can be used.
    """
    path = existing(path)
    sidecar = read_sidecar(path.with_name(stem_of(path) + ".toml"))
    return build_recording(path, read_table(path), sidecar, rig)


def rig_of_recording(path: str | Path) -> Path | None:
    """The rig file that NAME.toml beside a recording names."""
    path = Path(path)
    return read_sidecar(path.with_name(stem_of(path) + ".toml")).rig if path.is_file() else None


def build_recording(path: Path, table: CsvTable, sidecar: Sidecar, rig: Any = None) -> Recording:
    """A recording from a table as it stands in the file."""
    faults = list(table.faults)
    named = _renamed(path.name, table.columns, sidecar)
    wheels = _wheels(path.name, named, rig)
    check_wheels(path.name, sidecar, wheels)
    named = _known(path.name, named, wheels, faults)
    _scale_units(path.name, named, table, sidecar, faults)
    _same_length(path.name, named, faults)
    rows, row_faults = usable_rows(path.name, named["t"])
    faults += row_faults
    values = {c: named[c][rows] for c in columns(wheels)[1:] if c in named}
    time = named["t"][rows]
    noise = {**table.noise, **sidecar.noise}
    about = (wheels, sidecar.role, noise, sidecar.rig, faults, rows + 1)
    run = Recording(stem_of(path), path, time, values, *about)
    faults += clean(path.name, values, run.rows, lambda c: run.declared_noise(c) == 0)
    faults += unwrap(path.name, values, time, run.rows)
    _check_inputs(path.name, run)
    faults += far_inputs(path.name, values, run.rows)
    run.lost, input_faults = mend_inputs(path.name, values, time, run.rows)
    faults += input_faults
    if rig is not None:
        mend_units(run, rig, set(sidecar.units))
    if not run.groups:
        what = "no output was measured"
        faults.append(
            Fault(path.name, "", (), "no outputs", what, "a simulation can use it as a drive")
        )
    return run


def _renamed(file: str, columns: dict[str, np.ndarray], sidecar: Sidecar) -> dict[str, np.ndarray]:
    """Columns by our names; `InputError` for a mapping to a column that is not there."""
    named = dict(columns)
    for ours, theirs in sidecar.channels.items():
        if theirs not in columns:
            raise InputError(
                f"{sidecar.path.name}: `channels.{ours}` names the column {theirs!r}, which "
                f"{file} does not have{hint(theirs, columns)}."
            )
        named.pop(theirs, None)
    return named | {ours: columns[theirs] for ours, theirs in sidecar.channels.items()}


def _wheels(file: str, named: dict[str, np.ndarray], rig: Any) -> int:
    """Number of wheels of the file; `InputError` where the rig has another."""
    if "t" not in named:
        raise InputError(f"{file} has no column `t` (time in s){_time_like(file, named)}.")
    wheels = count_wheels(named)
    if rig is not None and wheels != rig.size:
        names = ", ".join(f"`{c}`" for c in channels("torque", rig.size) if c not in named)
        lacks = f"; missing: {names}" if names else ""
        raise InputError(
            f"{file} has torques for {wheels} wheels, but the rig has {rig.size} "
            f"({', '.join(rig.names)}){lacks}."
        )
    missing = [c for c in channels("torque", max(wheels, 1)) if c not in named]
    if missing:
        near = hint(missing[0], named)
        names = ", ".join(f"`{c}`" for c in missing)
        raise InputError(f"{file} lacks the input{'s' * (len(missing) > 1)} {names}{near}.")
    return wheels


def _time_like(file: str, named: Iterable[str]) -> str:
    """How to name the column that is the time, or the file's columns where none looks like it."""
    for column in named:
        if re.match(r"(time|zeit|t)\b", column.strip().lower()):
            sidecar = f"{stem_of(Path(file))}.toml"
            return f'; is it `{column}`? Then write to {sidecar}: channels = {{ t = "{column}" }}'
    return f"; its columns are {', '.join(f'`{column}`' for column in named)}"


def _known(file: str, named: dict[str, np.ndarray], wheels: int, faults: list[Fault]) -> dict:
    known = columns(wheels)
    for name in named:
        if name not in known:
            absent = [c for c in known if c not in named]
            what = f"the column is not known{hint(name, absent or known)}"
            faults.append(Fault(file, name, (), "unknown column", what, "it is not used"))
    forces = [c for c in channels("force", wheels) if c not in named]
    if len(forces) in (1, 2):
        what = "the other components of the force are there"
        for column in forces:
            faults.append(Fault(file, column, (), "missing column", what, "taken as zero"))
    zero = {column: np.zeros(len(named["t"])) for column in forces}
    return {name: x.copy() for name, x in named.items() if name in known} | zero


def _scale_units(
    file: str, named: dict[str, np.ndarray], table: CsvTable, sidecar: Sidecar, faults: list[Fault]
) -> None:
    """Bring every column to SI; units of NAME.toml count before those that the file states."""
    for column, values in list(named.items()):
        unit = _stated_unit(column, table, sidecar)
        if unit is None or unit == unit_of(column):
            continue
        try:
            named[column] = values * to_si(column, unit)
        except ValueError as error:
            use, what = f"it is read as {unit_of(column)}", str(error).rstrip(".")
            faults.append(Fault(file, column, (), "unit", f"the file says {what}", use))
        if is_gravity(column, unit):
            what = f"{unit!r} of an acceleration is no mass"
            use = f"it is read as {to_si(column, unit):g} m/s^2"
            faults.append(Fault(file, column, (), "unit", what, use))
    step = np.median(np.abs(np.diff(named["t"]))) if len(named["t"]) > 2 else 0.0
    if step > SLOW and _stated_unit("t", table, sidecar) is None:
        unit, factor = next(((u, f) for u, f in FINER if step / f <= SLOW), FINER[-1])
        what = f"the step is {step:g} s, which looks like {LONG.get(unit, unit)}"
        use = f'it is read as {unit}; `units.t = "s"` in NAME.toml keeps it'
        named["t"] = named["t"] / factor
        faults.append(Fault(file, "t", (), "unit", what, use))


def _stated_unit(column: str, table: CsvTable, sidecar: Sidecar) -> str | None:
    """What NAME.toml says that a column is in, for it or its group; else what the file says."""
    unit = table.units.get(sidecar.channels.get(column, column))
    return sidecar.units.get(column, sidecar.units.get(group_of(column), unit))


def _same_length(file: str, named: dict[str, np.ndarray], faults: list[Fault]) -> None:
    for column in [c for c in named if len(named[c]) != len(named["t"])]:
        what = f"the column has {len(named.pop(column))} values, but `t` {len(named['t'])}"
        if group_of(column) in INPUTS:
            raise InputError(f"{file}, column `{column}`: {what}.")
        faults.append(Fault(file, column, (), "length", what, "the channel is not used"))


def _check_inputs(file: str, run: Recording) -> None:
    for group in INPUTS:
        for column in channels(group, run.wheels):
            values = run.channels[column]
            if np.isfinite(values).sum() < max(2, len(values) // 2):
                rows = spans(~np.isfinite(values), run.rows)
                gone = f"{sum(b - a + 1 for a, b in rows)} of {len(values)} values are missing"
                raise InputError(f"{file}, column `{column}`: {gone}, and inputs must be known.")
