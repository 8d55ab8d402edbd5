"""Lengths of runs: padded so that another length is no other program, cut, and joined again."""

import dataclasses
from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np

from .._arrays import on_device
from ._trajectory import Trajectory


def room(length: int) -> int:
    """The padded length: a power of two from 64."""
    return max(64, 1 << (length - 1).bit_length())


def padded(ts, length: int) -> jax.Array:
    """The times with the last one repeated up to `length`."""
    return on_device(np.pad(ts, (0, length - len(ts)), mode="edge"))


def samples_of(run: Trajectory, begin: int, end: int) -> Trajectory:
    """Samples `begin` to `end` of a run."""
    cut = {name: on_device(np.asarray(x)[begin:end]) for name, x in _channels(run).items()}
    return dataclasses.replace(run, **cut)


def joined(runs: Sequence[Trajectory]) -> Trajectory:
    """Runs one after the other as one, which ends as the last one does."""
    parts = [_channels(run) for run in runs]
    whole = {name: jnp.concatenate([part[name] for part in parts]) for name in parts[0]}
    steps = jnp.asarray(sum(int(run.steps) for run in runs))
    return dataclasses.replace(runs[-1], **whole, steps=steps)


def _channels(run: Trajectory) -> dict[str, jax.Array]:
    return {name: getattr(run, name) for name in Trajectory.UNITS}
