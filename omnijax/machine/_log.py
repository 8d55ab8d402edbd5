"""Logs of a machine: any table, any column names and units, and the NAME.toml beside it."""

import dataclasses
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from .._errors import InputError, did_you_mean
from ..recording import may_be_run, ordered_rows, read_table, stem_of, unwound, usual_step
from ..rig import Quantity
from ._sample_times import evenly, first_speed, jitters, travelled, unbroken
from ._unit_of_channel import factor_of

KEYS = ("machine", "log", "role", "rows", "rate", "channels", "units", "noise")
ROLES = ("train", "held-out")
LEAST = 64  # samples
OTHER = 0.01  # share by which a stated rate is another one than that of the times
TABLES: dict[str, tuple[tuple[type, ...], str]] = {  # of a NAME.toml: what their entries are
    "channels": ((str, int, float), "the name of a column, or a number"),
    "units": ((str,), "a unit"),
    "noise": ((str, int, float), "a 1-sigma"),
}
MEASURED = ("position", "velocity")  # what a machine is compared by, the first that a log has


class LogRows(NamedTuple):
    """Rows [first, end) of one column of a file."""

    file: Path
    column: str
    first: int
    end: int

    def share_in(self, other: "LogRows") -> float:
        """Share of the rows that are among others too."""
        if (self.file.resolve(), self.column) != (other.file.resolve(), other.column):
            return 0.0
        both = min(self.end, other.end) - max(self.first, other.first)
        return max(0, both) / (self.end - self.first)


@dataclasses.dataclass
class Log:
    """One run: uniform time in s, inputs and outputs in SI units by name.

    `noise` is the declared 1-sigma by output; `faults` are sentences about what was wrong.  Where
    `measured` is the velocity, the position is its integral from 0.  A log of inputs alone has no
    outputs.  `rows` are those of what was measured, in its file.
    """

    name: str
    role: str
    time: np.ndarray
    inputs: dict[str, np.ndarray]
    outputs: dict[str, np.ndarray]
    noise: dict[str, float] = dataclasses.field(default_factory=dict)
    faults: list[str] = dataclasses.field(default_factory=list)
    measured: str = "position"  # or velocity
    rows: LogRows | None = None

    @property
    def step(self) -> float:
        """Sampling step, s."""
        return float(self.time[1] - self.time[0])

    @property
    def is_compared(self) -> bool:
        """Whether it shows how the machine moved, or its inputs alone."""
        return self.measured in self.outputs

    @property
    def shown(self) -> np.ndarray:
        """What was measured (t,): positions, or velocities."""
        return self.outputs[self.measured]

    @property
    def start(self) -> dict[str, tuple[float, float]]:
        """Position and its rate at the first sample, by output: where a free run begins.

        Under inputs alone it begins at rest at 0.
        """
        if not self.is_compared:
            return {"position": (0.0, 0.0)}
        q = self.outputs["position"]
        v = self.shown[0] if self.measured == "velocity" else first_speed(q, self.step)
        return {"position": (float(q[0]), float(v))}


@dataclasses.dataclass
class LogFile:
    """What NAME.toml says: where the log is, its role, names, units and noise."""

    path: Path
    log: Path
    machine: Path | None = None
    role: str = "train"
    rows: tuple[int, int] | None = None
    rate: float | None = None  # Hz, of a log without a column of time
    channels: dict[str, Any] = dataclasses.field(default_factory=dict)
    units: dict[str, str] = dataclasses.field(default_factory=dict)
    noise: dict[str, Any] = dataclasses.field(default_factory=dict)  # as it stands there


