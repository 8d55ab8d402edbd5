"""The metric of machines with parts off by drawn amounts, in chunks that a store may keep."""

from collections.abc import Callable

import numpy as np
from jaxtyping import Array

from .._batches import batches
from .._study_folder import Folder, Report

CHUNK = 64  # machines at a time


class Machines:
    """A metric of the parts' relative deviations (p,), its slopes, and its values when drawn."""

    def __init__(
        self,
        several: Callable[[np.ndarray], Array | np.ndarray],  # deviations (n, p) -> metric (n,)
        slope: Callable[[int], tuple],  # of a part: the nominal metric, its derivative
        parts: int,
        draws: int,
        store: Folder | None = None,
        report: Report | None = None,
    ):
        self.parts, self.draws, self.store, self.report = parts, draws, store, report
        self._slope, self._many = slope, several
        self._done, self._begun, self._sets = 0, 0, 1

    def slopes(self) -> tuple[float, np.ndarray]:
        """The metric of nominal parts, and its slopes (p,)."""
        pairs = []
        for i in range(self.parts):
            pairs.append(self._kept(f"slope-{i}", lambda i=i: self._slope(i)))
            self._tell(1)
        return float(pairs[0][0]), np.array([float(slope) for _, slope in pairs])

    def metric(self, width: np.ndarray, seed: int, key: str, left: int) -> np.ndarray:
        """The metric (draws,) of machines drawn within +-`width`; not finite where a run fails.

        At least `left` more sets will be asked for.
        """
        drawn = width * np.random.default_rng(seed).uniform(-1, 1, (self.draws, self.parts))
        self._begun, chunks = self._begun + 1, []
        self._sets = self._begun + left
        for first, rows, count in batches(drawn, CHUNK):
            (values,) = self._kept(
                f"{key}-{first}", lambda rows=rows, count=count: (self._many(rows)[:count],)
            )
            chunks.append(values)
            self._tell(count)
        return np.concatenate(chunks)

    def _kept(self, key: str, compute: Callable[[], tuple]) -> list[np.ndarray]:
        """What `compute` gives, from the store where it is there."""
        stored = None if self.store is None else self.store.read(key)
        if stored is None:
            stored = {str(i): np.asarray(x) for i, x in enumerate(compute())}
            if self.store is not None:
                self.store.write(key, stored)
        return [stored[str(i)] for i in range(len(stored))]

    def _tell(self, more: int) -> None:
        """Runs done, and how many there are at least: nobody knows how often widths shrink."""
        self._done += more
        if self.report is not None:
            self.report(self._done, self.parts + self._sets * self.draws)
