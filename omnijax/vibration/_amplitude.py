"""Sizes of a vibration: RMS, peak, peak-to-peak, each with an exact gradient."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._arrays import largest, smallest
from .._cubic import cubic_peak
from .._root import root
from .._time_mean import time_mean


def norm(vectors: Float[Any, "t 3"]) -> Float[Array, " t"]:
    """Lengths; the gradient at zero length is zero, not NaN."""
    return root(jnp.sum(vectors**2, axis=-1))


def rms(t: Float[Array, " t"], values: Float[Array, "t c"]) -> Float[Array, ""]:
    """Root of the mean square length of the rows over the time `t`."""
    return root(time_mean(t, jnp.sum(values**2, axis=-1)))


def peak(
    t: Float[Array, " t"], values: Float[Array, "t c"], rates: Float[Array, "t c"] | None = None
) -> Float[Array, ""]:
    """Largest length of the rows, refined between samples where rates are given.

    |v|^2 is interpolated by the cubic that matches values and rates at both ends of the two
    intervals beside the largest sample.  The gradient is that at the peak's own time (envelope
    theorem), so one sample's derivative is all it needs.
    """
    square = jnp.sum(values**2, axis=-1)
    at = jnp.argmax(square)
    if rates is None:
        return root(square[at])
    slope = 2 * jnp.sum(values * rates, axis=-1)
    last = len(t) - 1
    sides = [_between(t, square, slope, jnp.clip(at + k, 0, last - 1)) for k in (-1, 0)]
    return root(jnp.maximum(square[at], jnp.maximum(*sides)))


def _between(t, square, slope, i):
    """Largest value of the Hermite cubic on [t_i, t_i+1] at its inner maximum."""
    h = t[i + 1] - t[i]
    y0, y1, d0, d1 = square[i], square[i + 1], h * slope[i], h * slope[i + 1]
    return cubic_peak(y0, y1, d0, d1)


def follows(t, values, rates) -> bool:
    """Whether samples follow a vibration: values change as their rates say, by the trapezoid.

    Half of the change is missed at 2.7 samples an oscillation.
    """
    t, values, rates = np.asarray(t), np.asarray(values), np.asarray(rates)
    change = np.diff(values, axis=0)
    missed = change - np.diff(t)[:, None] * (rates[1:] + rates[:-1]) / 2
    return bool(np.sum(missed**2) <= np.sum((0.5 * change) ** 2))


def smooth_peak(
    t: Float[Array, " t"], values: Float[Array, "t c"], sharpness: float = 64.0
) -> Float[Array, ""]:
    """p-norm of the lengths with p = `sharpness`: above the mean, below or at the peak, smooth."""
    square = jnp.sum(values**2, axis=-1)
    top = jax.lax.stop_gradient(jnp.max(square))
    moves = top != 0  # also where it is not finite, and the norm is not either
    scale = jnp.where(moves, top, 1.0)
    mean = time_mean(t, (square / scale) ** (sharpness / 2))
    return jnp.where(moves, jnp.sqrt(scale) * mean ** (1 / sharpness), 0.0)


def peak_to_peak(values: Float[Array, " t"]) -> Float[Array, ""]:
    """Largest less smallest value."""
    return largest(values) - smallest(values)