def read_log_file(path: Path, data: Mapping[str, Any], log: Path | None = None) -> LogFile:
    """A NAME.toml; `log` is the table beside it."""
    wrong = [f"`{k}` is not a key of a run.{did_you_mean(k, KEYS)}" for k in data if k not in KEYS]
    role = data.get("role", "train")
    if role not in ROLES:
        wrong.append(f"`role` must be train or held-out, but is {role!r}.")
    rows = data.get("rows")
    good = rows is None or (
        isinstance(rows, list) and len(rows) == 2 and all(isinstance(x, int) for x in rows)
        and 0 <= rows[0] < rows[1]
    )  # fmt: skip
    if not good:
        wrong.append(f"`rows` must be two row numbers [first, end), but is {rows!r}.")
    wrong += [x for key in TABLES for x in _wrong_entries(key, data.get(key, {}))]
    for key in ("machine", "log"):
        if not isinstance(data.get(key, ""), str):
            wrong.append(f"`{key}` must be the path of a file, but is {data[key]!r}.")
    rate = None
    if "rate" in data:
        try:
            rate = Quantity("Hz", above=0).read(data["rate"])
        except ValueError as error:
            wrong.append(f"`rate` {error}")
    named = data.get("log")
    log = path.parent / named if isinstance(named, str) else log
    if log is None:
        wrong.append("`log` is missing: no table of the same name stands beside it.")
    if wrong:
        raise InputError(wrong, path.name)
    machine = data.get("machine")
    return LogFile(
        path, Path(str(log)), None if machine is None else path.parent / machine, role,
        None if rows is None else (rows[0], rows[1]), rate, data.get("channels", {}),
        data.get("units", {}), data.get("noise", {}),
    )  # fmt: skip


def _wrong_entries(key: str, table: Any) -> list[str]:
    """What is wrong with one of the `TABLES` of a NAME.toml."""
    if not isinstance(table, dict):
        return [f"`{key}` must be a table, but is {table!r}."]
    kinds, words = TABLES[key]
    return [
        f"`{key}.{name}` must be {words}, but is {x!r}."
        for name, x in table.items() if isinstance(x, bool) or not isinstance(x, kinds)
    ]  # fmt: skip


def read_log(
    file: LogFile,
    inputs: Mapping[str, str],
    outputs: Mapping[str, str],
    compared: bool = True,
) -> Log:
    """The run that a `LogFile` speaks of; `inputs` and `outputs` are the machine's, with units.

    Of a log that is not to be `compared` with the machine the inputs are enough.

    Raises `InputError` for a log that is no file, for channels that machine or log lack, and for
    what in its columns cannot be used.
    """
    if not file.log.is_file():
        raise InputError(f"{file.path.name}: `log` names {file.log}, which is not a file.")
    table = read_table(file.log)
    units = {"t": "s", **inputs, **outputs}
    wrong = [
        f"`{key}.{name}` is no channel of the machine.{did_you_mean(name, units)} "
        f"Channels: {', '.join(units)}."
        for key in TABLES for name in getattr(file, key) if name not in units
    ]  # fmt: skip
    if wrong:
        raise InputError(wrong, file.path.name)
    noise = _declared_noise(file, units)
    faults: list[str] = []
    signals = {name: _column(file, table, name, units[name], faults) for name in units}
    signals = {k: x for k, x in signals.items() if x is not None}
    if file.rate is not None:
        faults += _other_rate(file, file.rate, signals.get("t"))
        signals["t"] = np.arange(len(next(iter(table.columns.values())))) / file.rate
    where = file.log.name
    _check_lengths(where, signals)
    for name in ("t", next(iter(inputs))):
        if name not in signals:
            raise InputError(
                f"{where} has no column `{name}` ({units[name]}). Say which one it is: [channels] "
                f'{name} = "..." in {file.path.name}; columns: '
                f"{', '.join(list(table.columns)[:12])}."
            )
    measured = measured_of(signals)
    if compared and measured is None and measured_of(outputs) is not None:
        said = " or ".join(f"`{k}` ({units[k]})" for k in MEASURED if k in outputs)
        raise InputError(
            f"{where} has no column {said}. Say which one it is: "
            f'[channels] {measured_of(outputs)} = "..." in {file.path.name}; columns: '
            f"{', '.join(list(table.columns)[:12])}."
        )
    first, end = _rows(file, len(signals["t"]), faults)
    signals = {k: x[first:end] for k, x in signals.items()}
    for name in inputs:
        signals.setdefault(name, np.ones(len(signals["t"])))
    used = {str(file.channels.get(k, k)) for k in signals}
    faults[:0] = [str(x) for x in table.faults if not x.column or x.column in used]
    log = _on_a_grid(file, signals, inputs, outputs, measured, noise, faults)
    column = str(file.channels.get(log.measured, log.measured))
    return dataclasses.replace(log, rows=LogRows(file.log, column, first, end))


