"""Numbers onto the device; extremes whose slopes stand in every program."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from . import _config as _config


def on_device(values: Any) -> jax.Array:
    """A copy of known `values` as floats; `jnp.asarray` compiles a program for every shape."""
    return jax.device_put(np.array(values, float))


def largest(values: Float[Array, "*shape"], axis: int | None = None) -> Float[Array, "..."]:
    """The largest entry (along an axis), with the slope of one that is largest.

    The slope of `jnp.max` asks which entries equal the maximum.  A program may work entries and
    maximum out twice, rounded differently (with a fused multiply-add or without): none equals it
    then, and the slope is 0/0.
    """
    if axis is None:
        values, axis = values.ravel(), 0
    at = jnp.argmax(values, axis, keepdims=True)
    return jnp.squeeze(jnp.take_along_axis(values, at, axis), axis)


def smallest(values: Float[Array, "*shape"]) -> Float[Array, ""]:
    """The smallest entry, as `largest`."""
    return -largest(-values)
