"""What lies behind the readings of theta and Omega: the laws of their sensors taken off."""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ...laws import AbstractSensor
from ...rig import Rig
from .._settings import SETTINGS
from .clocks import LATE_LAWS, late_by, offset_of
from .laws import moving_readings, on_time
from .runs import Run, filled

TURNS = SETTINGS.prediction.angle_turns
CHANGE = SETTINGS.prediction.angle_change
STEP = SETTINGS.prediction.angle_step
AWAY = SETTINGS.prediction.angle_away
BLIND = SETTINGS.prediction.blind


class LinearReading(NamedTuple):
    """What the sensors show of values (t, c), and by how much it changes with each of them."""

    shown: np.ndarray
    slope: np.ndarray

    @property
    def tells(self) -> np.ndarray:
        """Where (t, c) the sensors show a change of the value at all."""
        return np.abs(self.slope) > BLIND

    def back(self, difference: np.ndarray) -> np.ndarray:
        """A small difference of readings as one of values; NaN where the sensors tell none."""
        nothing = np.full_like(difference, np.nan)
        return np.divide(difference, self.slope, out=nothing, where=self.tells)


def reading_of(
    rig: Rig, group: str, run: Run, values: np.ndarray, rolls: bool, late: bool
) -> LinearReading:
    """The readings about a group's `values` (samples, c): `late` by its delays, or on time."""

    def shown(moved: float) -> np.ndarray:
        here = rig, group, run.time, values + moved, rolls
        return moving_readings(*here) if late else moving_readings(*here, on_time(rig, group))

    return LinearReading(shown(0.0), (shown(STEP) - shown(-STEP)) / (2 * STEP))


def outputs_on_time(rig: Rig, run: Run, group: str, columns: int) -> np.ndarray:
    """Measured outputs (samples, columns) less the delays of their sensors: as noisy as they are.

    What is not read before the run ends is not known.
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
    return not all(isinstance(law, LATE_LAWS) for law in laws)


def values_behind(
    rig: Rig, group: str, run: Run, measured: np.ndarray, start: np.ndarray, rolls: bool,
    smoother: Callable[[np.ndarray], np.ndarray],
) -> np.ndarray:  # fmt: skip
    """The values (samples, c) of which the group's sensors show the `measured` ones, as noisy.

    `measured` is on time already.  By Newton steps from `start`, that say also what a sensor shows
    none of: the sign that it loses; NaN where one stands at its limit.  The `smoother` of values
    gives what a step begins from, as noise would grow if a lag were undone in it.
    """
    behind = values = start
    last, nearest = 0.0, np.inf
    for _ in range(TURNS):
        reading = reading_of(rig, group, run, behind, rolls, late=False)
        apart = measured - reading.shown
        far = float(np.nansum(apart**2))
        if not far <= AWAY * nearest:  # the step ran away
            return values
        better = behind + reading.back(apart)
        added = measured - better
        if np.nanmax(np.abs(added - last), initial=0.0) < CHANGE:
            return better
        last = added
        values, nearest, behind = better, min(far, nearest), smoother(better)
    return values


def folds(rig: Rig, group: str) -> bool:
    """Whether a sensor of the group may show one reading of several values."""
    return any(
        isinstance(p.law, AbstractSensor)
        and p.law.momentary
        and not any(one.linear for one in p.law.parameters.values())
        for p in rig.at("sensor")
        if p.group == group
    )
