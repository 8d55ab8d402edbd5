"""Lengths of runs: padded so that another length is no other program, cut, and joined again."""

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from .._arrays import on_device
from ._run import PER_WHEEL
from ._trajectory import Trajectory

EXACT_PIECE = 4096  # samples of a piece in closed form
STEPPED_PIECE = 500  # of one in steps


def room(length: int, parts: int = 1) -> int:
    """The padded length from 64: a power of two, or that in so many equal steps from the last."""
    whole = max(64, 1 << (length - 1).bit_length())
    step = max(whole // (2 * parts), 1)
    return max(64, -(-length // step) * step)


def padded(ts, length: int) -> jax.Array:
    """The times with the last one repeated up to `length`."""
    return on_device(np.pad(ts, (0, length - len(ts)), mode="edge"))


def samples_of(run: Trajectory, begin: int, end: int) -> Trajectory:
    """Samples `begin` to `end` of a run."""
    cut = {name: on_device(np.asarray(x)[begin:end]) for name, x in _channels(run).items()}
    return dataclasses.replace(run, **cut)


def bytes_a_sample(wheels: int) -> int:
    """What a sample of a run takes in memory and, about, in its file."""
    others = len(Trajectory.UNITS) - len(PER_WHEEL) - 2  # vectors, beside the time and the attitude
    return 8 * (1 + 4 + 3 * others + wheels * len(PER_WHEEL))


@dataclasses.dataclass(frozen=True)
class RunPiece:
    """Some samples of a run, and what it goes on from at the last of them."""

    run: Trajectory
    end: Any


class Gathered:
    """Pieces of a run as one: each channel lies once in memory."""

    def __init__(self, length: int):
        self.length = length  # the most samples
        self.count = 0
        self._columns: dict[str, np.ndarray] = {}
        self._about: dict[str, Any] = {}
        self._steps, self._status = 0, 0

    def add(self, run: Trajectory) -> None:
        """Append the samples of a piece."""
        end = self.count + len(run.t)
        for name, values in _channels(run).items():
            if name not in self._columns:
                self._columns[name] = np.empty((self.length, *values.shape[1:]))
            self._columns[name][self.count : end] = values
        self.count = end
        self._steps += int(run.steps)
        self._status = self._status or int(run.status)
        self._about = {"method": run.method, "names": run.names}

    def whole(self) -> Trajectory:
        """The run, which ends as the first piece that failed; asked for once."""
        names, columns = list(self._columns), self._columns
        whole = {name: on_device(columns.pop(name)[: self.count]) for name in names}
        status = jnp.asarray(self._status)
        return Trajectory(**whole, **self._about, status=status, steps=jnp.asarray(self._steps))


def _channels(run: Trajectory) -> dict[str, jax.Array]:
    return {name: getattr(run, name) for name in Trajectory.UNITS}