def _other_rate(file: LogFile, rate: float, time: np.ndarray | None) -> list[str]:
    """That the stated `rate` in Hz is not that of the times (t,) in s, where the log has some."""
    steps = np.array([]) if time is None else np.diff(time)
    steps = steps[steps > 0]
    if not len(steps) or abs(usual_step(steps) * rate - 1) <= OTHER:
        return []
    return [
        f"{file.path.name}: `rate` says {rate:g} Hz, the column `t` of {file.log.name} "
        f"{1 / usual_step(steps):.4g} Hz; `rate` counts."
    ]


def _rows(file: LogFile, count: int, faults: list[str]) -> tuple[int, int]:
    """The rows [first, end) of `count` that are read; `InputError` where none are there."""
    first, end = file.rows or (0, count)
    if first >= count:
        raise InputError(f"{file.path.name}: `rows` begins at {first}, but {file.log.name} has "
                         f"{count} rows.")  # fmt: skip
    if end > count:
        faults.append(
            f"{file.path.name}: `rows` ends at {end}, but {file.log.name} has {count} rows; it is "
            "read to its end."
        )
    return first, min(end, count)


def _declared_noise(file: LogFile, units: Mapping[str, str]) -> dict[str, float]:
    """The 1-sigma in SI by channel; `InputError` for what is none."""
    noise, wrong = {}, []
    for name, given in file.noise.items():
        try:
            noise[name] = Quantity(units[name], low=0).read(given)
        except ValueError as error:
            wrong.append(f"`noise.{name}` {error}")
    if wrong:
        raise InputError(wrong, file.path.name)
    return noise


def _check_lengths(where: str, signals: Mapping[str, np.ndarray]) -> None:
    """`InputError` for channels that are not as long as the first one: loggers of two rates."""
    first, length = next(((k, len(x)) for k, x in signals.items()), ("", 0))
    for name, x in signals.items():
        if len(x) != length:
            raise InputError(f"{where}: `{name}` has {len(x)} values, but `{first}` {length}: all "
                             "channels of a log need the same times.")  # fmt: skip


def measured_of(names: Collection[str]) -> str | None:
    """Which of some outputs is compared: the position where it is there, else the velocity."""
    return next((k for k in MEASURED if k in names), None)


def _column(file: LogFile, table, name: str, unit: str, faults) -> np.ndarray | None:
    """One channel in SI; a number in [channels] is a constant in the unit that [units] gives."""
    theirs = file.channels.get(name, name)
    if isinstance(theirs, int | float) and not isinstance(theirs, bool):
        values = np.full(len(next(iter(table.columns.values()))), float(theirs))
    elif theirs in table.columns:
        values = np.asarray(table.columns[theirs], float)
    elif name in file.channels:
        raise InputError(
            f"{file.path.name}: `channels.{name}` names the column {theirs!r}, which "
            f"{file.log.name} does not have.{did_you_mean(str(theirs), table.columns)}"
        )
    else:
        return None
    said = file.units.get(name) or table.units.get(theirs)
    own = not isinstance(theirs, str) or theirs == name
    if said is None and not own and unit not in ("1", "s"):
        faults.append(f"{file.log.name}, column `{theirs}`: no unit of it is said; it is read as "
                      f"{unit} ([units] in {file.path.name} says another).")  # fmt: skip
    if said in (None, unit):
        return values
    try:
        return values * factor_of(said, unit)
    except ValueError:
        if name in file.units:
            raise InputError(f"{file.path.name}: `units.{name}` must be a unit of {unit}, but is "
                             f"{said!r}.") from None  # fmt: skip
        if unit == "1":  # a command has any unit: what one of it is says the motor's constant
            return values
        faults.append(f"{file.log.name}, column `{theirs}`: the file says {said!r}, which is no "
                      f"unit of {unit}; it is read as {unit}.")  # fmt: skip
        return values


def _on_a_grid(
    file: LogFile, signals, inputs, outputs, measured: str | None, noise: dict[str, float], faults
) -> Log:
    """Finite rows on a uniform grid from zero; short or resting logs are refused."""
    log, needed = file.log.name, [*inputs, *([measured] if measured else [])]
    signals = _finite(log, _ordered(file, signals, faults), needed, faults)
    signals = _unbroken(log, signals, faults)
    angles = [k for k, unit in outputs.items() if k in signals and unit == "rad"]
    signals = _unwound(log, signals, angles, faults)
    if measured and np.ptp(signals[measured]) == 0:
        raise InputError(f"{log}: the {measured} never changes: all at rest.")
    signals, step = _even(log, signals, faults)
    shown = {k: signals[k] for k in outputs if k in signals}
    if measured == "velocity":
        shown["position"] = travelled(shown["velocity"], step)
    return Log(
        stem_of(file.log) if file.rows is None else file.path.stem,
        file.role,
        np.arange(len(signals["t"])) * step,
        {k: signals[k] for k in inputs},
        shown,
        noise,
        faults,
        measured or "position",
    )


