"""Whole-body vibration after ISO 2631-1: a person sits in the sphere."""

import math

import jax.numpy as jnp
from jaxtyping import Array, Float

from .._root import root

# corner frequencies in Hz and quality factors of ISO 2631-1:1997, table A.1
_BAND = (0.4, 100.0)
_WEIGHTINGS = {
    "horizontal": {"transition": (2.0, 2.0, 0.63), "step": None},  # W_d
    "vertical": {"transition": (12.5, 12.5, 0.63), "step": (2.37, 0.91, 3.35, 0.91)},  # W_k
}


def weighting(frequency: Float[Array, " f"], direction: str) -> Float[Array, " f"]:
    """|W_d| (`horizontal`) or |W_k| (`vertical`) at `frequency` in Hz (ISO 2631-1, annex A)."""
    filters = _WEIGHTINGS[direction]
    s = 2j * math.pi * jnp.asarray(frequency)
    low, high = (2 * math.pi * f for f in _BAND)
    response = s**2 / (s**2 + math.sqrt(2) * low * s + low**2)
    response = response * high**2 / (s**2 + math.sqrt(2) * high * s + high**2)
    f3, f4, q4 = filters["transition"]
    w3, w4 = 2 * math.pi * f3, 2 * math.pi * f4
    response = response * (1 + s / w3) / (1 + s / (q4 * w4) + (s / w4) ** 2)
    if filters["step"] is not None:
        f5, q5, f6, q6 = filters["step"]
        w5, w6 = 2 * math.pi * f5, 2 * math.pi * f6
        ratio = (1 + s / (q5 * w5) + (s / w5) ** 2) / (1 + s / (q6 * w6) + (s / w6) ** 2)
        response = response * ratio * (w5 / w6) ** 2
    return jnp.abs(response)


def weighted_acceleration(
    t: Float[Array, " t"], acceleration: Float[Array, "t 3"], up: Float[Array, "3"]
) -> Float[Array, ""]:
    """Frequency-weighted RMS acceleration in m/s^2, all directions added (ISO 2631-1, 6.5).

    W_k along `up`, W_d across it; the samples must be uniform in time.  Factors k_x = k_y = k_z = 1
    (health and comfort of a seated person differ: multiply afterwards where needed).
    """
    vertical = (acceleration @ up)[:, None] * up
    frequency = jnp.fft.rfftfreq(len(t), 1.0) / (t[1] - t[0])
    total = 0.0
    for part, direction in ((vertical, "vertical"), (acceleration - vertical, "horizontal")):
        spectrum = jnp.fft.rfft(part, axis=0) / len(t)
        power = jnp.sum(jnp.abs(spectrum) ** 2, axis=1) * weighting(frequency, direction) ** 2
        double = jnp.where((jnp.arange(len(frequency)) == 0), 1.0, 2.0)
        if len(t) % 2 == 0:
            double = double.at[-1].set(1.0)
        total = total + jnp.sum(double * power)
    return root(total)
