"""Blocks of samples of many designs: what forces them and what their samples are; batch last.

Between edges a mode is a free part, which only decays, and the sinusoids' part; at an edge the free
part jumps by the difference of the sinusoids' parts.
"""

from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .arithmetic import Pair, flushed, materialised, pair_exp, product, quotient, sincos, stored
from .poles import PolePairs
from .signals import Signals
from .system import Layout

LENGTH = 32  # samples a block at most


def _stored_particular(m: PolePairs, b, rate, cosine, sine):
    """`particular`, stored."""

    def parts(kind, l0, l1, b0, b1, rate, cosine, sine):
        own = m._replace(kind=kind, l0=l0, l1=l1)
        a, s = particular(own, (b0, b1), rate, cosine, sine)
        return jax.lax.complex(*a), jax.lax.complex(*s)

    solution = materialised(parts, m.kind, m.l0, m.l1, *b, rate, cosine, sine)
    return [(x.real, x.imag) for x in solution]


class ForcedPart(NamedTuple):
    """Sinusoids' parts by piece, and the jumps of the free part where pieces begin."""

    cosine: Float[Array, "o v k c"]
    sine: Float[Array, "o v k c"]
    jump0: Float[Array, "g k p c"]
    jump1: Float[Array, "g k p c"]
    free0: Float[Array, "p c"]  # free part at the start
    free1: Float[Array, "p c"]


def particular(m: PolePairs, b, rate, cosine, sine):
    """z = (a cos + s sin)(rate t) of every pair, moved by b (cosine cos + sine sin)(rate t).

    a = -b (lambda cosine + rate sine)/(lambda^2 + rate^2),
    s = b (rate cosine - lambda sine)/(lambda^2 + rate^2).
    """
    pole = m.l0, m.l1
    square = product(m.kind, pole, pole)
    flat = jnp.where(m.kind > 0, 0.0, rate * rate)
    r = quotient(m.kind, b, (square[0] + rate * rate, square[1] + flat))
    turned = product(m.kind, r, pole)
    a = [-(x * cosine + y * rate * sine) for x, y in zip(turned, r, strict=True)]
    return a, [y * rate * cosine - x * sine for x, y in zip(turned, r, strict=True)]


def forced(m: PolePairs, signals: Signals, direct, slope, layout: Layout) -> ForcedPart:
    """What does not change during a run; `direct`, `slope` (l, o, c): outputs of rho, drho/dt."""
    pieces = max([kind.pieces for kind in layout.kinds])
    cosines, sines, jumps = [], [], []
    free = m.b0[-1], m.b1[-1]
    first, edged = 0, 0
    for kind in layout.kinds:
        v = slice(first, first + kind.waves)
        rate = signals.rate[v, None, None]  # (w, 1, 1, c)
        cosine, sine = signals.cosine[v, : kind.pieces, None], signals.sine[v, : kind.pieces, None]
        b = m.b0[kind.column], m.b1[kind.column]
        a, s = _stored_particular(m, b, rate, cosine, sine)  # (w, k, p, c)
        D, R = direct[kind.column][:, None, None], slope[kind.column][:, None, None]

        def shown(z):
            return _shown(m.c0, z[0]) + _shown(m.c1, z[1])

        cos_, sin_, nu = cosine[:, :, 0], sine[:, :, 0], rate[:, :, 0]
        room = ((0, 0), (0, 0), (0, pieces - kind.pieces), (0, 0))
        cosines.append(jnp.pad(shown(a) + D * cos_ + R * nu * sin_, room))
        sines.append(jnp.pad(shown(s) + D * sin_ - R * nu * cos_, room))
        if kind.pieces > 1:
            turn = signals.rate[v, None] * signals.duration[edged, None, : kind.pieces]
            sn, cs = stored(sincos, turn)  # (w, k, c)
            end = [jnp.sum(a[i] * cs[:, :, None] + s[i] * sn[:, :, None], 0) for i in (0, 1)]
            begin = [jnp.sum(a[i], 0) for i in (0, 1)]
            jump = [jnp.roll(e, 1, axis=0) - x for e, x in zip(end, begin, strict=True)]
            jumps.append([jnp.pad(x, ((0, pieces - kind.pieces), (0, 0), (0, 0))) for x in jump])
            sn, cs = stored(sincos, signals.rate[v] * signals.since[edged])
            now = [a[i] * cs[:, None, None] + s[i] * sn[:, None, None] for i in (0, 1)]
            here = jnp.arange(kind.pieces)[:, None] == signals.piece[edged]
            now = [jnp.sum(jnp.where(here[:, None], x, 0.0), axis=(0, 1)) for x in now]
            edged += 1
        else:
            now = [jnp.sum(a[i], axis=(0, 1)) for i in (0, 1)]
        free = free[0] - now[0], free[1] - now[1]
        first += kind.waves
    none = jnp.zeros((0, pieces, *m.l0.shape))
    j0, j1 = (jnp.stack([j[i] for j in jumps]) if jumps else none for i in (0, 1))
    return ForcedPart(jnp.concatenate(cosines, 1), jnp.concatenate(sines, 1), j0, j1, *free)


