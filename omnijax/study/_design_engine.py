"""`optimise`: the best design of a `Problem`, or the reason why there is none."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from .._errors import InputError
from ._design_folder import Folder, Report
from ._design_kkt import Kkt, Point, conditions, verdict
from ._design_polish import Scaled, Slopes, polish
from ._design_problem import Problem, check_variables
from ._design_search import Adam, Lanes, Search
from ._design_starts import FORBIDDEN, first_lanes, rounded_lanes, start_shares

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
    """A problem made ready: compiled search, checks, and the stored ends of a folder."""

    def __init__(self, problem: Problem, starts: int, seed: int):
        check_variables(problem.variables)
        self.problem, self.seed = problem, seed
        self.unit = np.array([x.scale for x in problem.limits])
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
        self.rounds, self.relaxed = first_lanes(problem, starts, seed, self._merit)
        self.lanes = self.rounds[0]

    def _merit(self, shares: np.ndarray) -> np.ndarray:
        """Objective and violations of designs as one figure; infinite where a run fails."""
        f, g = self.values(shares)
        value = (f.max(axis=1) if self.problem.worst else f.mean(axis=1)) / self.size
        bound = np.array([x.bound for x in self.problem.limits])
        over = np.maximum((g - bound) / self.unit, 0.0).max(axis=1, initial=0.0)
        return np.nan_to_num(value + FORBIDDEN * over, nan=np.inf)

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
            scaled, value = (s.g - limit[i]) / self.unit, self._combined(s.f)
            point = Point(share[i], s.f, scaled, s.df, s.dg / self.unit[:, None])
            if s.finite:
                kkt = conditions(point, free[i], self.search.epigraph, self.size)
            else:
                nothing = np.zeros(len(s.f)), np.zeros(len(self.unit)), np.zeros(len(share[i]))
                kkt = Kkt(np.inf, np.inf, *nothing)
            status, reason = verdict(kkt, (value - better[i]) / self.size)
            x = np.asarray(self.search.scale.value(jnp.asarray(share[i])))
            start = np.asarray(self.search.scale.value(lanes.share[i]))
            ends.append(
                End(start, x, share[i], free[i], value, s.f, s.g - limit[i], limit[i], kkt,
                    status, reason, int(evaluations[i]))
            )  # fmt: skip
        return ends

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

    def solve(
        self, lanes: Lanes, count: int, drawn: Adam | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Where the first `count` searches end, shares (l, d), and their evaluations (l,)."""
        spent = 0
        if drawn is not None:
            lanes, spent = self.search.stochastic(lanes, self.values, drawn), drawn.steps
        found = self.search.run(lanes, self.values)
        share, evaluations = found.share.copy(), found.evaluations + spent
        for i in range(count):
            scaled = Scaled(
                self.slopes, np.asarray(lanes.limit[i]), self.unit, self.size, self.search.epigraph
            )
            share[i], more = polish(scaled, share[i], np.asarray(lanes.free[i]) > 0)
            evaluations[i] += more
        return share[:count], evaluations[:count]

    def all_ends(
        self, batch: int, store: Folder | None, report: Report | None, drawn: Adam | None
    ) -> list[End]:
        """Every search, batch by batch; finished batches come from the store.

        Those that end infeasible are made again from other starts.
        """
        ends = last = self.batches(self.lanes, batch, store, "first", report, drawn)
        slots = np.arange(len(last))
        for r, lanes in enumerate(self.rounds[1:], 2):
            short = [e.status in {"infeasible", "failed"} for e in last]
            if self.relaxed or not any(short):
                break
            slots = slots[short]
            part = Lanes(*(x[slots] for x in lanes))
            last = self.batches(part, batch, store, f"round-{r}", report, drawn)
            ends = [*ends, *last]
        if self.relaxed:
            good = [e for e in ends if np.isfinite(e.kkt.violation)]
            chosen = sorted(good, key=lambda e: (e.kkt.violation > 1e-5, e.value))[:2]
            lanes = rounded_lanes(self.problem, np.array([e.share for e in chosen]))
            ends = self.batches(lanes, batch, store, "rounded", report, None)
        return ends

    def batches(
        self, lanes: Lanes, batch: int, store: Folder | None, stage: str,
        report: Report | None = None, drawn: Adam | None = None,
    ) -> list[End]:  # fmt: skip
        """The ends of `lanes`, `batch` of them side by side, kept in `store` under `stage`."""
        ends, total = [], len(lanes.share)
        for first in range(0, total, batch):
            index = np.minimum(np.arange(first, first + batch), total - 1)  # one shape: one program
            part = Lanes(*(x[index] for x in lanes))
            key = f"{stage}-{first}"
            stored = None if store is None else store.read(key)
            if stored is None:
                share, evaluations = self.solve(part, min(batch, total - first), drawn)
                stored = {"share": share, "evaluations": evaluations}
                if store is not None:
                    store.write(key, stored)
            ends += self.judge(part, stored["share"], stored["evaluations"])
            if report is not None:
                report(min(first + batch, total), total)
        return ends


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
