"""Joint refits: baseline parameters and effects together, Gauss-Newton with bounds."""

import dataclasses
from collections.abc import Sequence

import numpy as np
from scipy.optimize import lsq_linear

from .model import AbstractModel, Free, Point, moved, value_of

ENOUGH = 0.02  # fall of chi2 that is not worth another round
RENEW = 200.0  # a fall of chi2 after which the baseline's tangents are taken anew


@dataclasses.dataclass(frozen=True)
class Fit:
    """A refitted point: chi2 on the train rows, its prior's part, and the covariance."""

    point: Point
    chi2: float
    penalty: float
    free: tuple[Free, ...]
    covariance: np.ndarray
    jacobian: np.ndarray
    residual: np.ndarray

    @property
    def cost(self) -> float:
        """What the fit makes small."""
        return self.chi2 + self.penalty


def steps_of(point: Point, free: Sequence[Free]) -> np.ndarray:
    """Difference steps of the effects' numbers: 1e-4 of their size, or of a unit for waves."""
    out = []
    for f in free:
        size = abs(value_of(point, f))
        vector = point.effects[f.effect].values[f.key]
        if f.index is not None:
            size = float(np.linalg.norm(vector))
        if f.key in ("phase", "order", "frequency"):  # they act times an angle or a time
            size = 1.0
        out.append(1e-4 * (size or 1e-6))
    return np.array(out)


def tangent_rows(model: AbstractModel, point, free, residual, baseline=None):
    """d residual / d (u, free); the baseline's part may be given where tangents are differences."""
    exact = model.tangents(point, free)
    if exact is not None:
        return exact
    P, points, steps = len(point.u), [], []
    values = np.array([value_of(point, f) for f in free])
    if baseline is None:
        for k in range(P):
            h = 1e-3 if point.u[k] < 0 else -1e-3
            points.append(moved(point, point.u + h * np.eye(P)[k], free, values))
            steps.append(h)
    for k, step in enumerate(steps_of(point, free)):
        h = -step if values[k] + step > free[k].high else step
        points.append(moved(point, point.u, free, values + h * np.eye(len(free))[k]))
        steps.append(h)
    residuals = model.residuals(points, "train") if points else []
    columns = [(r - residual) / h for r, h in zip(residuals, steps, strict=True)]
    changed = np.stack(columns, axis=1) if columns else np.zeros((len(residual), 0))
    return changed if baseline is None else np.concatenate([baseline, changed], axis=1)


def tangents_at(model: AbstractModel, point: Point) -> np.ndarray:
    """d residual / d (u, free numbers) on the train runs."""
    (residual,) = model.residuals([point], "train")
    return tangent_rows(model, point, model.free(point), residual)


def predicted(model: AbstractModel, point: Point, residual, J) -> tuple[Point, float]:
    """Where one bounded Gauss-Newton step leads from `point` with `residual`, and its cost."""
    state = _State(point, tuple(model.free(point)), residual, float(residual @ residual))
    gram, gradient, scale = _normal(state, J)
    x, trial = _trial(model, state, gram, gradient, scale, 1e-6)
    d, P = trial - x, len(point.u)
    cost = state.cost + point.u @ point.u + 2 * gradient @ d + d @ gram @ d
    return moved(point, trial[:P], state.free, trial[P:]), float(cost)


