"""Joint refits: baseline parameters and effects together, Gauss-Newton with bounds."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from ._model import AbstractModel, Free, Point, moved, value_of

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
    """Difference steps of the effects' numbers: 1e-4 of their size, or of a unit for angles."""
    out = []
    for f in free:
        size = abs(value_of(point, f))
        vector = point.effects[f.effect].values[f.key]
        if f.index is not None:
            size = float(np.linalg.norm(vector))
        if f.key == "phase":
            size = 1.0
        out.append(1e-4 * (size or 1e-6))
    return np.array(out)


def _jacobian(model: AbstractModel, point, free, residual, baseline=None):
    """d residual / d (u, free); the baseline's part may be given."""
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
    found = model.residuals(points, "train") if points else []
    columns = [(r - residual) / h for r, h in zip(found, steps, strict=True)]
    changed = np.stack(columns, axis=1) if columns else np.zeros((len(residual), 0))
    return changed if baseline is None else np.concatenate([baseline, changed], axis=1)


def refit(model: AbstractModel, point: Point, *, baseline=None, rounds: int = 20,
          widths: bool = False, tolerance: float = 0.02) -> Fit:  # fmt: skip
    """Refit `point` on the train runs.

    The tangents of the uncertain parameters, which move by a few per cent only, are those of
    `baseline`; without them they are taken here, and anew while chi2 still falls by much.
    Steps are damped until the cost falls.
    """
    free = model.free(point, widths)
    P = len(point.u)
    hard = np.array([prior.hard for prior in model.priors])
    soft = np.ones(P)
    (residual,) = model.residuals([point], "train")
    damping, J, tangents = 1e-6, None, baseline
    for _ in range(rounds):
        if not np.all(np.isfinite(residual)):
            break
        J = _jacobian(model, point, free, residual, tangents)
        if not np.all(np.isfinite(J)) or np.max(np.abs(J), initial=0.0) > 1e100:
            J = None
            break
        tangents = J[:, :P]
        cost = residual @ residual + point.u @ (soft * point.u)
        gram, gradient = J.T @ J, J.T @ residual
        gram[:P, :P] += np.diag(soft)
        gradient[:P] += soft * point.u
        scale = np.sqrt(np.maximum(np.diag(gram), 1e-300))
        better = False
        for _ in range(6):
            x = np.concatenate([point.u, [value_of(point, f) for f in free]])
            trial = _bounded_step(gram, gradient, scale, damping, x, hard, free)
            candidate = moved(point, trial[:P], free, trial[P:])
            (r,) = model.residuals([candidate], "train")
            new = r @ r + candidate.u @ (soft * candidate.u)
            if np.isfinite(new) and new <= cost + 1e-9:
                better = True
                break
            damping = max(damping * 30, 1e-3)
        if not better:
            break
        point, residual, damping = candidate, r, damping / 30
        if cost - new < tolerance:
            break
        if baseline is None and cost - new > RENEW:
            tangents = None
    if J is None or not np.isfinite(
        residual @ residual
    ):  # a start at which the model cannot be evaluated is no candidate
        return Fit(point, np.inf, 0.0, tuple(free), np.zeros((P + len(free),) * 2),
                   np.zeros((len(residual), P + len(free))), residual)  # fmt: skip
    gram = J.T @ J
    gram[:P, :P] += np.diag(soft)
    scale = np.sqrt(np.maximum(np.diag(gram), 1e-300))
    covariance = np.linalg.pinv(gram / np.outer(scale, scale), rcond=1e-12) / np.outer(scale, scale)
    return Fit(point, float(residual @ residual), float(point.u @ (soft * point.u)), tuple(free),
               covariance, J, residual)  # fmt: skip


def _bounded_step(gram, gradient, scale, damping, x, hard, free):
    """x plus the damped step; what hits a bound stays there and the others are solved again."""
    P = len(hard)
    low = np.concatenate([-hard, [f.low for f in free]])
    high = np.concatenate([hard, [f.high for f in free]])
    active = np.ones(len(x), bool)
    trial = x.copy()
    for _ in range(len(x)):
        index = np.flatnonzero(active)
        A = gram[np.ix_(index, index)] / np.outer(scale[index], scale[index])
        fixed = gram @ np.where(active, 0.0, trial - x)
        b = -(gradient + fixed)[index] / scale[index]
        step = np.linalg.lstsq(A + damping * np.eye(len(index)), b, rcond=1e-13)[0] / scale[index]
        trial[index] = x[index] + step
        out = (trial < low) | (trial > high)
        if not np.any(out & active):
            break
        trial = np.clip(trial, low, high)
        active &= ~out
        if not active.any():
            break
    _ = P
    return trial


def renew(fit: Fit, **changes) -> Fit:
    """The fit with other fields."""
    return dataclasses.replace(fit, **changes)
