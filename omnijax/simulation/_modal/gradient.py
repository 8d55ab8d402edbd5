"""Gradients of figures by divided differences: no derivative of an eigenvector.

The response x_o = sum_l c_o^T phi_l(A) b_l is linear in functions phi_l that are analytic in the
poles.  A figure whose derivative by x_o(t) is g_o(t) therefore changes by

    sum_ol sum_ij c_oi (V^-1 dA V)_ij b_jl Psi_ol[l_i, l_j]

with Psi_ol(z) = sum_t g_o(t) phi_l(z, t) and the divided difference

    Psi[x, y] = (Psi(x) - Psi(y))/(x - y),    Psi' where the poles are as good as equal,

finite for any basis of a degenerate space.  Where vectors come together with their poles, those
divided differences cancel against each other: such designs are asked at points beside them (see
`coincidence`).  As Psi is taken at the pole of c or at that of b, it is
only asked for as outputs show it, sum_o c_o Psi_ol, and as inputs give it, sum_l b_l Psi_ol.  Here
are both and their derivatives at every pair, and the figure's derivatives by what the signals are
made of; `pull_back` goes on to the matrices.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ._poles import Eigen, unpacked, unpacked_inverse
from .arithmetic import Pair, stored, summed
from .lanes import Lanes
from .signals import Signals
from .system import Layout, System


class Slopes(NamedTuple):
    """Derivatives of a square of a figure; batch last."""

    shown: Pair  # (s + 1, p, c): sum_o c_o Psi_os, the start last
    shown_rate: Pair  # the same of dPsi/dlambda
    given: Pair  # (o, p, c): sum_s b_s Psi_os
    given_rate: Pair
    signals: Signals
    direct: Float[Array, "s o c"]
    rate: Float[Array, "s o c"] | None = None  # none: nothing shows a signal's rate
    preload: Float[Array, "n c"] | None = None  # none: nothing is made of that
    friction: Float[Array, "n c"] | None = None


def seen(kind, c: Pair) -> Pair:
    """Pairs whose product with z has in its `total` the output c0 z0 + c1 z1."""
    return c[0], jnp.where(kind > 0, -c[1], c[1])


def half_root(square):
    """d sqrt(x)/dx, zero where nothing moves."""
    return jnp.where(square > 0, 0.5 / jnp.sqrt(jnp.where(square > 0, square, 1.0)), 0.0)


def pull_back(g: Lanes, pairs: Eigen, slopes: Slopes, layout: Layout, span) -> System:
    """Derivatives by the matrices from those by poles and residues; batch last, `pairs` too."""
    total = len(g.direct)
    columns = np.array(layout.columns)
    place = np.append(columns, total)  # the start comes last
    value = pairs.value.real, pairs.value.imag
    V = unpacked(pairs.vector, value[1])  # (m, k, c)
    back = _swapped(unpacked_inverse(jnp.swapaxes(pairs.inverse, 0, 1), value[1]))  # (k, m, c)
    c = unpacked(pairs.output[: layout.rows], value[1])  # (o, k, c)
    b = unpacked_inverse(jnp.swapaxes(pairs.input, 0, 1), value[1])  # (l, k, c)
    shown, given = _by_column(pairs, slopes.shown, place), _of_each(pairs, slopes.given)

    def across(shown: Pair, given: Pair) -> tuple[Pair, Pair]:
        """Sums over o and l of c_oi Psi_ol(l_i) b_jl and of c_oi Psi_ol(l_j) b_jl, all i, j."""
        first = _dot(_with_axis(shown, 2), _with_axis(b, 1), 0)
        return first, _dot(_with_axis(c, 2), _with_axis(given, 1), 0)

    left, right = across(shown, given)
    flat = across(_by_column(pairs, slopes.shown_rate, place), _of_each(pairs, slopes.given_rate))
    gap = value[0][:, None] - value[0], value[1][:, None] - value[1]
    size, damping = gap[0] * gap[0] + gap[1] * gap[1], jnp.abs(value[0])
    least = 1e-5 * (1 / span + jnp.maximum(damping[:, None], damping))
    near = size < least * least

    M = stored(_divided, left, right, *flat, gap, near)
    moved = _dot(_with_axis(M, 2), _with_axis(_swapped(V), 0), 1)  # (i, b, c)
    A = _real(_with_axis(back, 2), _with_axis(moved, 1), 0)
    inputs = _real(_with_axis(shown, 2), back, 1)  # (l, m, c)
    outputs = _real(_with_axis(given, 2), _swapped(V), 1)
    room = ((0, len(g.modes.c0) - layout.rows), (0, 0), (0, 0))

    def straight(x) -> Array:  # (l, o, c)
        return jnp.pad(jax.ops.segment_sum(x, columns, total), ((0, 0), *room[:1], (0, 0)))

    rate = jnp.zeros_like(g.slope) if slopes.rate is None else straight(slopes.rate)
    return System(
        A, inputs[:total], jnp.pad(outputs, room), straight(slopes.direct), rate, inputs[total]
    )


def _of_each(pairs: Eigen, pair: Pair) -> Pair:
    """Products (..., p, c) with pairs of eigenvalues as those (..., k, c) with each of them."""
    first, second = pair
    kind, ones = pairs.kind, (pairs.first, pairs.second)
    one = first, jnp.where(kind, second, 0.0)
    two = jnp.where(kind, first, second), jnp.where(kind, -second, 0.0)
    real, imaginary = (
        summed(x[:, :, None] * ones[0] + y[:, :, None] * ones[1], 1)
        for x, y in zip(one, two, strict=True)
    )
    return real, imaginary


def _by_column(pairs: Eigen, pair: Pair, place: np.ndarray) -> Pair:
    """(l, k, c) of what signals (s, p, c) show, by their columns `place`.

    An output shows a pair twice.
    """
    share = jnp.where(pairs.kind, 0.5, 1.0)
    count = int(place[-1]) + 1
    first, second = (share * jax.ops.segment_sum(x, place, count) for x in pair)
    return _of_each(pairs, (first, second))


def _divided(left: Pair, right: Pair, first: Pair, second: Pair, gap: Pair, near) -> Pair:
    """Divided differences (left - right)/gap; where poles are `near`, the mean of the slopes."""
    difference = left[0] - right[0], left[1] - right[1]
    turned = _times(difference, (gap[0], -gap[1]))
    square = jnp.where(near, 1.0, gap[0] * gap[0] + gap[1] * gap[1])
    real, imaginary = (
        jnp.where(near, 0.5 * (x + y), z / square)
        for x, y, z in zip(first, second, turned, strict=True)
    )
    return real, imaginary


def _with_axis(a: Pair, axis: int) -> Pair:
    return jnp.expand_dims(a[0], axis), jnp.expand_dims(a[1], axis)


def _swapped(a: Pair) -> Pair:
    return jnp.swapaxes(a[0], 0, 1), jnp.swapaxes(a[1], 0, 1)


def _times(a: Pair, b: Pair) -> Pair:
    """Product of complex numbers."""
    return a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]


def _dot(a: Pair, b: Pair, axis: int) -> Pair:
    """Sum of a b over an axis, stored."""

    def terms(a0, a1, b0, b1) -> Pair:
        real, imaginary = (summed(x, axis) for x in _times((a0, a1), (b0, b1)))
        return real, imaginary

    return stored(terms, *a, *b)


def _real(a: Pair, b: Pair, axis: int) -> Array:
    """Real part of the same."""
    return summed(a[0] * b[0] - a[1] * b[1], axis)
