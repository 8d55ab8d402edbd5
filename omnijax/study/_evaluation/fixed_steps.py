"""How fine fixed exponential steps must be: the one test for sweeps, sensitivities and designs.

Fixed steps cost in proportion to their number: with the derivatives of a 0.5 s run, sampled at
250 Hz, in three variables a 75th of the adaptive solver at 1 substep, a tenth at 4, a quarter at
16.  And figures by them are smooth in the parameters, which those of an adaptive solver are only to
its tolerance.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from .._sobol import sobol_points

TOLERANCE = 1e-4  # change of every figure when the step is halved
FINEST = 64  # substeps
CORNERS, INSIDE = 8, 8  # designs that the step is tried on


def trial_designs(ranges: Sequence[Any], corners: int = CORNERS, inside: int = INSIDE):
    """Designs (t, d) all over the ranges: up to `corners` corners, and `inside` Sobol points.

    A range has `low`, `high` and `quantile(share)`, as axes and variables have.
    """
    if not ranges:
        return np.zeros((1, 0))
    size = len(ranges)
    last = 2**size - 1
    number = {round(k * last / (corners - 1)) for k in range(corners)}
    high = np.array([[(i >> j) & 1 for j in range(size)] for i in sorted(number)], bool)
    ends = np.where(high, [x.high for x in ranges], [x.low for x in ranges])
    drawn = sobol_points(size, inside, 0)
    columns = [x.quantile(drawn[:, j]) for j, x in enumerate(ranges)]
    return np.concatenate([ends, np.stack(columns, axis=-1)])


def fine_enough(
    figures: Callable[[np.ndarray, int], np.ndarray], designs: np.ndarray, step: float
) -> tuple[int, str] | None:
    """The least power of two of substeps that will do, and why; None where `FINEST` will not.

    `figures(designs, substeps)` (t, m) are all that is asked for of every trial design, `step` (s)
    is that of one substep.  They will do where halving changes no figure by more than `TOLERANCE`.
    Designs whose runs fail at the finer step do not count.
    """
    coarse = figures(designs, 1)
    for substeps in 2 ** np.arange(FINEST.bit_length() - 1):
        fine = figures(designs, 2 * int(substeps))
        change = largest_change(coarse, fine)
        if change <= TOLERANCE:
            return int(substeps), (
                f"fixed steps of {1e3 * step / substeps:.3g} ms: halving the step changes the "
                f"figures of {len(designs)} trial designs by {change:.0e} at most"
            )
        coarse = fine
    return None


def largest_change(coarse: np.ndarray, fine: np.ndarray) -> float:
    """Largest relative change; figures near zero count by 1 % of the largest one."""
    good = np.isfinite(fine).all(axis=1)
    if not good.any() or not np.isfinite(coarse[good]).all():
        return np.inf
    coarse, fine = coarse[good], fine[good]
    size = np.abs(fine) + 0.01 * np.abs(fine).max(axis=0)
    return float((np.abs(fine - coarse) / np.where(size > 0, size, 1.0)).max())
