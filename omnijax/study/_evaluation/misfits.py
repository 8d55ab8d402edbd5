"""Whether the prescribed speeds of a study fit each other: asked once of a study."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...simulation import drift_remarks, speed_remarks
from .drives import apply
from .fixed_steps import trial_designs
from .methods import Question


def speed_misfits(question: Question, times: np.ndarray | None, ranges: Sequence[Any]) -> list[str]:
    """What speaks against the question's drives, a sentence each, as `simulate` tells it.

    Of the question's rig and, at the corners of its `ranges`, of what varies; `times` (s) are those
    of a run, None of the steady state.
    """
    span = None if times is None else (float(times[0]), float(times[-1]))
    told = drift_remarks(question.rig, span, question.model)
    for drive in question.drives:
        designs = [
            apply(question.rig, drive, question.varied[: len(values)], values)
            for values in trial_designs(ranges, inside=1)
        ]
        told += speed_remarks(designs, span)
    return list(dict.fromkeys(told))
