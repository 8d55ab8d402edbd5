"""Laws evaluated over long arrays: one compiled call a law class."""

from collections.abc import Callable
from typing import Any, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

Signal = TypeVar("Signal")


def packed(kind: Callable[..., Signal], *values: np.ndarray) -> Signal:
    """A port's signal of NumPy arrays (t, ...) instead of one moment's JAX arrays."""
    return kind(*values)


@eqx.filter_jit
def _over(law, signal):
    return jax.vmap(law)(signal)


@eqx.filter_jit
def _over_with_state(law, signal, state):
    return jax.vmap(law)(signal, state)


def along(law, signal: Any, state=None) -> Any:
    """`law` at every entry of `signal` (leading axis), as NumPy arrays."""
    signal = jax.tree.map(jnp.asarray, signal)
    out = _over(law, signal) if state is None else _over_with_state(law, signal, state)
    return jax.tree.map(np.asarray, out)
