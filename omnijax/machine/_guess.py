"""What a stranger's log probably holds: time, input, position, units, rate, noise."""

import dataclasses
import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from .._errors import InputError
from ..recording import read_table
from ._axis import INPUTS
from ._first_numbers import LogSignals
from ._hold import input_hold
from ._log import LEAST, evenly, increasing, travelled, unbroken, unwound
from ._log import MEASURED as MEASURABLE
from ._second_numbers import coupled
from ._unit_of_channel import factor_of

TIME = r"^(t|time|timestamp|zeit|stamp|seconds|sec|ms)\b|time"
GOAL = r"goal|ref|set_?-?point|target|desired|_des$|soll"
INPUT = (
    r"^(u\d*|vir|v1|v_?(in|m|a)|i|i_?[qam]|amps?|in|input)$|^tau|cmd|torque|force|volt|curr|command"
    rf"|moment|duty|pwm|spannung|strom|kraft|{GOAL}"
)
COUNTS = r"counts?$|ticks|incr|inkr"  # of an encoder, whose lines a turn no log tells
POSITION = rf"^(y|q|qm|x|v2|out|th)$|pos|angle|theta|phi|encoder|deg|winkel|weg|displ|{COUNTS}"
SPEED = r"speed|veloc|(^|_)vel|rpm|omega|drehzahl|geschw|tacho|dot$|^(w|v|n|z\d*)$|/ ?s\b"
MEASURED = r"meas|act|enc|fb"
KINDS = (  # pattern of a name -> how the motor is driven, where its unit does not say it
    (r"torque|force|moment|kraft", "torque"),
    (r"curr|strom|^amps?\b|^i(_?[qam])?($|[ _(\[])", "current"), (r"volt|spannung", "command"),
    (GOAL, "goal"),
)  # fmt: skip
DRIVES = {  # unit of an input -> how the motor is driven
    unit: drives for drives, units in (
        ("torque", "N kN mN Nm Ncm Nmm mNm kNm N·m N*m"), ("current", "A mA µA uA"),
        ("command", "V mV kV"), ("goal", "° deg degrees rad radians mrad mm"),
    ) for unit in units.split()
} | dict.fromkeys(("N m", "N cm", "N mm", "mN m", "kN m"), "torque")  # fmt: skip
UNIT = re.compile(
    r"(?:[\[(_ .]|,|\s*/)\s*(mm|cm|um|µm|m|deg|degrees|°|rad|radians|mrad|ns|us|µs|ms|s"
    r"|[mk]?N[ ·*]?m|N ?[cm]m|[mk]?N|[muµ]?A|[mk]?V"
    r"|rpm|rev/min|U/min|1/min|(?:rad|mrad|deg|°|mm|cm|m)/s)\s*[\])]?$"
)
WORDS = {"degrees": "deg", "radians": "rad"}
SUPPLY = 0.2  # standard deviation of a voltage over its mean, below which it is a supply's
RISING = 0.5  # of a clock's steps: stamps of a coarse clock repeat, and their rows are left out
ALIKE = 4.0  # sizes of a goal and of what follows it, one over the other, in one unit
LONGEST = 0.2  # s, of a step; one that is longer is in a smaller unit
SMALLER = ("ms", "us", "ns")


