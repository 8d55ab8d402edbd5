"""Design points by index: grids, lists, Latin hypercubes and Sobol points, never stored as rows."""

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from .._errors import InputError
from ._axes import SweepAxis

SAMPLERS = ("grid", "lhs", "sobol")
SOBOL_LIMIT = 2**32  # bits of the direction numbers


@dataclasses.dataclass(frozen=True)
class Grid:
    """Every combination of the axes' levels; the last axis runs fastest."""

    axes: tuple[SweepAxis, ...]

    @property
    def size(self) -> int:
        """Number of designs."""
        return math.prod(self.shape)

    def at(self, index) -> np.ndarray:
        """Parameter values (m, d) of the designs `index` (m,)."""
        levels = np.unravel_index(np.asarray(index), self.shape)
        columns = [axis.level(k) for axis, k in zip(self.axes, levels, strict=True)]
        return np.stack(columns, axis=-1)

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of levels of each axis."""
        return tuple(axis.count or 0 for axis in self.axes)


@dataclasses.dataclass(frozen=True)
class LatinHypercube:
    """`size` designs, one in each of `size` equal strata of every axis.

    The stratum of design i on axis j is a keyed permutation of i and the place within it a hash,
    so any design follows from (axes, size, seed, index) alone.
    """

    axes: tuple[SweepAxis, ...]
    size: int
    seed: int

    def at(self, index) -> np.ndarray:
        """Parameter values (m, d) of the designs `index` (m,)."""
        index = np.asarray(index, np.uint64)
        columns = []
        for j, axis in enumerate(self.axes):
            key = _hash(np.uint64(self.seed), np.uint64(2 * j + 1))
            stratum = _permute(index, self.size, key)
            inside = _hash(index, key + np.uint64(1)) / np.float64(2**64)
            columns.append(axis.quantile(np.minimum((stratum + inside) / self.size, 1 - 2**-53)))
        return np.stack(columns, axis=-1)


@dataclasses.dataclass(frozen=True)
class Sobol:
    """The first `size` points of a scrambled Sobol sequence (Owen's scrambling, seeded)."""

    axes: tuple[SweepAxis, ...]
    size: int
    seed: int
    _engine: list = dataclasses.field(default_factory=list, repr=False, compare=False)

    def at(self, index) -> np.ndarray:
        """Parameter values (m, d) of the designs `index` (m,), consecutive or not."""
        index = np.asarray(index)
        first, last = int(index.min()), int(index.max())
        unit = self._range(first, last + 1)[index - first]
        columns = [axis.quantile(unit[:, j]) for j, axis in enumerate(self.axes)]
        return np.stack(columns, axis=-1)

    def _range(self, first: int, stop: int) -> np.ndarray:
        """Points first ... stop - 1; the engine stays where it is for the next chunk."""
        import warnings

        from scipy.stats import qmc

        if not self._engine or self._engine[0].num_generated > first:
            engine = qmc.Sobol(len(self.axes), scramble=True, bits=32, rng=self.seed)
            self._engine[:] = [engine]
        engine = self._engine[0]
        with warnings.catch_warnings():  # any size is allowed; balance needs a power of 2
            warnings.simplefilter("ignore", UserWarning)
            if first > engine.num_generated:  # scipy takes 0 steps from the start for -1
                engine.fast_forward(first - engine.num_generated)
            return engine.random(stop - first)


PointSet = Grid | LatinHypercube | Sobol


def build_points(
    axes: Sequence[SweepAxis], sampler: str, samples: int | None, seed: int
) -> PointSet:
    """The point set that a sweep asks for; `InputError` where the request contradicts itself."""
    axes = tuple(axes)
    if sampler not in SAMPLERS:
        raise InputError(f"`sampler` must be one of {', '.join(SAMPLERS)}, but is {sampler!r}.")
    if not axes:
        raise InputError("a sweep needs at least one `vary`, as in wheel.roundness=0.1:0.6:50.")
    if sampler == "grid":
        return _grid(axes, samples)
    if samples is None or samples < 1:
        raise InputError(f"sampler {sampler} needs `samples`, a whole number above 0.")
    counted = [axis.path for axis in axes if axis.count is not None and axis.values is None]
    if counted:
        raise InputError(
            [
                f"`{p}` has a number of levels, but sampler {sampler} takes low:high."
                for p in counted
            ]
        )
    if sampler == "lhs":
        return LatinHypercube(axes, samples, seed)
    if samples > SOBOL_LIMIT:
        raise InputError(f"`samples` must lie in [1, {SOBOL_LIMIT}] for Sobol, but is {samples}.")
    return Sobol(axes, samples, seed)


def _grid(axes: tuple[SweepAxis, ...], samples: Any) -> Grid:
    if samples is not None:
        raise InputError("`samples` belongs to the samplers lhs and sobol; a grid's size follows.")
    open_ended = [axis.path for axis in axes if axis.count is None]
    if open_ended:
        raise InputError(
            [f"`{p}` needs a number of levels (low:high:count) on a grid." for p in open_ended]
        )
    return Grid(axes)


def _hash(value, key) -> np.ndarray | np.uint64:
    """A 64-bit hash (the finaliser of splitmix64) of `value` under `key`."""
    with np.errstate(over="ignore"):
        z = np.asarray(value, np.uint64) + np.uint64(0x9E3779B97F4A7C15) * (key + np.uint64(1))
        z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        return z ^ (z >> np.uint64(31))


def _permute(index, size: int, key) -> np.ndarray:
    """A keyed permutation of 0 ... size - 1: a Feistel network, walked until inside the range."""
    half = np.uint64(max(1, ((size - 1).bit_length() + 1) // 2))
    mask = np.uint64((1 << int(half)) - 1)

    def network(x):
        left, right = x >> half, x & mask
        for turn in range(6):
            left, right = right, left ^ (_hash(right, key + np.uint64(16 + turn)) & mask)
        return (left << half) | right

    result = network(np.array(index, np.uint64))
    outside = result >= size
    while outside.any():
        result[outside] = network(result[outside])
        outside = result >= size
    return result
