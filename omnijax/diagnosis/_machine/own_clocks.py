"""Offsets of the loggers' clocks in a run that is not fitted: told by that run itself.

They are found about one rig by Gauss-Newton steps, as the mean of the fitted runs foretells them
where the run does not tell; beside that rig what they change to first order is taken off its rows,
as the state at a start is.  One that would lie at a bound, driven there by a sensor's delay or what
else is missing, is not told: it stays that mean.
"""

import numpy as np

from ...rig import Rig
from .._orthonormal import orthonormal
from .._settings import SETTINGS
from .clocks import LoggerClock

SIGMA = SETTINGS.prediction.clock_error
MOST = SETTINGS.prediction.clock_most
TURNS = SETTINGS.clocks.turns
STEP = SETTINGS.clocks.step
SETTLED = SETTINGS.clocks.settled
BOUND_TOLERANCE = SETTINGS.model.bound_tolerance


def fit_clocks(machine, rig: Rig, i: int) -> None:
    """Fit the offsets of run `i` of a machine about a rig, and free its rows of them.

    Those of every group that has a clock.  Of one that tells the motion, as Omega does where no
    encoder says an angle, each costs a motion.
    """
    rows, run = machine.rows[i], machine.runs[i]
    rows.late = None
    machine.clocks.pop(i, None)
    mean = {
        p.place: float(p.law.delay)
        for p in machine.at_run(rig, i).at("sensor") if type(p.law) is LoggerClock
        and p.place in run.outputs
    }  # fmt: skip
    if not mean:
        return
    groups, before = [*mean], np.array([*mean.values()])
    late, tangents = before.copy(), np.zeros((len(groups), rows.size))
    for _ in range(TURNS):
        here = _left(machine, rig, i, groups, late)
        steps = np.where(late > 0, -STEP, STEP)
        moved = [
            _left(machine, rig, i, groups, late + h * row)
            for h, row in zip(steps, np.eye(len(groups)), strict=True)
        ]
        tangents = (np.stack(moved) - here) / steps[:, None]
        if not np.isfinite(tangents).all():
            machine.clocks.pop(i, None)
            return
        gram = tangents @ tangents.T + np.eye(len(groups)) / SIGMA**2
        change = np.linalg.solve(gram, tangents @ here + (late - before) / SIGMA**2)
        last, late = late, np.clip(late - change, -MOST, MOST)
        if np.abs(late - last).max() < SETTLED:
            break
    told = np.abs(late) < MOST * (1 - BOUND_TOLERANCE)
    machine.clocks[i] = {g: float(late[k]) for k, g in enumerate(groups) if told[k]}
    if np.any(tangents[told]):
        rows.late = orthonormal(tangents[told].T).T


def _left(machine, rig: Rig, i: int, groups, late: np.ndarray) -> np.ndarray:
    """Whitened rows of run `i` of a rig, its `groups` read `late` s late."""
    machine.clocks[i] = dict(zip(groups, late.tolist(), strict=True))
    return machine.residuals([rig], [i])[0]