@dataclasses.dataclass(frozen=True)
class Guess:
    """A log's channels with units, the sampling, the noise, and a machine to begin with.

    The column of the position is None where a velocity alone was measured.
    """

    log: Path
    time: str | None
    input: str
    position: str | None
    units: dict[str, str]
    drives: str
    motion: str
    samples: int
    rate: float
    noise: float
    signals: LogSignals
    beside: dict[str, str] = dataclasses.field(default_factory=dict)  # further inputs: column
    velocity: str | None = None
    second: str | None = None  # column of a load behind an elastic drive
    stated: dict[str, str] = dataclasses.field(default_factory=dict)  # units that the user says

    @property
    def measured(self) -> str:
        """The output that is compared: position or velocity."""
        return "velocity" if self.position is None else "position"

    def held(self) -> str:
        """How the input is read between its samples, in words."""
        told = input_hold([self.signals], self.turns())
        return told.sentence if told.sure else "held or linear: the diagnosis looks"

    def _read_as(self, unit: str) -> str:
        """The unit of what was measured where none is said: counts are taken for it as they are."""
        if not _best([self.position or self.velocity or ""], COUNTS):
            return unit
        return f'counts, read as {unit}; say what one is: --unit {self.measured}="360/4096 deg"'

    def turns(self) -> bool:
        """Whether it is a rotation."""
        return self.motion == "rotation"

    def load(self) -> str:
        """The load of a coupled drive, in words."""
        known = coupled([self.signals], self.turns())
        ratio = 1.0 if known is None else known.ratio
        return f"{self.second}" + (f", {ratio:.4g} times slower" if ratio != 1 else "")

    def rows(self) -> list[tuple[str, str]]:
        """The guess as pairs to be shown."""
        unit, shown = output_unit(self.motion, self.measured), self.position or self.velocity
        return [
            ("time", self.time or "none: from the rate"),
            ("input", f"{self.input} ({self.drives}, {self.units.get('input', 'as it is')})"),
            *([("input is read as", self.held())] if self.drives != "goal" else []),
            (self.measured, f"{shown} ({self.units.get(self.measured, self._read_as(unit))})"),
            *([("load behind a drive", self.load())] if self.second else []),
            *self.beside.items(),
            ("motion", self.motion), ("samples", f"{self.samples} at {self.rate:.6g} Hz"),
            (f"noise of {self.measured}", f"{self.noise:.3g} {unit} (1 sigma)"),
        ]  # fmt: skip


def guess(
    log: Path,
    rate: float | None = None,
    *,
    time: str | None = None,
    given: str | None = None,
    position: str | None = None,
    velocity: str | None = None,
    units: Mapping[str, str] | None = None,
) -> Guess:
    """Look at a log for the columns that are not named.  `rate` in Hz where it has none of time.

    `units` are those of `t`, `input`, `position` or `velocity` that are known: `360/4096 deg`.
    Raises `InputError` where no column looks like the input or the output, where the one that does
    never changes, for a column that the log lacks, or one that is named twice.
    """
    table = read_table(log)
    flat = {k: np.asarray(x, float) for k, x in table.columns.items() if np.ndim(x) == 1}
    columns = {k: np.where(np.isfinite(x), x, np.nan) for k, x in flat.items()}
    table = table._replace(columns=columns)
    moving = [k for k, x in columns.items() if len(np.unique(x[np.isfinite(x)])) > 1]
    time = time or _time(log, columns, moving, rate)
    named = (time, given, position, velocity)
    rest, still = ([k for k in some if k not in named]
                   for some in (moving, [k for k in columns if k not in moving]))  # fmt: skip
    words = _with_units(table)
    if given is None:
        driving = [k for k in rest if not _supplies(k, columns[k])]
        given = words.column(_input(words.of(driving)))
        if given is None:
            raise _not_found(log, "input", "--input COLUMN", columns, _best(still, INPUT))
    if not (position or velocity):
        others = words.of([k for k in rest if k != given])
        shown = _output([k for k in others if not _matches(k, INPUT)] or others)
        position, velocity = map(words.column, shown)
        if not (position or velocity):
            raise _not_found(
                log, "position or the speed", "--position COLUMN or --velocity COLUMN",
                columns, _best(still, f"{POSITION}|{SPEED}"),
            )  # fmt: skip
    one = _described(log, table, time, given, position, rate, velocity, units)
    others = [k for k in rest if k not in (given, position, velocity)
              and not _best(words.of([k]), INPUT)]  # fmt: skip
    same = [k for k in others
            if bool(_best(words.of([k]), SPEED)) == (one.measured == "velocity")]  # fmt: skip
    free = (position or velocity) not in named
    return one if one.drives == "goal" else _with_load(one, table, same, rate, free)


class _Words(dict[str, str]):
    """By column its name with the unit that its table says, as names are looked at."""

    def of(self, columns: Sequence[str]) -> list[str]:
        """The names of some columns."""
        return [self[k] for k in columns]

    def column(self, word: str | None) -> str | None:
        """The column of a name."""
        return next((k for k, x in self.items() if x == word), None)


def _with_units(table) -> _Words:
    """The names of a table's columns, with units that stand apart from them."""
    apart = {k: u for k, u in table.units.items() if not UNIT.search(k)}
    return _Words((k, f"{k} [{apart[k]}]" if k in apart else k) for k in table.columns)


