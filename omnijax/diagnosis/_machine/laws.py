"""Laws evaluated over long arrays: one compiled call a law class."""

from collections.abc import Callable
from typing import Any, TypeVar

import equinox as eqx
import jax
import numpy as np

from ...laws import SensorSignal

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


def sensed(law, time: np.ndarray, values: np.ndarray) -> np.ndarray:
    """What a sensor's law adds to the `values` (t, c) of its group."""
    return np.asarray(_sensed(law, time, values))


@eqx.filter_jit
def _sensed(law, time, values):
    return law(SensorSignal(time, values))


def along(law, signal: Any, state=None) -> Any:
    """`law` at every entry of `signal` (leading axis), as NumPy arrays."""
    out = _over(law, signal) if state is None else _over_with_state(law, signal, state)
    return jax.tree.map(np.asarray, out)
