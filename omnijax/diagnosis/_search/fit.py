"""Joint refits: baseline parameters and effects together, Gauss-Newton with bounds."""

import contextlib
import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Protocol

import numpy as np

from .._settings import SETTINGS
from .gauss_newton import DAMPING, ENDED_FALL, KEPT_FALL, FitState, normal, stepped, trial
from .model import AbstractModel, Free, Point, moved, value_of

RENEWING_FALL = SETTINGS.fit.renewing_fall
MOST_STEPS = SETTINGS.fit.most_steps
PATIENCE = SETTINGS.fit.patience
STEPS_BETWEEN = SETTINGS.fit.steps_between
NOISE_FLOOR = SETTINGS.fit.noise_floor
FAR_RATIO = SETTINGS.fit.far_ratio
NUMBER_STEP = SETTINGS.fit.number_step
LEAST_NUMBER = SETTINGS.fit.least_number
PRIOR_STEP = SETTINGS.fit.prior_step
BLOCKS = SETTINGS.held_out.blocks


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

    def covariances(self, i: int, of: np.ndarray) -> dict[str, np.ndarray]:
        """By free number of effect `i` its part (k, k) `of` a covariance, of a vector's k parts."""
        places: dict[str, list[int]] = {}
        for k, free in enumerate(self.free):
            if free.effect == i:
                places.setdefault(free.key, []).append(len(self.point.u) + k)
        return {key: of[np.ix_(own, own)] for key, own in places.items()}

    def scaled_covariance(self, dof: int) -> np.ndarray:
        """The covariance (numbers, numbers) by what the fit leaves in `dof` rows.

        `covariance` is that of white noise of the assumed level.  What is left above it counts as
        noise too, which makes no prior wider; and where it has a colour, or is stronger in the
        channels that tell a number, that number is less sure by the scatter of the sums of tangent
        times residual over blocks of rows.

        Source: White, A heteroskedasticity-consistent covariance matrix estimator (1980); over
        blocks, Liang, Zeger (1986).
        """
        spread = self.chi2 / dof
        if self.covariance.size == 0 or not np.isfinite(spread):
            return self.covariance
        spread, P = max(1.0, spread), len(self.point.u)
        gram = self.jacobian.T @ self.jacobian / spread
        gram[:P, :P] += np.eye(P)
        white = inverse(gram)
        scattered = np.sum((self.block_sums() @ white / spread) ** 2, axis=0)
        scattered += np.sum(white[:P] ** 2, axis=0)  # as the priors do
        worse = np.sqrt(np.maximum(1.0, scattered / np.maximum(np.diag(white), 1e-300)))
        return white * np.outer(worse, worse)

    def block_sums(self) -> np.ndarray:
        """Sums (blocks, numbers) of tangent times residual over blocks of rows."""
        starts = np.linspace(0, len(self.residual), BLOCKS, endpoint=False).astype(int)
        products = self.jacobian * self.residual[:, None]
        return np.add.reduceat(products, np.unique(starts), axis=0)


def inverse(gram: np.ndarray) -> np.ndarray:
    """The inverse of a symmetric matrix of numbers of any units; 0 along what it does not know."""
    scale = np.sqrt(np.maximum(np.diag(gram), 1e-300))
    return np.linalg.pinv(gram / np.outer(scale, scale), rcond=1e-12) / np.outer(scale, scale)


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
        out.append(NUMBER_STEP * (size or LEAST_NUMBER))
    return np.array(out)


def tangent_rows(model: AbstractModel, point, free, residual, baseline=None, split="train"):
    """d residual / d (u, free); the baseline's part may be given where tangents are differences."""
    exact = model.tangents(point, free) if split in ("train", model.ranking) else None
    if exact is not None:
        return exact[: len(residual)]  # the rows that rank laws come first
    known = model.prior_tangents(point, split) if baseline is None else {}
    return difference_rows(model, point, free, residual, baseline, split, known)


class AbstractPredictions(Protocol):
    """What differences are taken of: an `AbstractModel`, or a part of one."""

    def residuals(self, points: Sequence[Point], split: str) -> list[np.ndarray]: ...

    def aside(self) -> contextlib.AbstractContextManager[None]: ...


def difference_rows(
    model: AbstractPredictions, point, free, residual, baseline=None, split="train",
    known: Mapping[int, np.ndarray] = MappingProxyType({}),
):  # fmt: skip
    """`tangent_rows` by differences, but for those `known` of the uncertain parameters."""
    P, points, steps = len(point.u), [], []
    values = np.array([value_of(point, f) for f in free])
    others = [k for k in range(P) if k not in known] if baseline is None else []
    for k in others:
        h = PRIOR_STEP if point.u[k] < 0 else -PRIOR_STEP
        points.append(moved(point, point.u + h * np.eye(P)[k], free, values))
        steps.append(h)
    for k, step in enumerate(steps_of(point, free)):
        h = -step if values[k] + step > free[k].high else step
        points.append(moved(point, point.u, free, values + h * np.eye(len(free))[k]))
        steps.append(h)
    with model.aside():
        residuals = model.residuals(points, split) if points else []
    columns = [(r - residual) / h for r, h in zip(residuals, steps, strict=True)]
    if known:
        taken = {**dict(zip(others, columns, strict=False)), **known}
        columns = [*(taken[k] for k in range(P)), *columns[len(others) :]]
    changed = np.stack(columns, axis=1) if columns else np.zeros((len(residual), 0))
    return changed if baseline is None else np.concatenate([baseline, changed], axis=1)


