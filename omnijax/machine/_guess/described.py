"""What a log holds once its columns are known: channels in SI, sampling, noise."""

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..._errors import InputError
from ..._white_noise import noise_squares
from ...recording import ordered_rows, unwound
from .._first_numbers import LogSignals
from .._hold import input_hold
from .._log import check_count
from .._sample_times import evenly, travelled, unbroken
from .._second_numbers import coupled
from .channel_units import (
    fitting,
    in_si,
    input_unit,
    is_unit,
    motion_of,
    output_unit,
    step_of,
    with_unit_of_both,
)
from .columns import COUNTS, SPEED, best_of, driven_by, servo_columns, unit_in


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
    left: dict[str, str] = dataclasses.field(default_factory=dict)  # that no channel can have

    @property
    def measured(self) -> str:
        """The output that is compared: position or velocity."""
        return "velocity" if self.position is None else "position"

    def held(self) -> str:
        """How the input is read between its samples, in words."""
        told = input_hold([self.signals], self.turns())
        return told.sentence if told.sure else "held or linear: the diagnosis looks"

    def _unit(self, channel: str, unsaid: str) -> str:
        """The unit of a channel; a unit in the log that it cannot have is ignored, with a note."""
        if channel in self.left:
            unsaid += f": {self.left[channel]!r} is no unit of a {self.motion}'s {channel}"
        return self.units.get(channel, unsaid)

    def _read_as(self, unit: str) -> str:
        """The unit of a measured channel without one: its numbers are taken as they are."""
        if self.measured in self.left:
            return f"read as {unit}"
        if not best_of([self.position or self.velocity or ""], COUNTS):
            return f"read as {unit}: no unit of it is said"
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
            ("input", f"{self.input} ({self.drives}, {self._unit('input', 'as it is')})"),
            *([("input is read as", self.held())] if self.drives != "goal" else []),
            (self.measured, f"{shown} ({self._unit(self.measured, self._read_as(unit))})"),
            *([("load behind a drive", self.load())] if self.second else []),
            *self.beside.items(),
            ("motion", self.motion), ("samples", f"{self.samples} at {self.rate:.6g} Hz"),
            (f"noise of {self.measured}", f"{self.noise:.3g} {unit} (1 sigma)"),
        ]  # fmt: skip


class LogColumns(NamedTuple):
    """Columns of a log by what they hold; the velocity is read where there is no position."""

    time: str | None
    input: str
    position: str | None
    velocity: str | None = None

    @property
    def measured(self) -> str:
        """The output that is compared: position or velocity."""
        return "velocity" if self.position is None else "position"

    @property
    def output(self) -> str:
        """The column of what is measured."""
        column = self.velocity if self.position is None else self.position
        assert column is not None  # one of both is given
        return column


class _Reading(NamedTuple):
    """How the channels of a log are read."""

    units: dict[str, str]
    motion: str
    drives: str
    step: float  # s
    left: dict[str, str]  # units that the log says, but that the channel cannot have


def described(
    log: Path, table, columns: LogColumns, rate: float | None, stated: Mapping[str, str]
) -> Guess:
    """The guess with its columns known; `stated` are units that the user says, by channel."""
    _check_columns(log, table, columns)
    how = _reading(log, table, columns, rate, stated)
    beside = servo_columns(table.columns) if how.drives == "goal" else {}
    q, u, others = _channels(log, table, columns, how, beside)
    for word, values in (("input", u), (columns.measured, q)):
        if np.ptp(values) == 0:
            raise InputError(f"{log.name}: the {word} never changes: all at rest.")
    signals = LogSignals(q, u, how.step, others)
    if columns.measured == "velocity":
        signals = LogSignals(travelled(q, how.step), u, how.step, others, q)
    return Guess(
        log, columns.time, columns.input, columns.position, how.units, how.drives, how.motion,
        len(q), 1 / how.step, _noise(q), signals, beside,
        None if columns.position else columns.velocity, stated=dict(stated), left=how.left,
    )  # fmt: skip


