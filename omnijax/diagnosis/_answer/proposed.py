"""Runs that are proposed: how far rivals lie apart in one, and weaker where one runs away."""

import abc
import contextlib
import dataclasses
import itertools
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from .._orthonormal import orthonormal
from .._search import AbstractModel, Point, difference_rows, with_width
from .._settings import SETTINGS

HALVINGS = SETTINGS.experiment.halvings
APART = "chi-square between the closest two rivals, each refitted to the other's run"


def weaker(words: str, how: str) -> Iterator[tuple[str, float]]:
    """What a run is called, and the share of it that is made: the whole, a half, a quarter, ...

    `how` it is made so many times: `slower`, `smaller`.
    """
    yield words, 1.0
    for k in range(1, HALVINGS + 1):
        yield f"{words}, all {2**k} times {how}", 0.5**k


@dataclasses.dataclass(frozen=True)
class AbstractProposed(abc.ABC):
    """A run that was not made yet, as the diagnosis would see it."""

    model: AbstractModel

    @abc.abstractmethod
    def rows(self, points: Sequence[Point]) -> list[np.ndarray]:
        """Rows (rows,) of the run in sigma at each point."""

    def aside(self) -> contextlib.AbstractContextManager[Any]:
        """In which nothing of the run is kept."""
        return contextlib.nullcontext()

    def residuals(self, points: Sequence[Point], split: str) -> list[np.ndarray]:
        """Rows at each point, whatever the split: the run is one."""
        return self.rows(points)

    def separation(self, rivals: Sequence[Point]) -> float | None:
        """chi2 between the closest two, each refitted to the other's run.

        `None` where one of them runs away.
        """
        seen = [self._seen(p) for p in rivals]
        if not all(np.isfinite(part).all() for parts in seen for part in parts):
            return None
        return min(_margin(a, b) for a, b in itertools.permutations(seen, 2))

    def _seen(self, point: Point) -> tuple[np.ndarray, np.ndarray]:
        """Rows at a rival, and an orthonormal basis of what its own sizes change in them."""
        laws = self.model.laws
        point = point.with_effects(*(with_width(laws[e.id], e) for e in point.effects))
        (here,) = self.rows([point])
        if not np.isfinite(here).all():
            return here, here[:, None]
        free = self.model.free(point)
        with np.errstate(over="ignore", invalid="ignore"):  # a step may run away where it does not
            J = difference_rows(self, point, free, here, np.zeros((len(here), 0)))
        return here, orthonormal(J) if np.isfinite(J).all() else J


def _margin(true, rival) -> float:
    """chi2 by which `rival` misses the run of `true` after its own sizes are refitted."""
    left, basis = rival[0] - true[0], rival[1]
    left = left - basis @ (basis.T @ left)
    return float(left @ left)