def _with_load(one: Guess, table, others: Sequence[str], rate, free: bool) -> Guess:
    """The guess with the column of a load, where the relative motion is that of an elastic drive.

    What was taken for the motor may be the load where it is `free`, not named by the user.
    """
    best, told = one, 0.0
    for name in others:
        try:
            other = _of_column(one, table, name, one.measured, rate)
        except InputError:
            continue
        if other.motion != one.motion or other.samples != one.samples:
            continue
        for motor, load in ((one, other), (other, one))[: 1 + free]:
            both = _loaded(motor, load)
            known = coupled([both.signals], one.turns())
            if known is not None and known.told > told:
                best, told = both, known.told
    return best


def _loaded(motor: Guess, load: Guess) -> Guess:
    """The guess of a motor, with the column of another guess as its load's."""
    signals = dataclasses.replace(motor.signals, second=load.signals.position)
    return dataclasses.replace(motor, signals=signals, second=load.position or load.velocity)


def of_one_machine(guesses: Sequence[Guess]) -> list[Guess]:
    """The guesses of one machine's logs, with one answer to whether it has a load behind a drive.

    A log in which the drive is hardly bent does not show one: all logs together tell.
    """
    told = next((one for one in guesses if one.second), None)
    if told is None or all(one.second for one in guesses):
        return list(guesses)
    columns = [k for k in (told.position, told.velocity, told.second) if k]
    tables = [read_table(one.log) for one in guesses]
    if all(k in table.columns for table in tables for k in columns):
        pairs = [
            [_of_column(one, table, k, told.measured, None if one.time else one.rate)
             for k in columns]
            for one, table in zip(guesses, tables, strict=True)
        ]  # fmt: skip
        if all(motor.samples == load.samples for motor, load in pairs):
            loaded = [_loaded(motor, load) for motor, load in pairs]
            if coupled([one.signals for one in loaded], told.turns()):
                return loaded
    return [_alone(one) for one in guesses]


def _of_column(one: Guess, table, column: str, measured: str, rate: float | None) -> Guess:
    """The guess of the same log with another column as what was measured."""
    position, velocity = (column, None) if measured == "position" else (None, column)
    known = one.stated if UNIT.search(column) is None else {
        k: x for k, x in one.stated.items() if k != measured
    }  # fmt: skip
    return _described(one.log, table, one.time, one.input, position, rate, velocity, known)


def _alone(one: Guess) -> Guess:
    """The guess without a load."""
    signals = dataclasses.replace(one.signals, second=None)
    return dataclasses.replace(one, second=None, signals=signals)


def _not_found(log: Path, word: str, option: str, columns, still: str | None) -> InputError:
    """What is said where no column looks like a `word`; `still` does, but never changes."""
    if still is not None:
        why = "it never changes: all at rest"
        why = why if np.isfinite(columns[still]).any() else "it holds no numbers"
        return InputError(f"{log.name}: the column {still!r} looks like the {word}, but {why}.")
    return InputError(f"{log.name}: no column looks like the {word}; columns: "
                      f"{', '.join(columns)}. Name it: {option}.")  # fmt: skip


def _input(names: list[str]) -> str | None:
    """Column of the input among some names: of a goal of a speed only where there is no other."""
    inputs = [
        k for k in names if _matches(k, INPUT) or DRIVES.get(_unit(k) or "", "goal") != "goal"
    ]
    motors = [k for k in inputs if not (_drives(k, _unit(k)) == "goal" and _matches(k, SPEED))]
    return next(iter(motors or inputs), None)


def _drives(name: str, unit: str | None) -> str:
    """How an input drives the motor, by its unit, else by its name."""
    if unit in DRIVES:
        return DRIVES[unit]
    if _matches(name, "cmd|command") and _matches(name, POSITION):
        return "goal"
    return next((d for p, d in KINDS if _matches(name, p)), "command")


def _matches(name: str, pattern: str) -> bool:
    """Whether a column's name matches, as it is or without its unit: `x_mm` is as good as `x`."""
    bare = UNIT.sub("", name).strip().lower()
    return bool(re.search(pattern, name.lower()) or re.search(pattern, bare))