def tangents_at(model: AbstractModel, point: Point, split: str = "train") -> np.ndarray:
    """d residual / d (u, free numbers) on the train runs, or on those of them that rank laws."""
    (residual,) = model.residuals([point], split)
    return tangent_rows(model, point, model.free(point), residual, split=split)


def predicted(model: AbstractModel, point: Point, residual, J) -> tuple[Point, float]:
    """Where one bounded Gauss-Newton step leads from `point` with `residual`, and its cost."""
    state = FitState(point, tuple(model.free(point)), residual, float(residual @ residual))
    gram, gradient, scale = normal(state, J)
    x, end = trial(model, state, gram, gradient, scale, DAMPING)
    d, P = end - x, len(point.u)
    cost = state.cost + point.u @ point.u + 2 * gradient @ d + d @ gram @ d
    return moved(point, end[:P], state.free, end[P:]), float(cost)


def refit(
    model: AbstractModel, point: Point, *, baseline=None, rounds: int = MOST_STEPS,
    relative: float = 0.0, give_up: float = np.inf, patience: int = PATIENCE,
) -> Fit:  # fmt: skip
    """Refit `point` on the train runs, with bounds: damped Gauss-Newton steps.

    The tangents of the uncertain parameters are those of `baseline` while they tell the fall of the
    cost well; they are taken anew where they do not, and where the steps end with a misfit.  The
    steps end where the cost falls by less than `ENDED_FALL`, or, far from the noise, by less than
    the `relative` part of itself.  Above a cost of `give_up` round `patience` is the last.
    """
    (state,) = FitState.at(model, [point], model.free(point))
    tangents, fresh, damping = baseline, baseline is None, DAMPING
    J, floor = None, NOISE_FLOOR * model.dof("train")
    for turn in range(rounds):
        if not np.isfinite(state.cost) or (turn >= patience and state.cost > give_up):
            break
        J = tangent_rows(model, state.point, state.free, state.residual, tangents)
        if not np.all(np.isfinite(J)) or np.max(np.abs(J), initial=0.0) > 1e100:
            J = None
            break
        tangents = J[:, : len(point.u)]
        new, damping, predicted = stepped(model, state, J, damping, fresh)
        fall = 0.0 if new is None else state.cost - new.cost
        state = new or state
        far = state.cost > FAR_RATIO * floor
        ended = fall < max(ENDED_FALL, relative * state.cost * far)
        if fresh and ended:
            break
        if ended and state.cost < floor:  # nothing but noise is left
            break
        fresh = ended or fall < KEPT_FALL * predicted or fall > RENEWING_FALL
        tangents = None if fresh else tangents
    return _finished(model, state, J)


def refits_about(
    model: AbstractModel, point: Point, most: int, relative: float = 0.0
) -> Iterator[Fit]:
    """Yield `most` refits at most, each about what `rebase` makes of the data where the last ended.

    What is prepared and the numbers lead each other on; who asks says when that is over.
    """
    for _ in range(most):
        model.rebase(point)
        fit = refit(model, point, rounds=STEPS_BETWEEN, relative=relative)
        yield fit
        point = fit.point


def seen_from(model: AbstractModel, fit: Fit, point: Point) -> Fit:
    """A fit as it is at another point: residual and tangents there, the covariance as it was."""
    (residual,) = model.residuals([point], "train")
    jacobian = tangent_rows(model, point, fit.free, residual)
    prior = float(point.u @ point.u)
    return dataclasses.replace(fit, point=point, chi2=float(residual @ residual), penalty=prior,
                               jacobian=jacobian, residual=residual)  # fmt: skip


def _finished(model: AbstractModel, state: FitState, J: np.ndarray | None) -> Fit:
    """The fit of a state with its covariance; one that cannot be evaluated costs infinity."""
    P, free = len(state.point.u), state.free
    if J is None or not np.isfinite(state.cost):
        empty = np.zeros((len(state.residual), P + len(free)))
        return Fit(state.point, np.inf, 0.0, free, np.zeros((P + len(free),) * 2), empty,
                   state.residual)  # fmt: skip
    gram, _, _ = normal(state, J)
    covariance = inverse(gram)
    prior = float(state.point.u @ state.point.u)
    return Fit(state.point, state.cost - prior, prior, free, covariance, J, state.residual)
