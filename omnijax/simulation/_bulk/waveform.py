"""Shapes as the wheels pass them: levels and sinusoids piece by piece, for many designs at once.

On piece k of a wheel's period, t in [0, duration],

    rho = level + sum_w cosine cos(rate t) + sine sin(rate t)

`rollers` is no sinusoid, but sqrt(1 - q^2) with q = (r_b/R) sin a has a Fourier series in 2a whose
terms fall like (r_b/2R)^2k: a few of them reach rounding.
"""

import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...laws import (
    ContinuousSine,
    Gap,
    GatedSine,
    HalfSine,
    Pieces,
    Rollers,
    mirrored,
    padded,
    shape_pieces,
)
from ...rig import Rig
from .._exact import directed

NODES = 64  # of the sum that gives the series of `rollers`


class Waveform(NamedTuple):
    """One period of every wheel (j) in its direction of motion: pieces k, waves w."""

    duration: Float[Array, "k j *c"]  # s
    level: Float[Array, "k j *c"]  # m
    cosine: Float[Array, "k w j *c"]  # m
    sine: Float[Array, "k w j *c"]  # m
    rate: Float[Array, "k w j *c"]  # rad/s


def waves_needed(profile, ratio: float) -> int | None:
    """Waves a piece for a profile at the radius ratio r_b/R; None where it is no sum of waves."""
    if isinstance(profile, GatedSine | HalfSine | ContinuousSine):
        return 1
    if isinstance(profile, Rollers):
        return 1 + math.ceil(26 / -math.log(min(ratio, 0.99) ** 2 / 4))
    return None


def _rollers(gap: Gap, count: int) -> Pieces:
    """r_b (cos a - 1) + R (sqrt(1 - q^2) - 1), a = width v/2, down to mid-gap; mirrored; flat."""
    a = math.pi * np.arange(NODES) / NODES
    q = gap.wheel_radius / gap.sphere_radius * np.sin(a)
    sphere = -gap.sphere_radius * q * q / (1 + jnp.sqrt(1 - q * q))
    k = np.arange(count)
    series = np.cos(2 * k[:, None] * a) * np.where(k == 0, 1, 2)[:, None] / NODES @ sphere
    half, zero = gap.width / 2, jnp.zeros((1, count))
    falls = jnp.concatenate([gap.wheel_radius[None], series[1:]])[None]
    frequency = half * jnp.asarray(np.concatenate([[1.0], 2.0 * k[1:]]))[None]
    down = Pieces(half[None], (series[0] - gap.wheel_radius)[None, None], falls, zero, frequency)
    flat = Pieces((gap.pitch - gap.width)[None], jnp.zeros((1, 1)), zero, zero, 1 + zero)
    return jax.tree.map(lambda *xs: jnp.concatenate(xs), down, mirrored(down), flat)


def waveform(rig: Rig, speeds, angles, pieces: int, waves: int) -> Waveform:
    """The waveform of one design (no batch axis), padded to `pieces` and `waves`."""
    found = []
    for i, profile in enumerate(rig.profiles):
        gap = jax.tree.map(lambda x, i=i: x[i], rig.gaps)
        shape = _rollers(gap, waves) if isinstance(profile, Rollers) else shape_pieces(profile, gap)
        assert shape is not None and shape.polynomial.shape[1] == 1
        cycle = directed(padded(shape, pieces, 0, waves), speeds[i], angles[i])
        width, moving = cycle.pieces.width, cycle.pieces.width > 0
        per_time = jnp.where(moving, cycle.speed / jnp.where(moving, width, 1.0), 0.0)[:, None]
        silent = ~moving[:, None]
        found.append(
            Waveform(
                cycle.duration,
                cycle.pieces.polynomial[:, 0],
                jnp.where(silent, 0.0, cycle.pieces.cosine),
                jnp.where(silent, 0.0, cycle.pieces.sine),
                jnp.where(silent, 1.0, cycle.pieces.frequency * per_time),
            )
        )
    return jax.tree.map(lambda *xs: jnp.stack(xs, axis=-1), *found)