def _output(names: list[str]) -> tuple[str | None, str | None]:
    """(column of the position, or None and that of the speed) among some names."""
    speeds = [k for k in names if _best([k], SPEED)]
    others = [k for k in names if k not in speeds]
    by_unit = [k for k in others if DRIVES.get(_unit(k) or "") == "goal"]
    position = _best(others, POSITION, MEASURED) or next(iter(by_unit), None)
    return position, None if position else _best(speeds, SPEED, MEASURED)


def _described(log: Path, table, time: str | None, given: str, position: str | None,
               rate: float | None, velocity: str | None,
               stated: Mapping[str, str] | None = None) -> Guess:  # fmt: skip
    """The guess with its channels known; the `velocity` is read where there is no position."""
    shown, measured = (velocity, "velocity") if position is None else (position, "position")
    assert shown is not None  # one of both is given
    _check_columns(log, table, time, given, shown)
    units = {
        ours: u for ours, theirs in (("t", time), ("input", given), (measured, shown))
        if theirs and (u := table.units.get(theirs) or _unit(theirs))
    } | dict(stated or {})  # fmt: skip
    lengths = output_unit("translation", measured)
    motion = "translation" if _is_unit(units.get(measured), lengths) else "rotation"
    drives = _drives(given, units.get("input"))
    if drives == "goal" and (measured == "velocity" or _best([given], SPEED)):
        raise InputError(
            f"{log.name}: the input {given!r} looks like the goal of a controller, which an axis "
            "has for its position alone, not for a speed. Name the motor's torque, current or "
            "voltage: --input COLUMN."
        )
    if drives == "goal":
        units = _unit_of_both(units, table.columns[given], table.columns[shown])
    units = _fitting(units, motion, drives)
    for channel, unit in (stated or {}).items():
        if channel not in units:
            raise InputError(f"{log.name}: {unit!r} is no unit of the {channel}.")
    q = np.asarray(table.columns[shown], float)
    step = 1 / float(rate or 1.0) if time is None else _step_of(table.columns[time], units)
    q = _in_si(q, units.get(measured), output_unit(motion, measured))
    u = _in_si(table.columns[given], units.get("input"), _input_unit(motion, drives))
    beside = _beside(table.columns) if drives == "goal" else {}
    others = {k: np.asarray(table.columns[c], float) for k, c in beside.items()}
    t = np.arange(len(q)) * step
    if time is not None:
        t = _in_si(np.asarray(table.columns[time], float), units.get("t"), "s")
    good = np.all([np.isfinite(x) for x in (t, q, u, *others.values())], axis=0)
    t, q, u, others = t[good], q[good], u[good], {k: x[good] for k, x in others.items()}
    if output_unit(motion, measured) == "rad":
        q = unwound(q)
    kept = np.flatnonzero(increasing(t))
    kept = kept[unbroken(t[kept], np.flatnonzero(good)[kept])] if len(kept) > 1 else kept
    if len(kept) < LEAST:
        raise InputError(
            f"{log.name} has {len(kept)} usable rows, but at least {LEAST} are needed."
        )
    q, u, *rest = evenly(t[kept], step, *(x[kept] for x in (q, u, *others.values())))
    others = dict(zip(others, rest, strict=True))
    for word, values in (("input", u), (measured, q)):
        if np.ptp(values) == 0:
            raise InputError(f"{log.name}: the {word} never changes: all at rest.")
    signals = LogSignals(q, u, step, others)
    if measured == "velocity":
        signals = LogSignals(travelled(q, step), u, step, others, q)
    return Guess(log, time, given, position, units, drives, motion, len(q), 1 / step, _noise(q),
                 signals, beside, None if position else velocity,
                 stated=dict(stated or {}))  # fmt: skip


def _unit_of_both(units: dict[str, str], goal, position) -> dict[str, str]:
    """Units with that of a goal or position for the other one too, where only one has any.

    A controller compares them as they are; so where their sizes are alike, their units are.
    """
    known = {units[k] for k in ("input", "position") if k in units}
    sizes = np.nanstd(np.asarray(goal, float)), np.nanstd(np.asarray(position, float))
    if len(known) == 1 and max(sizes) < ALIKE * min(sizes):
        units = units | dict.fromkeys(("input", "position"), known.pop())
    return units


def output_unit(motion: str, measured: str) -> str:
    """SI unit of a position or velocity."""
    unit = "m" if motion == "translation" else "rad"
    return unit if measured == "position" else f"{unit}/s"


