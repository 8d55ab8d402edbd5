"""What lies behind the readings of theta and Omega: the laws of their sensors taken off."""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ....laws import AbstractSensor
from ....rig import Rig
from ..._settings import SETTINGS
from ..clocks import late_by, offset_of, only_delays
from ..runs import Run, filled
from .laws import moving_readings, on_time

TURNS = SETTINGS.prediction.angle_turns
CHANGE = SETTINGS.prediction.angle_change
STEP = SETTINGS.prediction.angle_step
AWAY = SETTINGS.prediction.angle_away
LEAST_SLOPE = SETTINGS.prediction.least_slope
BEGINS = SETTINGS.prediction.begins
BEGIN_TURNS = SETTINGS.prediction.begin_turns


class LinearReading(NamedTuple):
    """What the sensors show of values (t, c), and by how much it changes with each of them."""

    shown: np.ndarray
    above: np.ndarray  # of a value that grows
    below: np.ndarray  # of one that falls

    @property
    def slope(self) -> np.ndarray:
        """The mean of both sides."""
        return (self.above + self.below) / 2

    @property
    def tells(self) -> np.ndarray:
        """Where (t, c) the sensors show a change of the value, as much up as down: no corner."""
        size = np.abs(self.slope)
        return (size > LEAST_SLOPE) & (np.abs(self.above - self.below) < size)

    def back(self, difference: np.ndarray) -> np.ndarray:
        """A small difference of readings as one of values; NaN where the sensors tell none."""
        nothing = np.full_like(difference, np.nan)
        return np.divide(difference, self.slope, out=nothing, where=self.tells)


def reading_of(
    rig: Rig, group: str, run: Run, values: np.ndarray, rolls: bool, late: bool
) -> LinearReading:
    """The readings about a group's `values` (samples, c): `late` by its delays, or on time.

    A reading that is put on time was taken by the sensor later, by its delay.
    """
    time = run.time if late else run.time + offset_of(rig, group)

    def shown(moved: float) -> np.ndarray:
        here = rig, group, time, values + moved, rolls
        return moving_readings(*here) if late else moving_readings(*here, on_time(rig, group))

    here, above, below = shown(0.0), shown(STEP), shown(-STEP)
    return LinearReading(here, (above - here) / STEP, (here - below) / STEP)


def outputs_on_time(rig: Rig, run: Run, group: str, columns: int) -> np.ndarray:
    """Measured outputs (samples, columns) less the delays of their sensors; their noise stays.

    The last values, which a late sensor would show only after the end of the run, are NaN.
    """
    measured = run.outputs.get(group)
    if measured is None:
        return np.full((run.samples, columns), np.nan)
    late = offset_of(rig, group) / run.step
    if late == 0:
        return measured
    back = math.ceil(late)
    known = np.isfinite(np.pad(measured, ((0, back), (0, 0)), constant_values=np.nan)[back:])
    return np.where(known, late_by(filled(measured).T, -late).T, np.nan)


def changed_beside_delays(rig: Rig, group: str) -> bool:
    """Whether a law of the group's sensors does more than to delay."""
    laws = (p.law for p in rig.at("sensor") if p.group == group)
    return not all(only_delays(law) for law in laws)


def values_behind(
    rig: Rig, group: str, run: Run, measured: np.ndarray, start: np.ndarray, rolls: bool,
    smoother: Callable[[np.ndarray], np.ndarray],
) -> np.ndarray:  # fmt: skip
    """The values (samples, c) of which the group's sensors show the `measured` ones; noise stays.

    `measured` is on time already.  Newton steps begin at `start`, which decides what the sensor
    does not show: a lost sign.  NaN where a sensor stands at its limit or a step leads there, as
    the value may lie beyond.  Each step begins from values that `smoother` has smoothed: undoing a
    lag amplifies noise.
    """
    behind, ambiguous = start, folds(rig, group)
    values = start
    last, nearest = np.inf, np.inf
    for _ in range(TURNS):
        reading = reading_of(rig, group, run, behind, rolls, late=False)
        apart = measured - reading.shown
        far = float(np.nansum(apart**2))
        if not far <= AWAY * nearest:  # the step ran away
            return values
        better = behind + reading.back(apart)
        if ambiguous:
            there = np.where(np.isfinite(better), better, behind)
            tells = reading_of(rig, group, run, there, rolls, late=False).tells
            better = np.where(tells, better, np.nan)
        added = measured - better
        if np.nanmax(np.abs(added - last), initial=0.0) < CHANGE:
            return better
        last = added
        values, nearest, behind = better, min(far, nearest), smoother(better)
    return values


def begin_of(
    rig: Rig, group: str, run: Run, measured: np.ndarray, course: np.ndarray, rolls: bool
) -> np.ndarray:
    """By channel the value (c,) that, added to a `course` (samples, c), shows the `measured` best.

    Where a sensor loses the sign or stands at its limit, one reading fits many values, but a whole
    run fits few courses.  The readings at some moments, each with both signs, give the begins from
    which Newton steps start; the best end is returned.  Zero where nothing was measured.
    """
    moments, read = np.linspace(0, run.samples - 1, BEGINS).astype(int), filled(measured)
    signed = np.concatenate([read[moments], -read[moments]])
    begins = np.where(
        np.isfinite(measured).any(axis=0), signed - np.tile(course[moments], (2, 1)), 0
    )
    tried, misfits = [], []
    for _ in range(BEGIN_TURNS):
        readings = [reading_of(rig, group, run, course + x, rolls, late=False) for x in begins]
        apart = [np.nan_to_num(measured - one.shown) for one in readings]
        tried.append(begins)
        misfits.append([np.sum(x**2, axis=0) for x in apart])
        change = [
            np.sum(one.slope * x, axis=0) / np.maximum(np.sum(one.slope**2, axis=0), LEAST_SLOPE)
            for one, x in zip(readings, apart, strict=True)
        ]
        begins = begins + np.stack(change)
    best = np.concatenate(misfits).argmin(axis=0)
    return np.concatenate(tried)[best, np.arange(len(best))]


def folds(rig: Rig, group: str) -> bool:
    """Whether a sensor of the group may show one reading of several values."""
    return any(
        isinstance(p.law, AbstractSensor)
        and p.law.momentary
        and not any(one.linear for one in p.law.parameters.values())
        for p in rig.at("sensor")
        if p.group == group
    )
