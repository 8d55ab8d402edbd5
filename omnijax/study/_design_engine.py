"""`optimise`: the best design of a `Problem`, or the reason why there is none."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from .._errors import InputError
from ._design_kkt import Kkt, Point, conditions, verdict
from ._design_problem import Problem, check_variables
from ._design_search import Lanes, Search
from ._design_starts import first_lanes, rounded_lanes, start_shares

PROBES = (1e-3, 2e-2)  # of the range: steps to neighbours that must not be better
SILENT = 1e-12


class End(NamedTuple):
    """Where one search ended, and what that is."""

    start: np.ndarray  # (d,) values of the variables
    x: np.ndarray
    share: np.ndarray
    free: np.ndarray
    value: float
    f: np.ndarray
    g: np.ndarray  # in units of the limits, less the limit
    kkt: Kkt
    status: str
    reason: str
    evaluations: int


class Engine:
    """A problem made ready: compiled search, checks, and the stored ends of a folder."""

    def __init__(self, problem: Problem, starts: int, seed: int):
        check_variables(problem.variables)
        self.problem, self.seed = problem, seed
        self.lanes, self.relaxed = first_lanes(problem, starts, seed)
        search = Search(problem, 1.0)
        self._slopes = jax.jit(lambda s: jax.lax.map(lambda x: self._with_slopes(search, x), s))
        shares = jnp.asarray(start_shares(problem, 8, seed))
        f, _, df, dg = (np.asarray(x) for x in self._slopes(shares))
        finite = np.isfinite(f).all(axis=1)
        if not finite.any():
            raise InputError("the objective is not finite at any start: widen or move the bounds.")
        sizes = np.abs(f[finite].max(axis=1) if problem.worst else f[finite].mean(axis=1))
        self.size = float(np.median(sizes)) or 1.0
        self._check_influence(df[finite], dg[finite])
        self.search = Search(problem, self.size)

    @staticmethod
    def _with_slopes(search: Search, share):
        def push(tangent):
            return jax.jvp(lambda s: search.parts(s, search.problem.extra), (share,), (tangent,))

        (f, g), (df, dg) = jax.vmap(push)(jnp.eye(len(share)))
        return f[0], g[0], df.T, dg.T

    def _check_influence(self, df, dg) -> None:
        """`InputError` for variables that nothing depends on."""
        scale = np.array([x.scale for x in self.problem.limits])[:, None]
        moved = np.abs(df).max(axis=(0, 1)) / self.size
        moved = np.maximum(moved, np.abs(dg / scale).max(axis=(0, 1), initial=0.0))
        silent = [v.name for v, m in zip(self.problem.variables, moved, strict=True) if m <= SILENT]
        if silent:
            raise InputError(
                [f"`{n}` influences neither the objective nor a constraint: leave it out."
                 for n in silent]
            )  # fmt: skip

    def judge(self, lanes: Lanes, share: np.ndarray, evaluations) -> list[End]:
        """The ends of searches: figures, multipliers, status."""
        f, g, df, dg = (np.asarray(x) for x in self._slopes(jnp.asarray(share)))
        unit = np.array([x.scale for x in self.problem.limits])
        limit, free = np.asarray(lanes.limit), np.asarray(lanes.free) > 0
        better = self._neighbours(share, free, limit)
        ends = []
        for i in range(len(share)):
            scaled, value = (g[i] - limit[i]) / unit, self._combined(f[i])
            point = Point(share[i], f[i], scaled, df[i], dg[i] / unit[:, None])
            if np.isfinite(f[i]).all() and np.isfinite(df[i]).all() and np.isfinite(dg[i]).all():
                kkt = conditions(point, free[i], self.search.epigraph, self.size)
            else:
                nothing = np.zeros(len(f[i])), np.zeros(len(unit)), np.zeros(len(share[i]))
                kkt = Kkt(np.inf, np.inf, *nothing)
            status, reason = verdict(kkt, (value - better[i]) / self.size)
            x = np.asarray(self.search.scale.value(jnp.asarray(share[i])))
            start = np.asarray(self.search.scale.value(lanes.share[i]))
            ends.append(
                End(start, x, share[i], free[i], value, f[i], g[i] - limit[i], kkt, status, reason,
                    int(evaluations[i]))
            )  # fmt: skip
        return ends

    def _combined(self, f):
        return float(np.max(f) if self.problem.worst else np.mean(f))

    def _neighbours(self, share, free, limit) -> np.ndarray:
        """The best feasible value among steps of `PROBES` along each variable, (l,)."""
        d = share.shape[1]
        moves = np.concatenate([sign * size * np.eye(d) for size in PROBES for sign in (1, -1)])
        points = np.clip(share[:, None] + moves * free[:, None], 0.0, 1.0)
        f, g = self._values(points.reshape(-1, d))
        f = f.reshape(len(share), len(moves), -1)
        value = f.max(-1) if self.problem.worst else f.mean(-1)
        unit = np.array([x.scale for x in self.problem.limits])
        over = (g.reshape(len(share), len(moves), -1) - limit[:, None]) / unit
        allowed = np.isfinite(value) & (np.max(over, axis=-1, initial=0.0) <= 1e-7)
        return np.min(np.where(allowed, value, np.inf), axis=1)

    def _values(self, shares) -> tuple[np.ndarray, np.ndarray]:
        if not hasattr(self, "_plain"):
            extra = self.problem.extra
            self._plain = jax.jit(jax.vmap(lambda s: self.search.parts(s, extra)))
        f, g = self._plain(jnp.asarray(shares))
        return np.asarray(f), np.asarray(g)

    def solve(self, lanes: Lanes, report=None) -> list[End]:
        """Search and judge."""
        found = self.search.run(lanes, report)
        return self.judge(lanes, found.share, found.evaluations)

    def all_ends(self, batch: int, store: Any, report, stochastic: dict | None) -> list[End]:
        """Every search, batch by batch; finished batches come from the store."""
        ends = self._batches(self.lanes, batch, store, "first", report, stochastic)
        if self.relaxed:
            good = [e for e in ends if np.isfinite(e.kkt.violation)]
            chosen = sorted(good, key=lambda e: (e.kkt.violation > 1e-5, e.value))[:2]
            lanes = rounded_lanes(self.problem, np.array([e.share for e in chosen]))
            ends = self._batches(lanes, batch, store, "rounded", report, None)
        return ends

    def _batches(self, lanes, batch, store, stage, report, stochastic) -> list[End]:
        ends, total = [], len(lanes.share)
        for first in range(0, total, batch):
            index = np.minimum(np.arange(first, first + batch), total - 1)  # one shape: one program
            part = Lanes(*(x[index] for x in lanes))
            key = f"{stage}-{first}"
            stored = None if store is None else store.read(key)
            if stored is None:
                moved = self.search.stochastic(part, **stochastic) if stochastic else part
                found = self.search.run(moved)
                stored = {"share": found.share, "evaluations": found.evaluations}
                if store is not None:
                    store.write(key, stored)
            ends += self.judge(part, stored["share"], stored["evaluations"])[: total - first]
            if report is not None:
                report(min(first + batch, total), total)
        return ends


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


Report = Callable[[int, int], None]


class Folder:
    """Finished batches of a search as small files, so that it can be taken up again."""

    def __init__(self, folder: str | Path, identity: str, resume: bool):
        self.folder = Path(folder)
        mark = self.folder / "study.txt"
        if mark.exists():
            if not resume:
                raise InputError("holds a study already: continue with --resume.", folder)
            if mark.read_text(encoding="utf-8") != identity:
                raise InputError("holds another study, so it cannot be continued.", folder)
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            mark.write_text(identity, encoding="utf-8")
        except OSError as error:
            raise InputError(f"cannot be written: {error.strerror}.", folder) from None

    def read(self, key: str) -> dict[str, np.ndarray] | None:
        """What `write` stored under `key`."""
        path = self.folder / f"{key}.npz"
        if not path.exists():
            return None
        with np.load(path, allow_pickle=False) as found:
            return {name: found[name] for name in found.files}

    def write(self, key: str, arrays: dict[str, np.ndarray]) -> None:
        """Store arrays; a killed write leaves no half file."""
        part = self.folder / f".{key}.part.npz"
        np.savez(part, **arrays)  # pyright: ignore[reportArgumentType]
        part.rename(self.folder / f"{key}.npz")
