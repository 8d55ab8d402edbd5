"""A search from its start to its optimum, by sequential quadratic programming (SciPy's SLSQP).

    minimise t    subject to    f_k/size <= t,    (g_j - limit_j)/scale_j <= 0,    0 <= s <= 1

This takes some ten evaluations where the augmented Lagrangian takes hundreds: with several cases
and limits active at once the optimum is nearly a corner.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize

STEPS = 40
ENOUGH = 20  # evaluations a variable, and 20 more: rounding at a kink takes the rest
ROOM = 1e-6  # of a limit's scale: a smaller violation is no reason to go on


class _EnoughError(Exception):
    """All evaluations are spent."""


class SqpSlopes(NamedTuple):
    """Figures at one design and their slopes over the shares."""

    f: np.ndarray  # (k,)
    g: np.ndarray  # (c,)
    df: np.ndarray  # (k, d)
    dg: np.ndarray  # (c, d)

    @property
    def finite(self) -> bool:
        """Whether every figure and slope is a number."""
        return all(np.isfinite(x).all() for x in self)


class Scaled(NamedTuple):
    """One problem in scaled figures: the objective in units of `size`, limits in their scales."""

    at: Callable[[np.ndarray], SqpSlopes]
    limit: np.ndarray  # (c,)
    unit: np.ndarray  # (c,)
    size: float
    epigraph: bool

    def merit(self, s: SqpSlopes) -> tuple[float, float]:
        """(violation, objective) of a point."""
        violation = float(np.max((s.g - self.limit) / self.unit, initial=0.0))
        f = s.f.max() if self.epigraph else s.f.mean()
        return violation, float(f) / self.size


def refined_by_sqp(
    problem: Scaled, share: np.ndarray, free: np.ndarray, reach: float = 1.0
) -> tuple[np.ndarray, int]:
    """A better design near `share` (d,), or `share` itself; and the number of evaluations.

    No variable moves farther than `reach` of its range.
    """
    moving, seen = np.flatnonzero(free), {}

    def placed(y: np.ndarray) -> np.ndarray:
        whole = share.copy()
        whole[moving] = np.clip(y[: len(moving)], 0.0, 1.0)
        return whole

    def at(y: np.ndarray) -> SqpSlopes:
        whole = placed(y)
        key = whole.tobytes()
        if key not in seen:
            if len(seen) == ENOUGH * (1 + len(moving)):
                raise _EnoughError
            seen[key] = whole, problem.at(whole)
        return seen[key][1]

    begin = share[moving]
    start = at(begin)
    if not len(moving) or not start.finite:
        return share, len(seen)
    box = [(max(0.0, s - reach), min(1.0, s + reach)) for s in begin]
    if problem.epigraph:
        begin = np.append(begin, start.f.max() / problem.size)
    try:
        end = placed(minimize(
            lambda y: _objective(problem, at(y), y, moving), begin, jac=True, method="SLSQP",
            bounds=[*box, *[(None, None)] * problem.epigraph],
            constraints=_constraints(problem, at, moving),
            options={"maxiter": STEPS, "ftol": 1e-10},
        ).x)  # fmt: skip
    except FloatingPointError:  # a step into designs without figures
        return share, len(seen)
    except _EnoughError:
        finite = [known for known in seen.values() if known[1].finite]
        end = min(finite, key=lambda known: _rank(problem, known[1]))[0]
    if not np.isfinite(end).all() or not problem.at(end).finite:
        return share, len(seen)
    (over, value), (before, old) = problem.merit(problem.at(end)), problem.merit(start)
    better = value <= old or before > ROOM
    return (end if over <= max(ROOM, 0.99 * before) and better else share), len(seen)


def _rank(problem: Scaled, s: SqpSlopes) -> tuple[float, float]:
    """The better of two designs has the lower one; violations within `ROOM` count as none."""
    over, value = problem.merit(s)
    return max(over, ROOM), value


def _objective(problem: Scaled, s: SqpSlopes, y, moving) -> tuple[float, np.ndarray]:
    if problem.epigraph:
        return y[-1], np.append(np.zeros(len(y) - 1), 1.0)
    if not s.finite:
        raise FloatingPointError
    return s.f.mean() / problem.size, s.df.mean(axis=0)[moving] / problem.size


def _constraints(problem: Scaled, at: Callable, moving: np.ndarray) -> list[dict]:
    """SLSQP's form: values that are at least 0, with their slopes."""

    def values(y):
        s = at(y)
        if not s.finite:
            raise FloatingPointError
        lead = y[-1] - s.f / problem.size if problem.epigraph else np.zeros(0)
        return np.concatenate([lead, (problem.limit - s.g) / problem.unit])

    def slopes(y):
        s = at(y)
        rows = -s.dg[:, moving] / problem.unit[:, None]
        if not problem.epigraph:
            return rows
        lead = np.column_stack([-s.df[:, moving] / problem.size, np.ones(len(s.f))])
        return np.concatenate([lead, np.column_stack([rows, np.zeros(len(rows))])])

    if not problem.epigraph and not len(problem.limit):
        return []
    return [{"type": "ineq", "fun": values, "jac": slopes}]
