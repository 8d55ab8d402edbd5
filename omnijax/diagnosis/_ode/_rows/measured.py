"""What is measured: the runs of a machine, their rows by one criterion, and what each is for."""

from collections.abc import Callable, Sequence

import numpy as np

from ..._settings import SETTINGS
from .rows import Balance, FreeRun, OdeRun

RANKING_RUNS = SETTINGS.free_model.ranking_runs

Rows = Balance | FreeRun


class Measured:
    """Runs with their rows, which `criterion` gives of each, and the runs of every split.

    `ranking` are the first of train's rows, by which laws are ranked at finite strength.
    """

    def __init__(self, runs: Sequence[OdeRun], criterion: Callable[[OdeRun], Rows]):
        self.runs = list(runs)
        self.rows: list[Rows] = [criterion(run) for run in self.runs]
        self.splits = _splits(self.runs)
        self.free_runs = {i: r for i, r in enumerate(self.rows) if isinstance(r, FreeRun)}

    def count(self, split: str) -> int:
        """Rows of a split."""
        return sum(self.rows[i].count for i in self.splits[split])

    def of(self, split: str) -> list[OdeRun]:
        """Runs of a split."""
        return [self.runs[i] for i in self.splits[split]]

    def parted(self, table: np.ndarray, which: Sequence[int]) -> list[np.ndarray]:
        """A table (..., rows) of some runs, one run after the other."""
        ends = np.cumsum([self.rows[i].count for i in which])[:-1]
        return np.split(table, ends, axis=-1)

    @property
    def travel(self) -> float:
        """Length of all places that the train runs pass, each counted once, rad or m.

        What lies between logs that were zeroed at different places is none.
        """
        ranges = sorted(
            (float(np.min(run.outputs["position"])), float(np.max(run.outputs["position"])))
            for run in self.of("train")
        )
        length, reached = 0.0, -np.inf
        for low, high in ranges:
            length += max(0.0, high - max(low, reached))
            reached = max(reached, high)
        return length

    @property
    def resolution(self) -> float:
        """Orders that the travel of the train runs tells apart: 2 pi over it, 1/rad or 1/m."""
        return 2 * np.pi / (self.travel or 1.0)


def _splits(runs: Sequence[OdeRun]) -> dict[str, list[int]]:
    """Runs by split."""
    train, held_out = (
        [i for i, run in enumerate(runs) if run.role == role] for role in ("train", "held-out")
    )
    apart = max(1, len(train) // RANKING_RUNS)
    ordered = [i for k in range(apart) for i in train[k::apart]]
    return {"train": ordered, "held-out": held_out, "ranking": train[::apart]}
