"""How fine fixed exponential steps must be: the one test for sweeps, sensitivities and designs.

Fixed steps cost in proportion to their number: with the derivatives of a 0.5 s run, sampled at
250 Hz, in three variables a 75th of the adaptive solver at 1 substep, a tenth at 4, a quarter at
16.  And figures by them are smooth in the parameters, which those of an adaptive solver are only to
its tolerance.
"""

import itertools
from collections.abc import Callable, Sequence

import numpy as np
from scipy.stats import qmc

from .._range import Range

TOLERANCE = 1e-4  # change of every figure when the step is halved
FINEST = 64  # substeps
CORNERS, INSIDE = 8, 8  # designs that the step is tried on


def trial_designs(ranges: Sequence[Range], corners: int = CORNERS, inside: int = INSIDE):
    """Designs (t, d) all over the ranges: corners, and Sobol points between them."""
    if not ranges:
        return np.zeros((1, 0))
    ends = list(itertools.islice(itertools.product((0.0, 1.0), repeat=len(ranges)), 4 * corners))
    chosen = [ends[i] for i in np.unique(np.linspace(0, len(ends) - 1, corners).astype(int))]
    drawn = qmc.Sobol(len(ranges), scramble=True, rng=0).random(inside)
    shares = np.concatenate([np.array(chosen), np.ones((1, len(ranges))), drawn])
    columns = [x.quantile(np.minimum(shares[:, j], 1.0)) for j, x in enumerate(ranges)]
    return np.unique(np.stack(columns, axis=-1), axis=0)


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
