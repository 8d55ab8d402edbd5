"""Whole-body vibration after ISO 2631-1: a person sits in the sphere."""

import math
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Float

from .._errors import InputError
from .._root import root
from .._time_mean import off_even
from ..simulation import FilterPoles, LinearFilter

OFF = 0.05  # of a step, by which samples may lie off even times, as by the digits of a file
# corner frequencies in Hz and quality factors of ISO 2631-1:1997, table A.1
_BAND = (0.4, 100.0)
_WEIGHTINGS = {
    "horizontal": {"transition": (2.0, 2.0, 0.63), "step": None},  # W_d
    "vertical": {"transition": (12.5, 12.5, 0.63), "step": (2.37, 0.91, 3.35, 0.91)},  # W_k
}


UPRIGHT_WEIGHTINGS = ("vertical", "horizontal", "horizontal")  # up, and of two directions across


class Biquad(NamedTuple):
    """(b0 w^2 + b1 w s + b2 s^2) / (w^2 + w s/q + s^2)."""

    w: float  # rad/s
    q: float
    b: tuple[float, float, float]


def sections(direction: str) -> list[Biquad]:
    """W_d (`horizontal`) or W_k (`vertical`) as sections of second order (ISO 2631-1, annex A)."""
    filters = _WEIGHTINGS[direction]
    low, high = (2 * math.pi * f for f in _BAND)
    butterworth = math.sqrt(0.5)
    f3, f4, q4 = filters["transition"]
    out = [
        Biquad(low, butterworth, (0.0, 0.0, 1.0)),
        Biquad(high, butterworth, (1.0, 0.0, 0.0)),
        Biquad(2 * math.pi * f4, q4, (1.0, f4 / f3, 0.0)),
    ]
    if filters["step"] is not None:
        f5, q5, f6, q6 = filters["step"]
        ratio = f5 / f6
        out.append(Biquad(2 * math.pi * f6, q6, (ratio**2, ratio / q5, 1.0)))
    return out


def weighting(frequency: Float[Array, " f"], direction: str) -> Float[Array, " f"]:
    """|W_d| (`horizontal`) or |W_k| (`vertical`) at `frequency` in Hz (ISO 2631-1, annex A)."""
    s = 2j * math.pi * jnp.asarray(frequency)
    response = jnp.ones_like(s)
    for w, q, (b0, b1, b2) in sections(direction):
        response = response * (b0 * w**2 + b1 * w * s + b2 * s**2) / (w**2 + w * s / q + s**2)
    return jnp.abs(response)


def weighting_filter(direction: str) -> LinearFilter:
    """The filter of `weighting`: sections one behind the other, each with two states.

    dx1/dt = w x2, dx2/dt = w (u - x1) - w x2/q, y = b0 x1 + b1 x2 + b2 (u - x1 - x2/q).
    """
    parts = sections(direction)
    size = 2 * len(parts)
    F, b, c, d = np.zeros((size, size)), np.zeros(size), np.zeros(size), 1.0
    for i, (w, q, (b0, b1, b2)) in enumerate(parts):  # c, d: the input of this section
        first, second = 2 * i, 2 * i + 1
        F[first, second] = w
        F[second], b[second] = w * c, w * d
        F[second, first] -= w
        F[second, second] -= w / q
        c, d = b2 * c, b2 * d
        c[first] += b0 - b2
        c[second] += b1 - b2 / q
    return LinearFilter(jnp.asarray(F), jnp.asarray(b), jnp.asarray(c), d)


def upright_filters() -> FilterPoles:
    """The filters of `UPRIGHT_WEIGHTINGS` by their poles."""
    parts = [sections(way) for way in UPRIGHT_WEIGHTINGS]
    pole = {
        (w, q): w * complex(-0.5 / q, math.sqrt(1 - 0.25 / q**2))
        for own in parts
        for w, q, _ in own
    }

    def residue(own: list[Biquad], key: tuple[float, float], z: complex) -> complex:
        """Of H at its pole z: the other sections there, and what is left of its own."""
        total = 1.0 + 0.0j
        for w, q, (b0, b1, b2) in own:
            below = z * z + w * z / q + w * w if (w, q) != key else 2j * z.imag
            total *= (b0 * w**2 + b1 * w * z + b2 * z**2) / below
        return total if any((w, q) == key for w, q, _ in own) else 0.0j

    residues = [[residue(own, *item) for item in pole.items()] for own in parts]
    return FilterPoles(jnp.asarray([*pole.values()]), jnp.asarray(residues))


def check_even(t: Float[Array, " t"]) -> None:
    """`InputError` where known times of samples are not even."""
    if isinstance(t, Tracer):
        return
    times = np.asarray(t)
    if not off_even(times, np) <= OFF:
        steps = np.diff(times)
        raise InputError(
            "`sphere_weighted_acceleration` needs samples at even times, but the steps of this run "
            f"are from {steps.min():.4g} to {steps.max():.4g} s."
        )


def weighted_acceleration(
    t: Float[Array, " t"], acceleration: Float[Array, "t 3"], up: Float[Array, "3"]
) -> Float[Array, ""]:
    """Frequency-weighted RMS acceleration in m/s^2, all directions added (ISO 2631-1, 6.5).

    W_k along `up`, W_d across it.  Factors k_x = k_y = k_z = 1 (health and comfort of a seated
    person differ: multiply afterwards where needed).  The samples must be at even times: known ones
    that are not raise `InputError`, traced ones give NaN.
    """
    check_even(t)
    even = off_even(t) <= OFF
    vertical = (acceleration @ up)[:, None] * up
    frequency = jnp.fft.rfftfreq(len(t), 1.0) * (len(t) - 1) / (t[-1] - t[0])
    total = 0.0
    for part, direction in ((vertical, "vertical"), (acceleration - vertical, "horizontal")):
        spectrum = jnp.fft.rfft(part, axis=0) / len(t)
        power = jnp.sum(jnp.abs(spectrum) ** 2, axis=1) * weighting(frequency, direction) ** 2
        double = jnp.where((jnp.arange(len(frequency)) == 0), 1.0, 2.0)
        if len(t) % 2 == 0:
            double = double.at[-1].set(1.0)
        total = total + jnp.sum(double * power)
    return jnp.where(even, root(total), jnp.nan)
