"""Rows of arrays by static numbers, without a gather: its transpose, a scatter, is slow on CPUs."""

import itertools
from collections.abc import Iterable

import jax
import jax.numpy as jnp
from jaxtyping import Array


def rows_of(x: Array, index: Iterable[int]) -> Array:
    """x[..., index, :] for numbers known ahead; repeated ones are broadcast."""
    index, axis = tuple(int(i) for i in index), x.ndim - 2
    if index == tuple(range(x.shape[axis])):
        return x
    parts = []
    for i, run in itertools.groupby(index):
        part = jax.lax.slice_in_dim(x, i, i + 1, axis=axis)
        shape = (*x.shape[:axis], len(list(run)), x.shape[-1])
        parts.append(jnp.broadcast_to(part, shape))
    return jnp.concatenate(parts, axis=axis)
