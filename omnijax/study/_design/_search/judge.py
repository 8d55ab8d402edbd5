"""Where searches ended: figures, multipliers, and whether that is an optimum."""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np

from ..._problem import Problem
from .figures import ProblemFigures, not_finite
from .kkt import FEASIBLE, DualPoint, Kkt, conditions, verdict
from .search import Starts
from .sqp import SqpSlopes

PROBES = (1e-3, 2e-2)  # of the range: steps to neighbours that must not be better
NEAR = PROBES[-1]  # of the range: a search that ends so near a bound may have stopped short of it


class SearchEnd(NamedTuple):
    """Where one search ended, and what that is."""

    start: np.ndarray  # (d,) values of the variables
    x: np.ndarray
    share: np.ndarray
    free: np.ndarray
    value: float
    f: np.ndarray
    g: np.ndarray  # in units of the limits, less the limit
    limit: np.ndarray
    kkt: Kkt
    status: str
    reason: str
    evaluations: int


def check_optimality(
    figures: ProblemFigures, lanes: Starts, share: np.ndarray, evaluations
) -> list[SearchEnd]:
    """The ends of searches: figures, multipliers, status."""
    limit, free = np.asarray(lanes.limit), np.asarray(lanes.free) > 0
    share = _on_bounds(figures, share, free[: len(share)], limit[: len(share)])
    better = _neighbours(figures, share, free[: len(share)], limit[: len(share)])
    low, high = np.array([(v.low, v.high) for v in figures.problem.variables]).T
    ends = []
    for i, s in enumerate(figures.slopes(share)):
        value = float(figures.combined(s.f))
        kkt = _conditions(figures, share[i], s, limit[i], free[i])
        if s.finite:
            status, reason = verdict(kkt, (value - better[i]) / figures.size)
        else:
            status, reason = "failed", _lost(figures.problem, s)
        x = np.clip(figures.scale.value(jnp.asarray(share[i])), low, high)  # rounding leads past
        start = np.asarray(figures.scale.value(lanes.share[i]))
        ends.append(
            SearchEnd(start, x, share[i], free[i], value, s.f, s.g - limit[i], limit[i], kkt,
                status, reason, int(evaluations[i]))
        )  # fmt: skip
    return ends


def _lost(problem: Problem, s: SqpSlopes) -> str:
    """Which figures or slopes are not finite at a design."""
    told = not_finite(problem, s.f, s.g) or not_finite(problem, s.df, s.dg, "the slopes of ")
    return f"{told} there"


def _on_bounds(figures: ProblemFigures, share, free, limit) -> np.ndarray:
    """Designs (l, d), those near bounds on them where that is better and breaks no limit more.

    Where the objective is flat before a bound, a search stops short of it: that of a metric that
    falls to 0 with a high power.
    """
    bound = np.where(share < NEAR, 0.0, np.where(share > 1 - NEAR, 1.0, share))
    bound = np.where(free, bound, share)
    if np.array_equal(bound, share):
        return share
    f, g = figures.values(np.concatenate([share, bound]))
    value, at_bound = np.split(figures.combined(f), 2)
    over = np.max((g - np.tile(limit, (2, 1))) / figures.unit, axis=1, initial=0.0)
    before, after = np.split(over, 2)
    return np.where(((at_bound < value) & (after <= before))[:, None], bound, share)


def _conditions(figures: ProblemFigures, share, s: SqpSlopes, limit, free) -> Kkt:
    """Multipliers of the objective's optimum, or of the least violation where one is left."""
    if not s.finite:
        nothing = np.zeros(len(s.f)), np.zeros(len(figures.unit)), np.zeros(len(share))
        return Kkt(np.inf, np.inf, *nothing)
    over, slopes = (s.g - limit) / figures.unit, s.dg / figures.unit[:, None]
    if np.max(over, initial=0.0) <= FEASIBLE:
        point = DualPoint(share, s.f, over, s.df, slopes)
        return conditions(point, free, figures.problem.epigraph, figures.size)
    point = DualPoint(share, over, np.zeros(0), slopes, np.zeros((0, len(share))))
    least = conditions(point, free, True, 1.0)
    return least._replace(violation=float(over.max()), limits=least.cases, cases=np.zeros(len(s.f)))


def _neighbours(figures: ProblemFigures, share, free, limit) -> np.ndarray:
    """The best feasible value among steps of `PROBES` along each variable, (l,)."""
    d = share.shape[1]
    moves = np.concatenate([sign * size * np.eye(d) for size in PROBES for sign in (1, -1)])
    points = np.clip(share[:, None] + moves * free[:, None], 0.0, 1.0)
    f, g = figures.values(points.reshape(-1, d))
    f = f.reshape(len(share), len(moves), -1)
    value = figures.combined(f)
    over = (g.reshape(len(share), len(moves), -1) - limit[:, None]) / figures.unit
    allowed = np.isfinite(value) & (np.max(over, axis=-1, initial=0.0) <= 1e-7)
    return np.min(np.where(allowed, value, np.inf), axis=1)


def best_of(ends: list[SearchEnd]) -> SearchEnd:
    """The best end: optimal ones before feasible ones before the least violated."""
    order = {"optimal": 0, "not optimal": 1, "infeasible": 2, "failed": 3}

    def rank(end: SearchEnd):
        infeasible = end.status == "infeasible"
        return (order[end.status], end.kkt.violation if infeasible else end.value)

    best = min(ends, key=rank)
    feasible = [e for e in ends if e.status in {"optimal", "not optimal"}]
    lower = min(feasible, key=lambda e: e.value, default=best)
    slack = 1e-4 * max(abs(best.value), 1e-300)
    if best.status == "optimal" and lower.value < best.value - slack:
        return lower  # a better design is known, so the other one is not the optimum
    return best