def refit(model: AbstractModel, point: Point, *, baseline=None, rounds: int = 20,
          relative: float = 0.0, give_up: float = np.inf, patience: int = 3) -> Fit:  # fmt: skip
    """Refit `point` on the train runs, with bounds: damped Gauss-Newton steps.

    The tangents of the uncertain parameters are those of `baseline` while they tell the fall of the
    cost well; they are taken anew where they do not, and where the steps end with a misfit.  The
    steps end where the cost falls by less than 0.02, or, where it is far from the noise, by less
    than the `relative` part of itself.  Above a cost of `give_up` round `patience` is the last.
    """
    state = _State.at(model, point, model.free(point))
    tangents, fresh, damping = baseline, baseline is None, 1e-6
    J, floor = None, 1.2 * model.dof("train")
    for turn in range(rounds):
        if not np.isfinite(state.cost) or (turn >= patience and state.cost > give_up):
            break
        J = tangent_rows(model, state.point, state.free, state.residual, tangents)
        if not np.all(np.isfinite(J)) or np.max(np.abs(J), initial=0.0) > 1e100:
            J = None
            break
        tangents = J[:, : len(point.u)]
        new, damping, predicted = _step(model, state, J, damping)
        fall = 0.0 if new is None else state.cost - new.cost
        state = new or state
        far = state.cost > 10 * floor
        ended = fall < max(ENOUGH, relative * state.cost * far)
        if fresh and ended:
            break
        if ended and state.cost < floor:  # nothing but noise is left
            break
        fresh = ended or fall < 0.8 * predicted or fall > RENEW
        tangents = None if fresh else tangents
    return _finished(model, state, J)


@dataclasses.dataclass(frozen=True)
class _State:
    """A point with its residual and cost (chi2 and the priors' part)."""

    point: Point
    free: tuple[Free, ...]
    residual: np.ndarray
    cost: float

    @staticmethod
    def at(model: AbstractModel, point: Point, free: Sequence[Free]) -> "_State":
        (r,) = model.residuals([point], "train")
        return _State(point, tuple(free), r, float(r @ r + point.u @ point.u))


def _normal(state: _State, J: np.ndarray):
    """Gram matrix and gradient with the priors, and the columns' sizes."""
    P = len(state.point.u)
    gram, gradient = J.T @ J, J.T @ state.residual
    gram[:P, :P] += np.eye(P)
    gradient[:P] += state.point.u
    return gram, gradient, np.sqrt(np.maximum(np.diag(gram), 1e-300))


def _step(model: AbstractModel, state: _State, J: np.ndarray, damping: float):
    """(the state after one damped step or None, the next damping, the fall foretold)."""
    P, point = len(state.point.u), state.point
    gram, gradient, scale = _normal(state, J)
    for _ in range(6):
        x, trial = _trial(model, state, gram, gradient, scale, damping)
        d = trial - x
        predicted = float(-2 * gradient @ d - d @ gram @ d)
        new = _State.at(model, moved(point, trial[:P], state.free, trial[P:]), state.free)
        if np.isfinite(new.cost) and new.cost <= state.cost + 1e-9:
            return new, damping / 30, predicted
        if predicted < ENOUGH:
            break
        damping = max(damping * 30, 1e-3)
    return None, damping, 0.0


def _trial(model: AbstractModel, state: _State, gram, gradient, scale, damping: float):
    """(the state's numbers, those after one damped step within the bounds)."""
    point = state.point
    hard = np.array([prior.hard for prior in model.priors])
    x = np.concatenate([point.u, [value_of(point, f) for f in state.free]])
    return x, _bounded_step(gram, gradient, scale, damping, x, hard, state.free)


def _finished(model: AbstractModel, state: _State, J: np.ndarray | None) -> Fit:
    """The fit of a state with its covariance; one that cannot be evaluated costs infinity."""
    P, free = len(state.point.u), state.free
    if J is None or not np.isfinite(state.cost):
        empty = np.zeros((len(state.residual), P + len(free)))
        return Fit(state.point, np.inf, 0.0, free, np.zeros((P + len(free),) * 2), empty,
                   state.residual)  # fmt: skip
    gram, _, scale = _normal(state, J)
    covariance = np.linalg.pinv(gram / np.outer(scale, scale), rcond=1e-12) / np.outer(scale, scale)
    prior = float(state.point.u @ state.point.u)
    return Fit(state.point, state.cost - prior, prior, free, covariance, J, state.residual)


def _bounded_step(gram, gradient, scale, damping, x, hard, free):
    """x plus the damped step: the quadratic's least value within the bounds."""
    low = np.concatenate([-hard, [f.low for f in free]])
    high = np.concatenate([hard, [f.high for f in free]])
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
