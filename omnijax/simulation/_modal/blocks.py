"""Blocks of samples of many designs: what forces them and what their samples are; batch last.

Between edges a mode is a free part, which only decays, and the sinusoids' part; at an edge the free
part jumps by the difference of the sinusoids' parts.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from .arithmetic import (
    Pair,
    materialised,
    pair_exp,
    powers,
    rows,
    sincos,
    stored,
    summed,
    turned,
)
from .edges import at_start, edges_of, jumps
from .poles import PolePairs
from .resonance import resonance
from .signals import Signals
from .system import Layout

LENGTH = 32  # samples a block at most


class ForcedPart(NamedTuple):
    """Sinusoids' parts by piece, and the jumps of the free part where pieces begin."""

    cosine: Float[Array, "o v k c"]
    sine: Float[Array, "o v k c"]
    jump0: Float[Array, "g k p c"]
    jump1: Float[Array, "g k p c"]
    free0: Float[Array, "p c"]  # free part at the start
    free1: Float[Array, "p c"]


def forced(m: PolePairs, signals: Signals, direct, slope, layout: Layout) -> ForcedPart:
    """What does not change during a run; `direct`, `slope` (l, o, c): outputs of rho, drho/dt."""
    columns = [layout.kinds[i].column for i in layout.signal_of]
    edges, rate = edges_of(signals, layout), signals.rate[:, None]  # (v, 1, c)
    r = resonance(m, rate, (rows(m.b0, columns), rows(m.b1, columns)))
    level, turn = (
        jnp.swapaxes(rows(x, columns), 0, 1) - shown(m, z)
        for x, z in zip((direct, slope), r, strict=True)
    )
    level, turn = level[:, :, None], (rate[:, 0] * turn)[:, :, None]  # (o, v, 1, c)
    start = [b[-1] + summed(z) for b, z in zip((m.b0, m.b1), at_start(r, edges), strict=True)]
    return ForcedPart(
        *turned(signals.cosine, signals.sine, level, turn), *jumps(r, edges, layout), *start
    )


def stored_forced(m: PolePairs, signals: Signals, direct, slope, layout: Layout) -> ForcedPart:
    """`forced`, stored."""
    return materialised(
        lambda m, signals, direct, slope: forced(m, signals, direct, slope, layout),
        m, signals, direct, slope,
    )  # fmt: skip


def shown(m: PolePairs, z: Pair, outputs: int | None = None):
    """What the first outputs, or all, show of the pairs z (v, p, c): (o, v, c)."""
    each = zip(m.c0[:outputs], m.c1[:outputs], strict=True)
    return jnp.stack([summed(a * z[0] + b * z[1], 1) for a, b in each])


class BlockTables(NamedTuple):
    """Poles (q, see `Layout.poles`) and sinusoids over the samples of a block."""

    T0: Float[Array, "k q c"]
    T1: Float[Array, "k q c"]
    cosine: Float[Array, "k v c"]
    sine: Float[Array, "k v c"]


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
    s, c = stored(sincos, rate * step)
    turns = powers(jnp.ones_like(rate), (c, s), LENGTH)
    return BlockTables(*powers(rows(m.kind, layout.poles), (E[0], E[1]), LENGTH), *turns)


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
