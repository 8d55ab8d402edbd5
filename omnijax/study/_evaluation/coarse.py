"""Whether the samples of runs follow how the rollers pass: asked once of a study."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...simulation import SpeedDrive
from .drives import apply, turning
from .fixed_steps import trial_designs
from .methods import Question

FEWEST = 4  # samples while a roller passes: with fewer no run of `simulate` follows its vibration


def coarse_samples(question: Question, times: np.ndarray, ranges: Sequence[Any]) -> str | None:
    """A sentence where a roller passes in fewer than `FEWEST` of the samples at `times` (s).

    Of the question's rig and drives, and with what varies at the corners of its `ranges`.  None
    under torques, where speeds are known only after the runs.
    """
    rate = (len(times) - 1) / float(times[-1] - times[0])
    fastest = 0.0
    for drive in question.drives:
        if not isinstance(drive, SpeedDrive):
            return None
        for values in trial_designs(ranges, inside=1):
            paths = question.varied[: len(values)]
            rig, moved = apply(question.rig, drive, paths, values)
            speeds = np.abs(np.asarray(turning(moved).around_knots())).max(axis=0)
            fastest = max(fastest, float(np.max(speeds * np.asarray(rig.wheels.rollers))))
    passing = fastest / (2 * np.pi)
    if rate >= FEWEST * passing:
        return None
    return (
        f"{rate:.4g} samples a second do not follow this vibration, as rollers pass up to "
        f"{passing:.4g} times a second: what lies between samples is not seen, peaks least of all. "
        "Give a higher `rate`."
    )
