"""The searches of a design: where they start, how each runs and ends, what a store keeps."""

from collections.abc import Callable
from functools import cached_property, partial
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np

from ...._arrays import on_device
from ..._problem import Problem, check_variables
from ..._study_folder import Folder, Report
from .feasibility import restore_feasibility
from .figures import ProblemFigures
from .in_step import Ask, in_step
from .judge import SearchEnd, check_optimality
from .kkt import FEASIBLE
from .search import Adam, DesignSearch, Starts
from .starts import first_lanes, relaxed, rounded_lanes


class SearchCost(NamedTuple):
    """Where a search ended, and the evaluations it took."""

    share: np.ndarray  # (d,)
    evaluations: int


Ended = Callable[[int, SearchCost], None]  # number of a search, and its end


class _Restored(NamedTuple):
    """Where a search ended, (violation, objective) there, and the evaluations it took."""

    share: np.ndarray  # (d,)
    merit: tuple[float, float]
    evaluations: int


class Engine:
    """A problem made ready: figures, compiled search, starts."""

    def __init__(self, problem: Problem, starts: int, seed: int, store: Folder | None = None):
        check_variables(problem.variables)
        self.starts, self.seed, self.store = starts, seed, store
        self.figures = ProblemFigures(problem, seed)
        self.problem = self.figures.problem
        self.search = DesignSearch(self.problem, self.figures.size)

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
        program of the whole search takes longer to compile than quadratic programs from them.  So
        they are where figures go in bulk, which no program of a search does.
        """
        spent = 0
        if drawn is not None:
            lanes, spent = self.search.stochastic(lanes, self.figures.values, drawn), drawn.steps
        whole = self.problem.costly or self.problem.limits or self.problem.epigraph
        if whole or self.problem.many is not None:
            return np.asarray(lanes.share), np.full(len(lanes.share), spent)
        ends = self.search.run(lanes, self.figures.values)
        return ends.share, ends.evaluations + spent

    def finish(
        self, lanes: Starts, near: dict[int, np.ndarray], ended: Ended = lambda i, end: None
    ) -> dict[int, SearchCost]:
        """Ends of searches that have come `near` (d,), by number, side by side.

        `ended(i, end)` is called as each ends.  One that breaks a limit goes once more by way of
        the augmented Lagrangian's end.
        """
        ends, short = {}, {}

        def close(i: int, share: np.ndarray, evaluations: int) -> None:
            ends[i] = SearchCost(share, evaluations)
            ended(i, ends[i])

        def once(i: int, end: _Restored) -> None:
            if self.problem.costly or end.merit[0] <= FEASIBLE:
                close(i, end.share, end.evaluations)
            else:
                short[i] = end

        self._restored(lanes, near, once)
        alone = {i: Starts(*(x[i : i + 1] for x in lanes)) for i in short}
        others = {i: self.search.run(lane, self._one) for i, lane in alone.items()}

        def again(i: int, end: _Restored) -> None:
            better = min(short[i], end, key=lambda e: e.merit)
            spent = end.evaluations + short[i].evaluations + int(others[i].evaluations[0])
            close(i, better.share, spent)

        self._restored(lanes, {i: other.share[0] for i, other in others.items()}, again)
        return ends

    def _restored(
        self, lanes: Starts, near: dict[int, np.ndarray], ended: Callable[[int, _Restored], None]
    ) -> None:
        """`restore_feasibility` of several searches; their figures are evaluated together."""
        limit, begin, free = (np.asarray(x) for x in (lanes.limit, lanes.share, lanes.free))

        def search(i: int, ask: Ask) -> _Restored:
            scaled = self.figures.scaled(limit[i], ask)
            end, spent = restore_feasibility(scaled, near[i], begin[i], free[i] > 0)
            return _Restored(end, scaled.merit(scaled.at(end)), spent)

        numbers = list(near)
        searches = [partial(search, i) for i in numbers]
        in_step(searches, self.figures.slopes, lambda k, end: ended(numbers[k], end))

    def _one(self, shares: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Figures f (1, k) and g (1, c) of one design, by the program of its slopes."""
        (s,) = self.figures.slopes(shares)
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
        """The ends of `lanes`, each kept in the store as it ends.

        `batch` of them go side by side; where figures do not go in bulk, each ends by itself.
        """
        total, shares, spent = len(lanes.share), [], []
        if report is not None:
            report(0, total)
        for first in range(0, total, batch):
            index = np.minimum(np.arange(first, first + batch), total - 1)  # one shape: one program
            part = Starts(*(on_device(np.asarray(x)[index]) for x in lanes))
            keys = [f"{stage}-{i}" for i in range(first, min(first + batch, total))]
            ends = {i: end for i, key in enumerate(keys) if (end := self._stored(key)) is not None}
            if report is not None and ends:
                report(first + len(ends), total)
            if len(ends) < len(keys):
                near, before = self.near(part, drawn)

                def ended(i, end, first=first, keys=keys, ends=ends, before=before):
                    ends[i] = end._replace(evaluations=end.evaluations + int(before[i]))
                    if self.store is not None:
                        parts = {k: np.asarray(x) for k, x in ends[i]._asdict().items()}
                        self.store.write(keys[i], parts)
                    if report is not None:
                        report(first + len(ends), total)

                left = {i: near[i] for i in range(len(keys)) if i not in ends}
                together = self.problem.many is not None
                for some in [left] if together else [{i: x} for i, x in left.items()]:
                    self.finish(part, some, ended)
            shares += [ends[i].share for i in range(len(keys))]
            spent += [ends[i].evaluations for i in range(len(keys))]
        return check_optimality(self.figures, lanes, np.array(shares), spent)

    def _stored(self, key: str) -> SearchCost | None:
        stored = None if self.store is None else self.store.read(key)
        if stored is None:
            return None
        return SearchCost(stored["share"], int(stored["evaluations"]))
