"""Scores beside a calibration that stands at the ends of its ranges.

A scan lets the uncertain parameters take up what they can, however far they would have to go.  A
gain of 2 % of a sensor is 70 sigmas of the wheels' radii: the calibration ends at its bounds with
nearly all of the gap left, and the scan, which lets it go on, finds nothing that the gain explains.
Here every candidate is scored by the least value of the same quadratic within the ranges, in which
what stands at a bound may come back.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np

from .fit import Fit
from .gauss_newton import DAMPING, FitState, bounded_step, bounds, normal, numbers
from .model import AbstractModel
from .scan import Score, Signatures


def at_ends(model: AbstractModel, fit: Fit) -> bool:
    """Whether some uncertain parameter of a fit stands at an end of its range."""
    return any(p.at_bound(u) for p, u in zip(model.priors, fit.point.u, strict=True))


def scored_in_ranges(
    model: AbstractModel, fit: Fit, signatures: Signatures, scores: Sequence[Score]
) -> list[Score]:
    """The `scores` of a scan anew, beside uncertain parameters that stay within their ranges."""
    J = fit.jacobian
    state = FitState(fit.point, tuple(fit.free), fit.residual, fit.cost)
    gram, gradient, _ = normal(state, J)
    x, (low, high) = numbers(state), bounds(model, state.free)
    inner = signatures.times(np.column_stack([J, fit.residual]))
    across, right = -inner[:, :-1], -inner[:, -1]
    without, _ = _fall(gram, gradient, x, low, high)
    out = []
    for score in scores:
        part = signatures.layout.part(score.index)
        k = part.stop - part.start
        own = np.block([[gram, across[part].T], [across[part], signatures.blocks[score.index]]])
        slope = np.concatenate([gradient, right[part]])
        free = np.full(k, np.inf)
        fall, d = _fall(own, slope, np.concatenate([x, np.zeros(k)]),
                        np.concatenate([low, -free]), np.concatenate([high, free]))  # fmt: skip
        out.append(_rescored(score, fall - without, d[len(x) :] / signatures.layout.scale[part]))
    return out


def _fall(gram, gradient, x, low, high) -> tuple[float, np.ndarray]:
    """(fall of the quadratic by its best step within bounds, the step)."""
    scale = np.sqrt(np.maximum(np.diag(gram), 1e-300))
    d = bounded_step(gram, gradient, scale, DAMPING, x, low, high) - x
    return float(-2 * gradient @ d - d @ gram @ d), d


def _rescored(score: Score, gain: float, coefficients: np.ndarray) -> Score:
    allowed = not score.dead and score.candidate.allowed(coefficients)
    return dataclasses.replace(score, gain=gain, coefficients=coefficients, allowed=allowed)