Signals = dict[str, np.ndarray]  # channels (t,) by name, `t` among them


def _ordered(file: LogFile, signals: Signals, faults) -> Signals:
    """The rows of one run in which time goes on."""
    first = 0 if file.rows is None else file.rows[0]
    rows, told = ordered_rows(file.log.name, signals["t"], first)
    faults += map(str, told)
    return {k: x[rows] for k, x in signals.items()}


def _finite(log: str, signals: Signals, needed, faults) -> Signals:
    """The rows in which all `needed` channels have numbers."""
    finite = np.all([np.isfinite(signals[k]) for k in needed], axis=0)
    count = int(finite.sum())
    if count < len(finite):
        faults.append(f"{log}: {len(finite) - count} rows have no number; they are left out.")
    check_count(log, count)
    return {k: x[finite] for k, x in signals.items()}


def check_count(log: str, count: int) -> None:
    """`InputError` for fewer than `LEAST` rows."""
    if count < LEAST:
        raise InputError(f"{log} has {count} usable rows, but at least {LEAST} are needed.")


def _unbroken(log: str, signals: Signals, faults) -> Signals:
    """The longest stretch without a gap."""
    t = signals["t"]
    part = unbroken(t)
    count = part.stop - part.start
    if count == len(t):
        return signals
    faults.append(
        f"{log}: nothing can be used for some time; of {len(t)} rows the longest stretch without "
        f"such a gap is used: from {t[part][0]:.6g} s to {t[part][-1]:.6g} s, {count} rows."
    )
    if count < LEAST:
        raise InputError(faults[-1])
    return {k: x[part] for k, x in signals.items()}


def _unwound(log: str, signals: Signals, angles: Sequence[str], faults) -> Signals:
    """The channels with the `angles` that are told within one turn as such that go on.

    Rows are left out behind or before a gap in which nobody knows how often such an angle turned.
    """
    for name in angles:
        told = unwound(signals[name], signals["t"])
        if told is None:
            faults += _unknown_turns(log, name, signals[name])
            continue
        faults.append(
            f"{log}: the {name} is told within {told.words}; it is read as one that goes on."
        )
        signals = {k: x[~told.lost] for k, x in (signals | {name: told.angle}).items()}
        if told.lost.any():
            faults.append(
                f"{log}: how often the {name} turned in a gap is not known; {told.lost.sum()} rows "
                "beside it are left out."
            )
    check_count(log, len(signals["t"]))
    return signals


def _unknown_turns(log: str, name: str, angle: np.ndarray) -> list[str]:
    """What is said of an angle (t,) in rad that jumps as a wrapped one, but need not be one."""
    jumps = int(np.sum(np.abs(np.diff(angle)) > np.pi))
    if not jumps or np.ptp(angle) > 2 * np.pi * (1 + 1e-6):
        return []
    often = f"{jumps} time{'s' if jumps > 1 else ''}"
    return [
        f"{log}: the {name} jumps by more than half a turn {often}; whether it is told within one "
        "turn cannot be told, and it is read as it stands."
    ]


def _even(log: str, signals: Signals, faults) -> tuple[Signals, float]:
    """The channels at even times, and their step in s."""
    t = signals["t"]
    step = usual_step(np.diff(t))
    if not jitters(t, step):
        return signals, step
    faults.append(
        f"{log}, column `t`: the steps differ by up to "
        f"{1e3 * np.max(np.abs(np.diff(t) - step)):.3g} ms from {1e3 * step:.4g} ms; all channels "
        "are laid on an even grid."
    )
    return dict(zip(signals, evenly(t, step, *signals.values()), strict=True)), step


def tables_of(folder: Path) -> dict[str, Path]:
    """Tables of a folder by name without suffix."""
    return {stem_of(p): p for p in sorted(folder.iterdir()) if may_be_run(p)}