def _shown(c, z):
    """Sum over the pairs of c (o, p, c) times z (w, k, p, c), (o, w, k, c)."""
    return sum(c[:, p][:, None, None] * z[None, :, :, p] for p in range(c.shape[1]))


class BlockTables(NamedTuple):
    """Poles (q, see `Layout.poles`) and sinusoids over the samples of a block."""

    T0: Float[Array, "k q c"]
    T1: Float[Array, "k q c"]
    cosine: Float[Array, "k v c"]
    sine: Float[Array, "k v c"]


def rows(x, index: Sequence[int], axis: int = 0):
    """x[index] along an axis, without a copy where that is all of x in order."""
    x = jnp.moveaxis(x, axis, 0)
    if tuple(index) != tuple(range(len(x))):
        x = jnp.stack([x[i] for i in index]) if len(index) else x[:0]
    return jnp.moveaxis(x, 0, axis)


def pole_exp(m: PolePairs, layout: Layout, time) -> Pair:
    """exp(lambda time) of every pair, (..., p, c); `time` (..., 1, c).

    XLA stores it, and pairs of equal poles share theirs.
    """
    kind, l0, l1 = (rows(x, layout.poles) for x in (m.kind, m.l0, m.l1))
    time = jnp.broadcast_to(time, (*time.shape[:-2], *kind.shape))

    def exponential(time, kind, l0, l1):
        kind, l0, l1 = (jnp.broadcast_to(x, time.shape) for x in (kind, l0, l1))
        return pair_exp(kind, (l0 * time, l1 * time))

    E = stored(exponential, time, kind, l0, l1)
    return rows(E[0], layout.pole, -2), rows(E[1], layout.pole, -2)


def tables(m: PolePairs, layout: Layout, rate, step) -> BlockTables:
    """exp and sinusoids at 0, step, ..."""
    E = [rows(x, layout.poles) for x in pole_exp(m, layout, jnp.broadcast_to(step, (1, 1)))]
    kind = rows(m.kind, layout.poles)

    def on(row, _):
        return product(kind, row, E), row

    one = jnp.ones_like(kind), jnp.where(kind > 0, 0.0, 1.0)
    T0, T1 = (flushed(x) for x in jax.lax.scan(on, one, None, length=LENGTH)[1])
    s, c = sincos(rate * step)

    def turn(row, _):
        return (row[0] * c - row[1] * s, row[1] * c + row[0] * s), row

    begin = jnp.ones_like(rate), jnp.zeros_like(rate)
    return BlockTables(T0, T1, *jax.lax.scan(turn, begin, None, length=LENGTH)[1])


class Operands(NamedTuple):
    """What a block's samples are made of."""

    count: Float[Array, " c"]
    w0: Float[Array, "o p c"]
    w1: Float[Array, "o p c"]
    f0: Float[Array, "o v c"]
    f1: Float[Array, "o v c"]


def row_signal(op: Operands, t: BlockTables, layout: Layout, like: int, o=None) -> Array:
    """Output number `o`, traced or not, at the samples of a block, (k, c).

    It shows the pairs and sinusoids that the output `like` shows; without `o` it is that one.
    """
    w0, w1, f0, f1 = (x[like if o is None else o] for x in (op.w0, op.w1, op.f0, op.f1))
    x = jnp.zeros_like(t.cosine[:, 0])
    for p in layout.live[like]:
        q = layout.pole[p]
        x = x + w0[p] * t.T0[:, q] + w1[p] * t.T1[:, q]
    for v in layout.waves[like]:
        x = x + f0[v] * t.cosine[:, v] + f1[v] * t.sine[:, v]
    return x