def _reading(
    log: Path, table, columns: LogColumns, rate: float | None, stated: Mapping[str, str]
) -> _Reading:
    """Units as the log, the columns' names or the user say them, and what follows from them."""
    channels = (("t", columns.time), ("input", columns.input), (columns.measured, columns.output))
    written = {
        ours: u for ours, theirs in channels
        if theirs and (u := table.units.get(theirs) or unit_in(theirs))
    }  # fmt: skip
    _check_motion(log, columns, written, stated)
    units = written | dict(stated)
    drives = driven_by(columns.input, units.get("input"))
    motion = motion_of(units, columns.measured, drives)
    if drives == "goal" and (columns.measured == "velocity" or best_of([columns.input], SPEED)):
        raise InputError(
            f"{log.name}: the input {columns.input!r} looks like the goal of a controller, which "
            "an axis has for its position alone, not for a speed. Name the motor's torque, current "
            "or voltage: --input COLUMN."
        )
    if drives == "goal":
        goal, position = (table.columns[k] for k in (columns.input, columns.output))
        units = with_unit_of_both(units, goal, position)
    every, units = units, fitting(units, motion, drives)
    for channel, unit in stated.items():
        if channel not in units:
            raise InputError(f"{log.name}: {unit!r} is no unit of the {channel}.")
    any_unit = {"input"} if drives == "command" else set()
    left = {k: u for k, u in every.items() if k not in {*units, *any_unit}}
    step = 1 / float(rate or 1.0)
    if columns.time is not None:
        step, units = step_of(table.columns[columns.time], units)
    return _Reading(units, motion, drives, step, left)


def _channels(
    log: Path, table, columns: LogColumns, how: _Reading, beside: dict[str, str]
) -> tuple[np.ndarray, np.ndarray, dict[str, np.ndarray]]:
    """Output and input in SI, and what is `beside` them, (samples,) at even times."""
    si = output_unit(how.motion, columns.measured)
    q = in_si(table.columns[columns.output], how.units.get(columns.measured), si)
    drive_unit = input_unit(how.motion, how.drives)
    u = in_si(table.columns[columns.input], how.units.get("input"), drive_unit)
    others = {k: np.asarray(table.columns[c], float) for k, c in beside.items()}
    t = np.arange(len(q)) * how.step
    if columns.time is not None:
        t = in_si(table.columns[columns.time], how.units.get("t"), "s")
    good = np.all([np.isfinite(x) for x in (q, u, *others.values())], axis=0)
    kept, _ = ordered_rows(log.name, t)
    kept = kept[good[kept]]
    kept = kept[unbroken(t[kept])] if len(kept) > 1 else kept
    told = unwound(q[kept], t[kept]) if si == "rad" else None
    if told is not None:
        q = q.copy()
        q[kept] = told.angle
        kept = kept[~told.lost]
    check_count(log.name, len(kept))
    q, *rest = (x[kept] for x in (q, u, *others.values()))
    q, u, *rest = evenly(t[kept], how.step, q, *rest)
    return q, u, dict(zip(others, rest, strict=True))


def _check_motion(
    log: Path, columns: LogColumns, written: Mapping[str, str], stated: Mapping[str, str]
) -> None:
    """`InputError` where the log writes an angle and the user says a length, or the other way."""
    channel = columns.measured
    motions = ("rotation", "translation")
    of_log, of_user = (
        [m for m in motions if is_unit(units.get(channel), output_unit(m, channel))]
        for units in (written, stated)
    )
    if of_log and of_user and of_log != of_user:
        raise InputError(
            f"{log.name}: --unit {channel}={stated[channel]!r} is the unit of a {of_user[0]}, but "
            f"the log says that {columns.output!r} is in {written[channel]!r}, the unit of a "
            f"{of_log[0]}. Leave out --unit {channel}, or correct the log's unit."
        )


def _check_columns(log: Path, table, columns: LogColumns) -> None:
    """`InputError` for a column that a log's table lacks, or one that is named twice."""
    time, given, shown = columns.time, columns.input, columns.output
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


def _noise(q: np.ndarray) -> float:
    """1-sigma of white noise on a smooth signal: the least by third to seventh differences."""
    return min(float(np.sqrt(np.mean(noise_squares(q, order)))) for order in (3, 5, 7))
