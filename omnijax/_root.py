"""The square root of what may be zero."""

import jax.numpy as jnp
from jaxtyping import Array, Float


def root(square: Float[Array, "*shape"]) -> Float[Array, "*shape"]:
    """Square root whose gradient at zero is zero: a round wheel does not vibrate."""
    positive = square > 0
    return jnp.where(positive, jnp.sqrt(jnp.where(positive, square, 1.0)), 0.0)
