"""Windows whose start is free: refitted beside a machine's numbers, and projected out of rows.

A start that is off bends all that hangs on the state nonlinearly: a play, a line of the angle.  So
starts are refitted, not only projected out.
"""

from collections.abc import Sequence

import numpy as np

from ..._settings import SETTINGS
from .before import matters
from .evaluation import RowEvaluation
from .reopened import reopened

START_STEPS = SETTINGS.free_model.start_steps
START_PARTS = SETTINGS.free_model.start_parts
START_GAIN = SETTINGS.free_model.start_gain

ByRun = dict[int, np.ndarray]


class FreeStarts:
    """The windows' starts of the free runs of an evaluation.

    `bases` are by run (rows of a window, an orthonormal basis of what its start changes there).
    """

    def __init__(self, evaluation: RowEvaluation):
        self.evaluation, self.runs = evaluation, evaluation.measured.free_runs
        self.bases: dict[int, list] = {}

    def refit(self, theta: np.ndarray) -> None:
        """Starts as the laws of a vector of numbers have them, and what each changes there."""
        self._settle(theta)
        known = self.evaluation.starts
        better = reopened(self.runs, known, lambda starts: self._left(theta, starts),
                          lambda starts: self._tangents(theta, starts))  # fmt: skip
        if better is not None:
            self.evaluation.starts = better
            self._settle(theta)
        for i, part in self._tangents(theta, self.evaluation.starts).items():
            if np.all(np.abs(part) < 1e100):
                self.bases[i] = self.runs[i].bases(part)

    def project(self, table: np.ndarray, which: Sequence[int]) -> None:
        """Take off rows (k, rows) of some runs what their windows' starts can make, in place."""
        at = 0
        for i in which:
            part = slice(at, at + self.evaluation.measured.rows[i].count)
            for rows, q in self.bases.get(i, ()):
                where = np.arange(part.start, part.stop)[rows]
                table[:, where] -= (table[:, where] @ q) @ q.T
            at = part.stop

    def _settle(self, theta) -> None:
        """Steps of Gauss and Newton of the starts, as long as they gain."""
        for _ in range(START_STEPS):
            if not self._step(theta):
                break

    def _step(self, theta) -> bool:
        """Move the starts by one step of Gauss and Newton; False where next to nothing is gained.

        A window whose squares grow by it takes a part of the step, or keeps its start.
        """
        runs, known = self.runs, self.evaluation.starts
        tangents, first = self._tangents(theta, known), self._left(theta, known)
        least = {i: r.squares(first[i]) for i, r in runs.items()}
        steps = {
            i: r.better_starts(known[i], tangents[i], first[i]) - known[i] for i, r in runs.items()
            if np.all(np.abs(tangents[i]) < 1e100) and np.all(np.abs(first[i]) < 1e100)
        }  # fmt: skip
        best, total = {i: x.copy() for i, x in known.items()}, sum(x.sum() for x in least.values())
        for part in START_PARTS:
            tried = known | {i: known[i] + part * step for i, step in steps.items()}
            left = self._left(theta, tried)
            for i in steps:
                squares = runs[i].squares(left[i])
                better = squares < least[i]
                best[i][better] = tried[i][better]
                least[i] = np.minimum(squares, least[i])
        self.evaluation.starts = best
        return sum(x.sum() for x in least.values()) < (1 - START_GAIN) * total

    def _left(self, theta, starts: ByRun) -> ByRun:
        """By run what its rows (rows,) are at a vector of numbers and some starts."""
        return self._by_run(self.evaluation.values(theta[None], list(self.runs), starts)[0])

    def _tangents(self, theta, starts: ByRun) -> ByRun:
        """By run what each number (numbers, rows) of its windows' starts and pasts changes."""
        numbers = self.evaluation.numbers
        placed = numbers.build(theta, numbers.active(theta[None]))[1]
        states = len(numbers.machine.start({"position": (0.0, 0.0)}))
        free = np.array([True] * states + list(matters([one.law for one in placed])))
        ways = np.eye(len(free))[free]
        rows = self.evaluation.start_tangents(theta, ways, list(self.runs), starts)
        return self._by_run(ways.T @ rows)

    def _by_run(self, rows: np.ndarray) -> ByRun:
        """Rows (..., rows) by run."""
        parts = self.evaluation.measured.parted(rows, list(self.runs))
        return dict(zip(self.runs, parts, strict=True))
