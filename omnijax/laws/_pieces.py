"""Wheel shapes as pieces: rho over one period as polynomials and sinusoids between its edges.

The exact paths need rho not at points but as formulas between edges.  On a piece of `width` rad,
with v in [0, 1] along it and x = 2v - 1,

    rho = sum_k polynomial[k] x^k + sum_j (cosine[j] cos + sine[j] sin)(frequency[j] v)

Widths may be zero (a gap of a round wheel), and every entry is differentiable in the geometry.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ._ports import AbstractShape
from ._shapes import ContinuousSine, Gap, GatedSine, HalfSine, Rollers, TableShape

ROLLER_DEGREE = 14  # of the part of `rollers` that is no sinusoid; its error is below 1e-12 depth


class Pieces(NamedTuple):
    """One period of a shape, pieces on the leading axis."""

    width: Float[Array, " k"]  # rad
    polynomial: Float[Array, "k d"]  # m, in powers of x = 2v - 1
    cosine: Float[Array, "k j"]  # m
    sine: Float[Array, "k j"]  # m
    frequency: Float[Array, "k j"]  # rad per piece


def _pieces(width, polynomial, cosine=None, sine=None, frequency=None) -> Pieces:
    width, polynomial = jnp.stack(width), jnp.stack([jnp.stack(p) for p in polynomial])
    none = jnp.zeros((len(width), 0))

    def column(values):
        return (
            none if values is None else jnp.stack([jnp.asarray(v, float) for v in values])[:, None]
        )

    return Pieces(width, polynomial, column(cosine), column(sine), column(frequency))


def _gated(gap: Gap, frequency: float) -> Pieces:
    """-depth sin(frequency v) in the gap, 0 on the roller."""
    zero = jnp.zeros(())
    return _pieces(
        [gap.width, gap.pitch - gap.width],
        [[zero], [zero]],
        [zero, zero],
        [-gap.depth, zero],
        [frequency, 1.0],
    )


def _continuous(gap: Gap) -> Pieces:
    zero = jnp.zeros(())
    width = jnp.where(gap.roundness > 0, gap.width, gap.pitch)
    return _pieces([width], [[zero]], [zero], [-gap.depth], [2 * math.pi])


def chebyshev_nodes(degree: int) -> np.ndarray:
    """The degree + 1 Chebyshev nodes of [-1, 1]."""
    return np.cos(math.pi * (np.arange(degree + 1) + 0.5) / (degree + 1))


def to_powers(degree: int) -> np.ndarray:
    """Values at the Chebyshev nodes -> coefficients of their interpolant in powers of x."""
    rows = np.polynomial.chebyshev.chebvander(chebyshev_nodes(degree), degree).T * 2 / (degree + 1)
    rows[0] /= 2
    powers = np.zeros((degree + 1, degree + 1))
    for k, one in enumerate(np.eye(degree + 1)):
        line = np.polynomial.chebyshev.cheb2poly(one)
        powers[: len(line), k] = line
    return powers @ rows


def _chebyshev_fit(function, degree: int) -> Float[Array, " d"]:
    """Coefficients in powers of x of the interpolant of `function` on [-1, 1]."""
    values = jax.vmap(function)(jnp.asarray(chebyshev_nodes(degree)))
    return jnp.asarray(to_powers(degree)) @ values


def _rollers(gap: Gap) -> Pieces:
    """r_b (cos a - 1) - R q^2/(1 + sqrt(1 - q^2)), q = (r_b/R) sin a, a = width v/2; mirrored."""

    def sphere_part(x):
        q = gap.wheel_radius / gap.sphere_radius * jnp.sin(gap.width / 4 * (1 + x))
        return -gap.sphere_radius * q * q / (1 + jnp.sqrt(1 - q * q))

    fall = _chebyshev_fit(sphere_part, ROLLER_DEGREE).at[0].add(-gap.wheel_radius)
    half, zero = gap.width / 2, jnp.zeros(())
    down = Pieces(
        half[None], fall[None], gap.wheel_radius[None, None], zero[None, None], half[None, None]
    )
    flat = Pieces(
        (gap.pitch - gap.width)[None],
        jnp.zeros_like(fall)[None],
        zero[None, None],
        zero[None, None],
        jnp.ones((1, 1)),
    )
    return jax.tree.map(lambda *xs: jnp.concatenate(xs), down, mirrored(down), flat)


def _table(shape: TableShape) -> Pieces:
    """The spline's cubics, from powers of (theta - knot) to powers of x."""
    width = jnp.diff(shape.knots)
    half = width[:, None] / 2
    shift = np.zeros((4, 4))  # ((1 + x))^p = sum_k binomial(p, k) x^k
    for p in range(4):
        shift[p, : p + 1] = [math.comb(p, k) for k in range(p + 1)]
    scaled = shape.coefficients * half ** jnp.arange(4)
    none = jnp.zeros((len(width), 0))
    return Pieces(width, scaled @ jnp.asarray(shift), none, none, none)


