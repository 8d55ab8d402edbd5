"""The searches of a design: where they start, how each runs and ends, what a store keeps."""

from functools import cached_property

import jax.numpy as jnp
import numpy as np

from .._problem import Problem, check_variables
from .._study_folder import Folder, Report
from .feasibility import restore_feasibility
from .figures import ProblemFigures
from .judge import SearchEnd, check_optimality
from .kkt import FEASIBLE
from .search import Adam, DesignSearch, Starts
from .starts import first_lanes, relaxed, rounded_lanes


class Engine:
    """A problem made ready: figures, compiled search, starts."""

    def __init__(self, problem: Problem, starts: int, seed: int, store: Folder | None = None):
        check_variables(problem.variables)
        self.problem, self.starts, self.seed, self.store = problem, starts, seed, store
        self.figures = ProblemFigures(problem, seed)
        self.search = DesignSearch(problem, self.figures.size)

    @cached_property
    def lanes(self) -> Starts:
        """Where the searches start; from the store if it knows."""
        stored = None if self.store is None else self.store.read("starts")
        if stored is not None:
            return Starts(*(jnp.asarray(stored[name]) for name in Starts._fields))
        lanes = first_lanes(self.problem, self.starts, self.seed, self.figures.rank)
        if self.store is not None:
            self.store.write("starts", {k: np.asarray(x) for k, x in lanes._asdict().items()})
        return lanes

    def near(self, lanes: Starts, drawn: Adam | None) -> tuple[np.ndarray, np.ndarray]:
        """Shares (l, d) near the ends of searches side by side, and their evaluations (l,).

        With limits or a worst case, and over integrated runs, these are the starts: there a
        program of the whole search takes longer to compile than quadratic programs from them.
        """
        spent = 0
        if drawn is not None:
            lanes, spent = self.search.stochastic(lanes, self.figures.values, drawn), drawn.steps
        if self.problem.costly or self.problem.limits or self.problem.epigraph:
            return np.asarray(lanes.share), np.full(len(lanes.share), spent)
        ends = self.search.run(lanes, self.figures.values)
        return ends.share, ends.evaluations + spent

    def finish(self, lanes: Starts, i: int, near: np.ndarray) -> tuple[np.ndarray, int]:
        """Where search `i` ends that has come to `near` (d,), and the evaluations it still took.

        Where that breaks a limit, once more by way of the augmented Lagrangian's end.
        """
        scaled = self.figures.scaled(np.asarray(lanes.limit[i]))
        begin, free = np.asarray(lanes.share[i]), np.asarray(lanes.free[i]) > 0
        end, spent = restore_feasibility(scaled, near, begin, free)
        left = scaled.merit(scaled.at(end))
        if self.problem.costly or left[0] <= FEASIBLE:
            return end, spent
        other = self.search.run(Starts(*(x[i : i + 1] for x in lanes)), self._one)
        again, more = restore_feasibility(scaled, other.share[0], begin, free)
        better = scaled.merit(scaled.at(again)) < left
        return (again if better else end), spent + more + int(other.evaluations[0])

    def _one(self, shares: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Figures f (1, k) and g (1, c) of one design, by the program of its slopes."""
        s = self.figures.slopes(shares[0])
        return s.f[None], s.g[None]

    def all_ends(self, batch: int, report: Report | None, drawn: Adam | None) -> list[SearchEnd]:
        """Every search; finished ones come from the store."""
        ends = self.batches(self.lanes, batch, "first", report, drawn)
        if not relaxed(self.problem):
            return ends
        good = [e for e in ends if np.isfinite(e.kkt.violation)]
        chosen = sorted(good, key=lambda e: (e.kkt.violation > FEASIBLE, e.value))[:2]
        lanes = rounded_lanes(self.problem, np.array([e.share for e in chosen]))
        return self.batches(lanes, batch, "rounded", report)

    def batches(
        self, lanes: Starts, batch: int, stage: str,
        report: Report | None = None, drawn: Adam | None = None,
    ) -> list[SearchEnd]:  # fmt: skip
        """The ends of `lanes`, `batch` of them side by side, each kept in the store as it ends."""
        total, shares, spent = len(lanes.share), [], []
        if report is not None:
            report(0, total)
        for first in range(0, total, batch):
            index = np.minimum(np.arange(first, first + batch), total - 1)  # one shape: one program
            part = Starts(*(x[index] for x in lanes))
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
        return check_optimality(self.figures, lanes, np.array(shares), spent)

    def _stored(self, key: str) -> dict[str, np.ndarray] | None:
        return None if self.store is None else self.store.read(key)
