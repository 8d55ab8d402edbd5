"""Which column of a log holds what, by names, units and how it moves."""

import functools
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..._errors import InputError
from .channel_units import is_unit

TIME = r"^(t|time|timestamp|zeit|stamp|seconds|sec|ms)\b|time"
GOAL = r"goal|ref|set_?-?point|target|desired|_des$|soll"
INPUT = (
    r"^(u\d*|vir|v1|v_?(in|m|a)|i|i_?[qam]|amps?|in|input)$|^tau|cmd|torque|force|volt|curr|command"
    rf"|moment|duty|pwm|spannung|strom|kraft|{GOAL}"
)
COUNTS = r"counts?$|ticks|incr|inkr"  # of an encoder, whose lines a turn no log tells
POSITION = rf"^(y|q|qm|x|v2|out|th)$|pos|angle|theta|phi|encoder|deg|winkel|weg|displ|{COUNTS}"
SPEED = r"speed|veloc|(^|_)vel|rpm|omega|drehzahl|geschw|tacho|dot$|^(w|v|n|z\d*)$"
SPEED += r"|/ ?s(ec)?\b|(^|[_ \[(])[dr]ps\b"
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
    r"|revs?|turns?|rps|dps|rpm|rev/min|U/min|1/min|(?:rad|mrad|deg|°|mm|cm|m|revs?|turns?)/s)"
    r"\s*[\])]?$"
)
BRACKETS = re.compile(r"[\[(]\s*([^\[\]()]*[^\W\d][^\[\]()]*?)\s*[\])]$")  # round any other unit
KNOWN = ("s", "rad", "m", "rad/s", "m/s", "N m", "N", "A", "V")  # of what channels may be
WORDS = {"degrees": "deg", "radians": "rad"}
SUPPLY = 0.2  # standard deviation of a voltage over its mean, below which it is a supply's
RISING = 0.5  # of a clock's steps: stamps of a coarse clock repeat, and their rows are left out


class NamedColumns(dict[str, str]):
    """By column its name with the unit that its table says, as names are looked at."""

    def of(self, columns: Sequence[str]) -> list[str]:
        """The names of some columns."""
        return [self[k] for k in columns]

    def column(self, word: str | None) -> str | None:
        """The column of a name."""
        return next((k for k, x in self.items() if x == word), None)


def with_units(table) -> NamedColumns:
    """The names of a table's columns, with units that stand apart from them."""
    apart = {k: u for k, u in table.units.items() if unit_in(k) is None}
    return NamedColumns((k, f"{k} [{apart[k]}]" if k in apart else k) for k in table.columns)


def matches(name: str, pattern: str) -> bool:
    """Whether a column's name matches, as it is or without its unit: `x_mm` is as good as `x`."""
    match = _unit_match(name)
    bare = (name if match is None else name[: match.start()]).strip().lower()
    return bool(re.search(pattern, name.lower()) or re.search(pattern, bare))


def best_of(names: list[str], pattern: str, better: str = "$^") -> str | None:
    """The first name that matches, if any; one that matches `better` too before others."""
    good = [k for k in names if matches(k, pattern)]
    return next((k for k in good if re.search(better, k.lower())), next(iter(good), None))


def unit_in(name: str) -> str | None:
    """The unit at the end of a column's name."""
    match = _unit_match(name)
    return WORDS.get(match[1], match[1]) if match else None


@functools.cache
def _unit_match(name: str) -> re.Match[str] | None:
    """The unit at the end of a column's name: a usual one, or any that stands in brackets."""
    match = BRACKETS.search(name)
    if UNIT.search(name) or match is None:
        return UNIT.search(name)
    return match if any(is_unit(match[1], si) for si in KNOWN) else None


def driven_by(name: str, unit: str | None) -> str:
    """How an input drives the motor, by its unit, else by its name."""
    if unit in DRIVES:
        return DRIVES[unit]
    if matches(name, "cmd|command") and matches(name, POSITION):
        return "goal"
    return next((d for p, d in KINDS if matches(name, p)), "command")


def time_column(log: Path, columns, moving, rate) -> str | None:
    """The column of time among the `moving` ones; None where a `rate` (Hz) stands for it.

    Raises `InputError` where there is neither.
    """
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


def input_column(names: list[str]) -> str | None:
    """Column of the input among some names; a speed goal only if there is no other candidate."""
    inputs = [
        k for k in names if matches(k, INPUT) or DRIVES.get(unit_in(k) or "", "goal") != "goal"
    ]
    motors = [k for k in inputs if not (driven_by(k, unit_in(k)) == "goal" and matches(k, SPEED))]
    return next(iter(motors or inputs), None)


def output_columns(names: list[str]) -> tuple[str | None, str | None]:
    """(column of the position, or None and that of the speed) among some names."""
    speeds = [k for k in names if best_of([k], SPEED)]
    others = [k for k in names if k not in speeds]
    by_unit = [k for k in others if DRIVES.get(unit_in(k) or "") == "goal"]
    position = best_of(others, POSITION, MEASURED) or next(iter(by_unit), None)
    return position, None if position else best_of(speeds, SPEED, MEASURED)


def supplies(name: str, x: np.ndarray) -> bool:
    """Whether a column is a supply's: a voltage that hardly changes drives nothing."""
    steady = np.nanstd(x) < SUPPLY * abs(np.nanmean(x))
    return bool("volt" in name.lower() and steady)


def servo_columns(columns) -> dict[str, str]:
    """Columns of a servo's gain and of whether it is on, where they are there."""
    patterns = {"gain": r"^(k_?p|p_?gain|gain)$", "enable": r"enable|torque_on|^on$"}
    columns_of = {k: best_of(list(columns), p) for k, p in patterns.items()}
    return {k: c for k, c in columns_of.items() if c is not None}


def not_found(log: Path, word: str, option: str, columns, still: str | None) -> InputError:
    """The error that no column looks like a `word`; `still` is one that does, but never changes."""
    if still is not None:
        why = "it never changes: all at rest"
        why = why if np.isfinite(columns[still]).any() else "it holds no numbers"
        return InputError(f"{log.name}: the column {still!r} looks like the {word}, but {why}.")
    return InputError(f"{log.name}: no column looks like the {word}; columns: "
                      f"{', '.join(columns)}. Name it: {option}.")  # fmt: skip
