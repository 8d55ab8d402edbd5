"""Runs under motor torques in a study: by fixed steps, as fine as halving the step asks for.

Fixed steps cost in proportion to their number: with the derivatives of a 0.5 s run, sampled at
250 Hz, in three variables a 75th of the adaptive solver at 1 substep, a tenth at 4, a quarter at
16.  And figures by them are smooth in the variables, which those of an adaptive solver are only to
its tolerance.
"""

from collections.abc import Callable

import jax.numpy as jnp
import numpy as np
from scipy.stats import qmc

from ...rig import Rig
from .._drive import Drive
from .._problem import Scale, Variable
from .._sensitivity import Evaluation
from .._sweep import no_fixed_steps

TOLERANCE = 3e-4  # change of every figure when the step is halved
FINEST = 64  # substeps
TRIED = 8  # designs inside the ranges
RTOL = 1e-6  # of the adaptive solver


def way_of(how: Evaluation, rig: Rig, drive: Drive, rtol: float | None) -> tuple[Evaluation, str]:
    """`how` by fixed steps where those serve; else, in words, why the solver is adaptive."""
    if how.way != "full":
        return how, ""
    against = no_fixed_steps(rig, drive, rtol is not None, False)
    if against is None:
        return how._replace(way="fixed"), ""
    return how._replace(rtol=rtol or RTOL), f"runs by the adaptive solver: {against}."


def trial_designs(variables: tuple[Variable, ...], seed: int) -> np.ndarray:
    """Designs (t, d) all over the ranges, their lowest and highest corner among them."""
    if not variables:
        return np.zeros((1, 0))
    inside = qmc.Sobol(len(variables), scramble=True, rng=seed).random(TRIED)
    shares = np.concatenate([np.zeros((1, len(variables))), np.ones((1, len(variables))), inside])
    found = np.asarray(Scale.of(variables).value(jnp.asarray(shares)))
    return np.where([v.whole for v in variables], np.round(found), found)


def fine_enough(
    how: Evaluation, designs: np.ndarray, figures: Callable[[np.ndarray, int], np.ndarray]
) -> tuple[Evaluation, str]:
    """The least power of two of substeps that will do, and why; adaptive where none does.

    `figures(x, substeps)` are those of one design; designs whose runs fail do not count.
    """
    step = 2 * float(how.times[1] - how.times[0])
    coarse = np.array([figures(x, 1) for x in designs])
    for substeps in 2 ** np.arange(FINEST.bit_length() - 1):
        fine = np.array([figures(x, 2 * int(substeps)) for x in designs])
        change = _change(coarse, fine)
        if change <= TOLERANCE:
            return how._replace(substeps=int(substeps)), (
                f"runs by fixed steps of {1e3 * step / substeps:.3g} ms: halving them changes the "
                f"figures of {len(designs)} trial designs by {change:.0e} at most."
            )
        coarse = fine
    words = "runs by the adaptive solver: fixed steps are too coarse for a trial design."
    return how._replace(way="full", rtol=RTOL), words


def _change(coarse: np.ndarray, fine: np.ndarray) -> float:
    """Largest relative change; figures near zero count by 1 % of the largest one."""
    good = np.isfinite(fine).all(axis=1) & np.isfinite(coarse).all(axis=1)
    if not good.any():
        return np.inf
    fine, coarse = fine[good], coarse[good]
    size = np.abs(fine) + 0.01 * np.abs(fine).max(axis=0)
    return float((np.abs(fine - coarse) / np.where(size > 0, size, 1.0)).max())