def shape_pieces(shape: AbstractShape, gap: Gap) -> Pieces | None:
    """One period of a wheel's profile; None where it has no such form (or moves the contact)."""
    return _FORMS[type(shape)](shape, gap) if has_pieces(shape) else None


_FORMS: dict[type[AbstractShape], Callable[[Any, Gap], Pieces]] = {
    GatedSine: lambda _, gap: _gated(gap, 2 * math.pi),
    HalfSine: lambda _, gap: _gated(gap, math.pi),
    ContinuousSine: lambda _, gap: _continuous(gap),
    Rollers: lambda _, gap: _rollers(gap),
    TableShape: lambda shape, _: _table(shape),
}


def has_pieces(shape: AbstractShape) -> bool:
    """Whether a profile has a closed form (and does not move the contact)."""
    return type(shape) in _FORMS


def mirrored(pieces: Pieces) -> Pieces:
    """The same shape for a wheel that turns backwards: order and direction reversed."""
    sign = jnp.asarray((-1.0) ** np.arange(pieces.polynomial.shape[1]))
    cos, sin = jnp.cos(pieces.frequency), jnp.sin(pieces.frequency)
    turned = Pieces(
        pieces.width,
        pieces.polynomial * sign,
        pieces.cosine * cos + pieces.sine * sin,
        pieces.cosine * sin - pieces.sine * cos,
        pieces.frequency,
    )
    return jax.tree.map(lambda x: x[::-1], turned)


def padded(pieces: Pieces, count: int, degree: int, waves: int) -> Pieces:
    """The same shape with pieces of no width, higher powers and silent waves added."""
    k, d = pieces.polynomial.shape
    more, higher, extra = count - k, degree + 1 - d, waves - pieces.sine.shape[1]
    wave = ((0, more), (0, extra))
    return Pieces(
        jnp.pad(pieces.width, (0, more)),
        jnp.pad(pieces.polynomial, ((0, more), (0, higher))),
        jnp.pad(pieces.cosine, wave),
        jnp.pad(pieces.sine, wave),
        jnp.pad(pieces.frequency, wave, constant_values=1.0),
    )


def piece_at(pieces: Pieces, angle: Float[Array, ""]) -> tuple[Array, Array]:
    """Index of the piece at `angle` in [0, period) and the place v in it."""
    ends = jnp.cumsum(pieces.width)
    index = jnp.sum(jax.lax.stop_gradient(ends <= angle))
    index = jnp.minimum(index, len(ends) - 1)
    width = pieces.width[index]
    into = angle - (ends[index] - width)
    return index, jnp.where(width > 0, into / jnp.where(width > 0, width, 1.0), 0.0)


def value(pieces: Pieces, index, v) -> Float[Array, ""]:
    """rho at place v of piece `index`, m."""
    polynomial = jnp.polyval(pieces.polynomial[index][::-1], 2 * v - 1)
    phase = pieces.frequency[index] * v
    waves = pieces.cosine[index] * jnp.cos(phase) + pieces.sine[index] * jnp.sin(phase)
    return polynomial + jnp.sum(waves)
