"""A run at any time in closed form: what every passage of an edge so far has left.

With q = exp(lambda period) the n passages of an edge add up to (1 - q^n)/(1 - q).
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._poles import PolePairs
from ..arithmetic import (
    Pair,
    exp_less_one,
    materialised,
    pair_exp,
    product,
    quotient,
    rows,
    times,
)
from ..signals import Signals
from ..system import Layout
from .blocks import FreePart, poles_of
from .edges import edge_times

TURN = 2 * math.pi


class PassedEdges(NamedTuple):
    """Which edges signals have passed until a time."""

    many: Float[Array, "g k c"]  # passages of each edge
    period: Float[Array, "g c"]  # s
    ago: Float[Array, "g k c"]  # s, since the last of them; 0 without one
    piece: Float[Array, "g c"]  # the one that each signal is on
    begun: Float[Array, "g c"]  # s, when it began


def passages(signals: Signals, layout: Layout, time: Float[Array, " c"]) -> PassedEdges:
    """The passages until a time (s); batch last."""
    first, period = edge_times(signals)
    pieces = np.array([kind.pieces for kind in layout.kinds[: len(first)]])[:, None]
    own = (np.arange(first.shape[1]) < pieces)[:, :, None]  # others' pieces are more
    many = jnp.maximum(jnp.floor((time - first) / period[:, None]) + 1, 0.0)
    many = jnp.where(own, many, 0.0)
    last = first + (many - 1) * period[:, None]
    begun = jnp.max(jnp.where(many > 0, last, -signals.since[:, None]), axis=1)
    piece = jnp.mod(signals.piece + jnp.sum(many, axis=1), pieces)
    return PassedEdges(many, period, jnp.where(many > 0, time - last, 0.0), piece, begun)


def edge_sums(kind, pole: Pair, p: PassedEdges) -> Pair:
    """Sum of exp(lambda (t - t_e)) over the passages of every edge, (g, k, p, c)."""
    many, ago = p.many[:, :, None], p.ago[:, :, None]
    step = jnp.where(many > 0, p.period[:, None, None], 0.0)
    sums = repeated(kind, times(step, pole), jnp.maximum(many, 1.0))
    first, second = product(kind, sums, pair_exp(kind, times(ago, pole)))
    return jnp.where(many > 0, first, 0.0), jnp.where(many > 0, second, 0.0)


def of_edges(function: Callable, m: PolePairs, p: PassedEdges, layout: Layout) -> list[Pair]:
    """The pairs function(kind, l0, l1) of every edge and pair of poles (g, k, p, c), stored.

    Pairs of equal poles share theirs.
    """
    poles = poles_of(m, layout)
    wide = (*p.many.shape[:2], *poles.kind.shape)

    def stacked(*poles):
        return [jax.lax.complex(*pair) for pair in function(*poles)]

    each = materialised(stacked, *(jnp.broadcast_to(x, wide) for x in poles))
    each = [rows(x, layout.pole, -2) for x in each]
    return [(x.real, x.imag) for x in each]


def pole_edge_sums(m: PolePairs, p: PassedEdges, layout: Layout) -> Pair:
    """`edge_sums` of every pair of poles."""
    (sums,) = of_edges(lambda kind, *pole: [edge_sums(kind, pole, p)], m, p, layout)
    return sums


def left_of(kind, free: FreePart, edge: Pair, decay: Pair) -> Pair:
    """The free part (p, c) at a time, from the `edge_sums` until then and the poles' decay."""
    each, own = product(kind, free.jump, edge), product(kind, free.start, decay)
    return own[0] + jnp.sum(each[0], axis=(0, 1)), own[1] + jnp.sum(each[1], axis=(0, 1))


def repeated(kind, a: Pair, count) -> Pair:
    """1 + e^a + ... + e^((count - 1) a) for a whole `count` above 0."""
    k = kind > 0
    turns = jax.lax.stop_gradient(jnp.round(jnp.where(k, a[1], 0.0) / TURN))
    a = a[0], a[1] - TURN * turns
    size = jnp.where(k, jnp.abs(a[0]) + jnp.abs(a[1]), jnp.abs(a[0])) * count
    near = size < 1e-4, jnp.where(k, size < 1e-4, jnp.abs(a[1]) * count < 1e-4)
    safe = jnp.where(near[0], -1.0, a[0]), jnp.where(near[1], jnp.where(k, 0.0, -1.0), a[1])
    far = quotient(
        kind, exp_less_one(kind, (count * safe[0], count * safe[1])), exp_less_one(kind, safe)
    )
    one, square = (jnp.ones_like(a[0]), jnp.where(k, 0.0, 1.0)), product(kind, a, a)
    first, second = (count - 1) / 2, (count - 1) * (2 * count - 1) / 12
    series = [count * (o + first * x + second * y) for o, x, y in zip(one, a, square, strict=True)]
    return jnp.where(near[0], series[0], far[0]), jnp.where(near[1], series[1], far[1])
