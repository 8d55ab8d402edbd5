"""One step of a refit: damped Gauss-Newton within bounds, along a parabola where a valley bends.

In a valley that bends a straight step d leads up its wall, and damping makes it creep.  Two more
points of the step tell how the residual r bends along it, r'' = d^2 r/ds^2 of r(x + s d), and the
parabola x + s d + s^2 a/2 follows the valley, with a = -(J'J + damping)^-1 J' r''.

Source: Transtrum, Sethna, Improvements to the Levenberg-Marquardt algorithm for nonlinear
least-squares minimization (2012): geodesic acceleration, with its bound |a| < 3/4 |2 d|.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np
from scipy.optimize import lsq_linear

from .._settings import SETTINGS
from .model import AbstractModel, Free, Point, moved, unit_bounds, value_of

ENDED_FALL = SETTINGS.gauss_newton.ended_fall
KEPT_FALL = SETTINGS.gauss_newton.kept_fall
BENT_FALL = SETTINGS.gauss_newton.bent_fall
LONGEST_BEND = SETTINGS.gauss_newton.longest_bend
DAMPING = SETTINGS.gauss_newton.damping
DAMPING_FACTOR = SETTINGS.gauss_newton.damping_factor
FAILED_DAMPING = SETTINGS.gauss_newton.failed_damping
DAMPINGS = SETTINGS.gauss_newton.dampings


@dataclasses.dataclass(frozen=True)
class FitState:
    """A point with its residual and cost (chi2 and the priors' part).

    One that cannot be evaluated costs infinity.
    """

    point: Point
    free: tuple[Free, ...]
    residual: np.ndarray
    cost: float

    @staticmethod
    def at(model: AbstractModel, points: Sequence[Point], free: Sequence[Free]) -> list["FitState"]:
        return [
            FitState(p, tuple(free), r, float(np.nan_to_num(r @ r + p.u @ p.u, nan=np.inf)))
            for p, r in zip(points, model.residuals(points, "train"), strict=True)
        ]


def normal(state: FitState, J: np.ndarray):
    """Gram matrix and gradient with the priors, and the columns' sizes."""
    P = len(state.point.u)
    gram, gradient = J.T @ J, J.T @ state.residual
    gram[:P, :P] += np.eye(P)
    gradient[:P] += state.point.u
    return gram, gradient, np.sqrt(np.maximum(np.diag(gram), 1e-300))


def stepped(
    model: AbstractModel, state: FitState, J: np.ndarray, damping: float, exact: bool = True
):
    """(the state after one damped step or None, the next damping, the fall foretold).

    `exact`: the tangents `J` are those at the state, so that what a step does not keep is its bend.
    """
    gram, gradient, scale = normal(state, J)
    for _ in range(DAMPINGS):
        x, end = trial(model, state, gram, gradient, scale, damping)
        d = end - x
        predicted = float(-2 * gradient @ d - d @ gram @ d)
        (new,) = _states(model, state, [end])
        better = new.cost <= state.cost + 1e-9
        kept = state.cost - new.cost >= KEPT_FALL * predicted or not exact
        if better and (kept or predicted < BENT_FALL):
            return new, damping / DAMPING_FACTOR, predicted
        if predicted < ENDED_FALL:
            break
        others = _bent(model, state, J, x, d, gram, scale, damping)
        best = min([new, *others], key=lambda s: s.cost)
        if best.cost <= state.cost + 1e-9:
            return best, damping / DAMPING_FACTOR if best is new else damping, predicted
        damping = max(damping * DAMPING_FACTOR, FAILED_DAMPING)
    return None, damping, 0.0


def _bent(
    model: AbstractModel, state: FitState, J, x, d, gram, scale, damping: float
) -> list[FitState]:
    """States within a straight step `d` from the numbers `x`, and on its parabola."""
    straight = _states(model, state, [x + d / 2, x + d / 4])
    half, quarter = straight
    if not np.isfinite(half.cost + quarter.cost):
        return straight
    second = 16 * (half.residual - 2 * quarter.residual + state.residual)
    damped = gram / np.outer(scale, scale) + damping * np.eye(len(d))
    a = -np.linalg.lstsq(damped, J.T @ second / scale, rcond=1e-13)[0] / scale
    if np.linalg.norm(scale * a) > LONGEST_BEND * np.linalg.norm(scale * d):
        return straight
    low, high = bounds(model, state.free)
    ends = [np.clip(x + s * d + s * s * a / 2, low, high) for s in (1.0, 0.5)]
    return [*straight, *_states(model, state, ends)]


def _states(model: AbstractModel, state: FitState, ends: Sequence[np.ndarray]) -> list[FitState]:
    """The states at other numbers."""
    P = len(state.point.u)
    points = [moved(state.point, x[:P], state.free, x[P:]) for x in ends]
    return FitState.at(model, points, state.free)


def trial(model: AbstractModel, state: FitState, gram, gradient, scale, damping: float):
    """(the state's numbers, those after one damped step within the bounds)."""
    x, (low, high) = numbers(state), bounds(model, state.free)
    return x, bounded_step(gram, gradient, scale, damping, x, low, high)


def numbers(state: FitState) -> np.ndarray:
    """A state's unit coordinates and its effects' free numbers."""
    return np.concatenate([state.point.u, [value_of(state.point, f) for f in state.free]])


def bounds(model: AbstractModel, free: Sequence[Free]) -> tuple[np.ndarray, np.ndarray]:
    """Least and greatest numbers of a refit."""
    low, high = unit_bounds(model.priors)
    low = np.concatenate([low, [f.low for f in free]])
    return low, np.concatenate([high, [f.high for f in free]])


def bounded_step(gram, gradient, scale, damping, x, low, high):
    """x plus the damped step: the quadratic's least value within the bounds."""
    if len(x) == 0:
        return x
    values, vectors = np.linalg.eigh(gram / np.outer(scale, scale) + damping * np.eye(len(x)))
    root = np.sqrt(np.maximum(values, 1e-13 * values[-1]))
    right = -(vectors.T @ (gradient / scale)) / root
    step = vectors @ (right / root)
    inside = (low - x) * scale, (high - x) * scale
    if np.any((step < inside[0]) | (step > inside[1])):
        bounds = np.minimum(inside[0], -1e-300), np.maximum(inside[1], 1e-300)
        step = lsq_linear(root[:, None] * vectors.T, right, bounds, "bvls").x
    return np.clip(x + step / scale, low, high)
