"""How fine fixed steps must be: the one test for sweeps, sensitivities and designs.

The step is tried against its half on designs all over the ranges, and a sweep tries it once more on
designs of its answer.

Exponential steps cost in proportion to their number: with the derivatives of a 0.5 s run, sampled
at 250 Hz, in three variables a 75th of the adaptive solver at 1 substep, a tenth at 4, a quarter at
16.  And figures by them are smooth in the parameters, which those of an adaptive solver are only to
its tolerance.
"""

import functools
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from jaxtyping import Bool

from .._sobol import sobol_points

TOLERANCE = 1e-4  # change of every figure when the step is halved
FINEST = 64  # substeps
CORNERS, INSIDE = 8, 8  # designs that the step is tried on
SPREAD = 8  # designs of the answer that it is tried on again, beside the extreme ones


def trial_designs(ranges: Sequence[Any], corners: int = CORNERS, inside: int = INSIDE):
    """Designs (t, d) all over the ranges: up to `corners` corners, and `inside` Sobol points.

    A range has `low`, `high` and `quantile(share)`, as axes and variables have.
    """
    if not ranges:
        return np.zeros((1, 0))
    high = corners_of_box(len(ranges), corners)
    ends = np.where(high, [x.high for x in ranges], [x.low for x in ranges])
    drawn = sobol_points(len(ranges), inside, 0)
    columns = [x.quantile(drawn[:, j]) for j, x in enumerate(ranges)]
    return np.concatenate([ends, np.stack(columns, axis=-1)])


def corners_of_box(size: int, most: int) -> Bool[np.ndarray, "c d"]:
    """Which of `size` ranges are at their upper end, in each of `most` corners spread over all."""
    last = 2**size - 1
    number = {round(k * last / (most - 1)) for k in range(most)}
    return np.array([[(i >> j) & 1 for j in range(size)] for i in sorted(number)], bool)


def fine_enough(
    figures: Callable[[np.ndarray, int], np.ndarray], designs: np.ndarray, step: float
) -> tuple[int, str] | None:
    """The least power of two of substeps that will do, and why; None where `FINEST` will not.

    `figures(designs, substeps)` (t, m) are all that is asked for of every trial design, `step` (s)
    is that of one substep.  They will do where halving changes no figure by more than `TOLERANCE`.
    Designs whose runs fail at the finest step too do not count; others fail as steps are too long.
    """
    coarse, lost = figures(designs, 1), functools.cache(lambda: _failed(figures(designs, FINEST)))
    for substeps in 2 ** np.arange(FINEST.bit_length() - 1):
        fine = figures(designs, 2 * int(substeps))
        change, failed = largest_change(coarse, fine), _failed(fine)
        if failed.any() and (failed.all() or (failed & ~lost()).any()):
            change = np.inf
        if change <= TOLERANCE:
            return int(substeps), (
                f"fixed steps of {1e3 * step / substeps:.3g} ms: halving the step changes the "
                f"figures of {len(designs)} trial designs by {change:.0e} at most"
            )
        coarse = fine
    return None


def sample_to_check(figures: np.ndarray) -> np.ndarray:
    """Numbers of the designs (k,) whose step is tried again once all figures (b, m) are known.

    Those with the least and the largest of every figure, and `SPREAD` evenly among the others and
    among those that failed.
    """
    failed = _failed(figures)
    good = np.flatnonzero(~failed)
    ends = [good[pick(figures[good], axis=0)] for pick in (np.argmin, np.argmax) if len(good)]
    return np.unique(np.concatenate([*ends, _evenly(good), _evenly(np.flatnonzero(failed))]))


def _failed(figures: np.ndarray) -> np.ndarray:
    return np.logical_not(np.isfinite(figures).all(axis=1))


def _evenly(index: np.ndarray) -> np.ndarray:
    return index[np.linspace(0, len(index) - 1, min(SPREAD, len(index))).round().astype(int)]


def checked_after(figures: np.ndarray, fine: np.ndarray) -> tuple[str, bool]:
    """What half the step says of figures found (k, m), in words, and whether they are as good."""
    change = largest_change(figures, fine)
    good = change <= TOLERANCE
    verdict = "" if good else f", more than {TOLERANCE:g}"
    return (
        f"half the step changes those of {len(figures)} designs of the answer by {change:.0e} at "
        f"most{verdict}"
    ), good


def largest_change(coarse: np.ndarray, fine: np.ndarray) -> float:
    """Largest relative change; figures near zero count by 1 % of the largest one.

    Designs that fail at both steps say nothing; inf where one fails at one of them alone.
    """
    good = ~_failed(fine)
    if (good == _failed(coarse)).any():
        return np.inf
    if not good.any():
        return 0.0
    coarse, fine = coarse[good], fine[good]
    size = np.abs(fine) + 0.01 * np.abs(fine).max(axis=0)
    return float((np.abs(fine - coarse) / np.where(size > 0, size, 1.0)).max())