def _check_columns(log: Path, table, time: str | None, given: str, shown: str) -> None:
    """`InputError` for a column that a log's table lacks, or one that is named twice."""
    for name in filter(None, (time, given, shown)):
        if name not in table.columns:
            raise InputError(f"{log.name} has no column {name!r}; columns: "
                             f"{', '.join(table.columns)}.")  # fmt: skip
    lengths = {k: len(table.columns[k]) for k in (time, given, shown) if k}
    if len(set(lengths.values())) > 1:
        said = ", ".join(f"{k!r} {n}" for k, n in lengths.items())
        raise InputError(f"{log.name}: columns of other lengths ({said} values): all need the same "
                         "times.")  # fmt: skip
    if len({time, given, shown}) < 3:
        raise InputError(
            f"{log.name}: time, input and position or velocity must be three columns, but are "
            f"{time!r}, {given!r} and {shown!r}."
        )


def _step_of(column, units: dict[str, str]) -> float:
    """Median step of a column of times, s; milli- or microseconds where not said but likely."""
    t = np.asarray(column, float)
    t = t * (factor_of(units["t"], "s") if "t" in units else 1.0)
    steps = np.diff(t)
    step = float(np.median(steps[steps > 0]))
    for unit in SMALLER if "t" not in units else ():
        if step > LONGEST:
            step, units["t"] = step / 1000, unit
    return step


def _noise(q: np.ndarray) -> float:
    """1-sigma of white noise on a smooth signal: of its third to seventh differences the least."""
    return min(float(np.sqrt(np.mean(np.diff(q, k) ** 2) / math.comb(2 * k, k))) for k in (3, 5, 7))


def _beside(columns) -> dict[str, str]:
    """Columns of a servo's gain and of whether it is on, where they are there."""
    patterns = {"gain": r"^(k_?p|p_?gain|gain)$", "enable": r"enable|torque_on|^on$"}
    columns_of = {k: _best(list(columns), p) for k, p in patterns.items()}
    return {k: c for k, c in columns_of.items() if c is not None}


def _time(log: Path, columns, moving, rate) -> str | None:
    rising = [k for k in moving if np.all(np.diff(columns[k]) > 0)]
    named = [k for k in moving if re.search(TIME, k.lower())]
    usual = [k for k in named if np.mean(np.diff(columns[k]) > 0) > RISING]
    if usual or (rising and rate is None):
        return ([k for k in usual if k in rising] or usual or rising)[0]
    if rate is None and named:
        raise InputError(
            f"{log.name}: the column {named[0]!r} looks like time, but does not increase from row "
            "to row; give the sampling rate: --rate HZ."
        )
    if rate is None:
        raise InputError(
            f"{log.name}: no column looks like time; give the sampling rate: --rate HZ."
        )
    return None


def _best(names: list[str], pattern: str, better: str = "$^") -> str | None:
    matches = [k for k in names if _matches(k, pattern)]
    return next((k for k in matches if re.search(better, k.lower())), next(iter(matches), None))


def _supplies(name: str, x: np.ndarray) -> bool:
    """Whether a column is a supply's: a voltage that hardly changes drives nothing."""
    steady = np.nanstd(x) < SUPPLY * abs(np.nanmean(x))
    return bool("volt" in name.lower() and steady)


def _unit(name: str) -> str | None:
    match = UNIT.search(name)
    return WORDS.get(match[1], match[1]) if match else None


def _is_unit(said: str | None, si: str) -> bool:
    """Whether a text is a unit of the quantity whose SI unit is `si`."""
    try:
        return said is not None and factor_of(said, si) > 0
    except ValueError:
        return False


def _in_si(values, unit: str | None, si: str) -> np.ndarray:
    """A channel (t,) in SI, as a log of these units is read."""
    values = np.asarray(values, float)
    return values if unit is None else values * factor_of(unit, si)


def _input_unit(motion: str, drives: str) -> str:
    """SI unit of a guessed input."""
    return INPUTS[drives][motion == "translation"]


def _fitting(units: dict[str, str], motion: str, drives: str) -> dict[str, str]:
    """Only units of the quantity that a channel has."""
    wanted = {k: output_unit(motion, k) for k in MEASURABLE}
    wanted |= {"t": "s", "input": _input_unit(motion, drives)}
    return {k: u for k, u in units.items() if _is_unit(u, wanted[k])}
