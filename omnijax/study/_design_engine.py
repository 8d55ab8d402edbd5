"""`optimise`: the best design of a `Problem`, or the reason why there is none."""

from functools import cached_property
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from .._errors import InputError
from ._design_evolve import Rank
from ._design_folder import Folder, Report
from ._design_kkt import FEASIBLE, Kkt, Point, conditions, verdict
from ._design_mend import mend
from ._design_polish import Scaled, Slopes
from ._design_problem import Problem, check_variables
from ._design_search import Adam, Lanes, Search
from ._design_starts import first_lanes, relaxed, rounded_lanes, start_shares

PROBES = (1e-3, 2e-2)  # of the range: steps to neighbours that must not be better
SILENT = 1e-12
WIDTH = 16  # designs evaluated side by side


class End(NamedTuple):
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


class Engine:
    """A problem made ready: compiled figures and search, first designs, checks."""

    def __init__(self, problem: Problem, starts: int, seed: int, store: Folder | None = None):
        check_variables(problem.variables)
        self.problem, self.starts, self.seed, self.store = problem, starts, seed, store
        self.unit = np.array([x.scale for x in problem.limits])
        self.bound = np.array([x.bound for x in problem.limits])
        plain = Search(problem, 1.0)
        self._slopes = jax.jit(lambda share: _with_slopes(plain, share))
        self._values = jax.jit(jax.vmap(lambda s: plain.parts(s, problem.extra)))
        seen = [self.slopes(s) for s in start_shares(problem, 8, seed)]
        seen = [s for s in seen if np.isfinite(s.f).all()]
        if not seen:
            raise InputError("the objective is not finite at any start: widen or move the bounds.")
        self.size = float(np.median([abs(self._combined(s.f)) for s in seen])) or 1.0
        self._check_influence(seen)
        self.search = Search(problem, self.size)

    @cached_property
    def lanes(self) -> Lanes:
        """Where the searches start; from the store if it knows."""
        stored = None if self.store is None else self.store.read("starts")
        if stored is not None:
            return Lanes(*(jnp.asarray(stored[name]) for name in Lanes._fields))
        lanes = first_lanes(self.problem, self.starts, self.seed, self._rank)
        if self.store is not None:
            self.store.write("starts", {k: np.asarray(x) for k, x in lanes._asdict().items()})
        return lanes

    def _rank(self, shares: np.ndarray) -> Rank:
        """What designs are ranked by; a failed run is the worst."""
        f, g = self.values(shares)
        value = (f.max(axis=1) if self.problem.worst else f.mean(axis=1)) / self.size
        over = np.maximum((g - self.bound) / self.unit, 0.0).sum(axis=1)
        over = np.where(np.isfinite(over) & np.isfinite(value), over, np.inf)
        return Rank(over, np.where(np.isfinite(value), value, np.inf))

    def slopes(self, share: np.ndarray) -> Slopes:
        """Figures and slopes of one design."""
        return Slopes(*(np.asarray(x) for x in self._slopes(jnp.asarray(share))))

    def _check_influence(self, seen: list[Slopes]) -> None:
        """`InputError` for variables that nothing depends on."""
        moved = np.max([np.abs(s.df).max(axis=0) for s in seen], axis=0) / self.size
        for s in seen:
            sides = np.abs(s.dg / self.unit[:, None])
            moved = np.maximum(moved, sides.max(axis=0, initial=0.0))
        silent = [v.name for v, m in zip(self.problem.variables, moved, strict=True) if m <= SILENT]
        if silent:
            raise InputError(
                [f"`{n}` influences neither the objective nor a constraint: leave it out."
                 for n in silent]
            )  # fmt: skip

    def judge(self, lanes: Lanes, share: np.ndarray, evaluations) -> list[End]:
        """The ends of searches: figures, multipliers, status."""
        limit, free = np.asarray(lanes.limit), np.asarray(lanes.free) > 0
        better = self._neighbours(share, free[: len(share)], limit[: len(share)])
        ends = []
        for i in range(len(share)):
            s = self.slopes(share[i])
            value, kkt = self._combined(s.f), self._conditions(share[i], s, limit[i], free[i])
            status, reason = verdict(kkt, (value - better[i]) / self.size)
            x = np.asarray(self.search.scale.value(jnp.asarray(share[i])))
            start = np.asarray(self.search.scale.value(lanes.share[i]))
            ends.append(
                End(start, x, share[i], free[i], value, s.f, s.g - limit[i], limit[i], kkt,
                    status, reason, int(evaluations[i]))
            )  # fmt: skip
        return ends

    def _conditions(self, share, s: Slopes, limit, free) -> Kkt:
        """Multipliers of the objective's optimum, or of the least violation where one is left."""
        if not s.finite:
            nothing = np.zeros(len(s.f)), np.zeros(len(self.unit)), np.zeros(len(share))
            return Kkt(np.inf, np.inf, *nothing)
        over, slopes = (s.g - limit) / self.unit, s.dg / self.unit[:, None]
        if np.max(over, initial=0.0) <= FEASIBLE:
            point = Point(share, s.f, over, s.df, slopes)
            return conditions(point, free, self.search.epigraph, self.size)
        point = Point(share, over, np.zeros(0), slopes, np.zeros((0, len(share))))
        least = conditions(point, free, True, 1.0)
        return least._replace(
            violation=float(over.max()), limits=least.cases, cases=np.zeros(len(s.f))
        )

    def _combined(self, f):
        return float(np.max(f) if self.problem.worst else np.mean(f))

    def _neighbours(self, share, free, limit) -> np.ndarray:
        """The best feasible value among steps of `PROBES` along each variable, (l,)."""
        d = share.shape[1]
        moves = np.concatenate([sign * size * np.eye(d) for size in PROBES for sign in (1, -1)])
        points = np.clip(share[:, None] + moves * free[:, None], 0.0, 1.0)
        f, g = self.values(points.reshape(-1, d))
        f = f.reshape(len(share), len(moves), -1)
        value = f.max(-1) if self.problem.worst else f.mean(-1)
        over = (g.reshape(len(share), len(moves), -1) - limit[:, None]) / self.unit
        allowed = np.isfinite(value) & (np.max(over, axis=-1, initial=0.0) <= 1e-7)
        return np.min(np.where(allowed, value, np.inf), axis=1)

    def values(self, shares: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Figures f (n, k) and g (n, c) of designs, in pieces of one compiled shape."""
        parts = []
        for first in range(0, len(shares), WIDTH):
            index = np.minimum(np.arange(first, first + WIDTH), len(shares) - 1)
            found = self._values(jnp.asarray(shares[index]))
            parts.append([np.asarray(x)[: len(shares) - first] for x in found])
        f, g = (np.concatenate(x) for x in zip(*parts, strict=True))
        return f, g

    def near(self, lanes: Lanes, drawn: Adam | None) -> tuple[np.ndarray, np.ndarray]:
        """Shares (l, d) near the ends of searches side by side, and their evaluations (l,).

        Over integrated runs these are the starts: a program of the whole search takes longer to
        compile than the searches themselves.
        """
        spent = 0
        if drawn is not None:
            lanes, spent = self.search.stochastic(lanes, self.values, drawn), drawn.steps
        if self.problem.costly:
            return np.asarray(lanes.share), np.full(len(lanes.share), spent)
        found = self.search.run(lanes, self.values)
        return found.share, found.evaluations + spent

    def finish(self, lanes: Lanes, i: int, near: np.ndarray) -> tuple[np.ndarray, int]:
        """Where search `i` ends that has come to `near` (d,), and the evaluations it still took."""
        limit = np.asarray(lanes.limit[i])
        scaled = Scaled(self.slopes, limit, self.unit, self.size, self.search.epigraph)
        return mend(scaled, near, np.asarray(lanes.share[i]), np.asarray(lanes.free[i]) > 0)

    def all_ends(self, batch: int, report: Report | None, drawn: Adam | None) -> list[End]:
        """Every search; finished ones come from the store."""
        ends = self.batches(self.lanes, batch, "first", report, drawn)
        if not relaxed(self.problem):
            return ends
        good = [e for e in ends if np.isfinite(e.kkt.violation)]
        chosen = sorted(good, key=lambda e: (e.kkt.violation > FEASIBLE, e.value))[:2]
        lanes = rounded_lanes(self.problem, np.array([e.share for e in chosen]))
        return self.batches(lanes, batch, "rounded", report)

    def batches(
        self, lanes: Lanes, batch: int, stage: str,
        report: Report | None = None, drawn: Adam | None = None,
    ) -> list[End]:  # fmt: skip
        """The ends of `lanes`, `batch` of them side by side, each kept in the store as it ends."""
        total, shares, spent = len(lanes.share), [], []
        if report is not None:
            report(0, total)
        for first in range(0, total, batch):
            index = np.minimum(np.arange(first, first + batch), total - 1)  # one shape: one program
            part = Lanes(*(x[index] for x in lanes))
            keys = [f"{stage}-{i}" for i in range(first, min(first + batch, total))]
            known = [self._stored(key) for key in keys]
            near, before = (None, None) if all(known) else self.near(part, drawn)
            for i, end in enumerate(known):
                if end is not None:
                    share, more = end["share"], int(end["evaluations"])
                else:
                    assert near is not None and before is not None
                    share, more = self.finish(part, i, near[i])
                    more += int(before[i])
                    if self.store is not None:
                        self.store.write(keys[i], {"share": share, "evaluations": np.array(more)})
                shares.append(share)
                spent.append(more)
                if report is not None:
                    report(first + i + 1, total)
        return self.judge(lanes, np.array(shares), spent)

    def _stored(self, key: str) -> dict[str, np.ndarray] | None:
        return None if self.store is None else self.store.read(key)


def _with_slopes(search: Search, share):
    """f (k,), g (c,) and their slopes (k, d), (c, d) at one design."""

    def push(tangent):
        return jax.jvp(lambda s: search.parts(s, search.problem.extra), (share,), (tangent,))

    (f, g), (df, dg) = jax.vmap(push)(jnp.eye(len(share)))
    return f[0], g[0], df.T, dg.T


def best_of(ends: list[End]) -> End:
    """The best end: optimal ones before feasible ones before the least violated."""
    order = {"optimal": 0, "not optimal": 1, "infeasible": 2, "failed": 3}

    def rank(end: End):
        infeasible = end.status == "infeasible"
        level = 1 if end.status == "not optimal" else order[end.status]
        return (level, end.kkt.violation if infeasible else end.value)

    best = min(ends, key=rank)
    feasible = [e for e in ends if e.status in {"optimal", "not optimal"}]
    lower = min(feasible, key=lambda e: e.value, default=best)
    slack = 1e-4 * max(abs(best.value), 1e-300)
    if best.status == "optimal" and lower.value < best.value - slack:
        return lower  # a better design is known, so the other one is not the optimum
    return best
