"""The noise of what the logs of a machine measured, each by itself: declared and shown together."""

from collections.abc import Sequence

import numpy as np

from ...._white_noise import noise_squares
from ....machine import Log
from ..._noise import Assumed, combined, shown_step
from ..._settings import SETTINGS

DIFFERENCES = SETTINGS.levels.differences
NOISE_FREE = SETTINGS.free_sensor_noise.noise_free
LEVEL_ERROR = SETTINGS.free_sensor_noise.level_error
WHITE_RATIO = SETTINGS.free_sensor_noise.white_ratio


def sensor_noise(logs: Sequence[Log]) -> list[Assumed]:
    """By log what its white noise is taken for."""
    return [_assumed(log, levels) for log, levels in zip(logs, _by_order(logs), strict=True)]


def _by_order(logs: Sequence[Log]) -> np.ndarray:
    """1-sigma (logs, orders) that differences of each order leave, of noise and quick motion.

    Logs that show the steps of an encoder have one noise: one that rests shows less of it.
    """
    squares = np.array(
        [[np.mean(noise_squares(log.shown, k)) for k in DIFFERENCES] for log in logs]
    )
    levels = np.sqrt(squares)
    pairs = zip(logs, levels, strict=True)
    stepped = [shown_step([log.shown], float(some.min())) > 0 for log, some in pairs]
    if any(stepped):
        levels[stepped] = np.sqrt(squares[stepped].mean(axis=0))
    return levels


def _assumed(log: Log, levels: np.ndarray) -> Assumed:
    """The noise of one log with the `levels` (orders,) that its differences leave.

    White noise is no more than the least of them, and they agree where nothing else is in them: a
    smaller declaration is kept beside quick motion.
    """
    declared = log.noise.get(log.measured) or None
    measured = float(levels.min())
    if measured == 0 and declared is None:
        return Assumed(NOISE_FREE * float(np.std(log.shown)), 0.0, "noise-free", declared)
    if declared is not None and (
        measured == 0 or levels.max() > WHITE_RATIO * measured > WHITE_RATIO * declared
    ):
        measured = declared
    return Assumed(*combined(measured, LEVEL_ERROR, "differences", declared), declared)
