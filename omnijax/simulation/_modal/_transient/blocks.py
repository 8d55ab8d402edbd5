"""Blocks of samples of many designs: what forces them and what their samples are; batch last.

Between edges a mode is a free part, which only decays, and the sinusoids' part; at an edge the free
part jumps by the difference of the sinusoids' parts.
"""

from collections.abc import Sequence
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._poles import PolePairs
from ..arithmetic import (
    Pair,
    materialised,
    onward,
    pair_exp,
    plus,
    powers,
    product,
    rows,
    sincos,
    stored,
    summed,
    turned,
)
from ..resonance import Resonance, by_pole, resonance
from ..signals import Signals
from ..system import Layout
from .edges import Edges, at_piece, at_start, edges_of, jumps, of_sinusoids

LENGTH = 32  # samples a block at most
LOADS = 210  # rows that a loop over designs reads at most: those of 240 were left without vectors


class FreePart(NamedTuple):
    """What the free part of the pairs is made of."""

    jump: Pair  # (g, k, p, c), at the begin of each piece
    start: Pair  # (p, c)


class ForcedPart(NamedTuple):
    """Sinusoids' parts by piece, and the free part with its jumps where pieces begin."""

    cosine: Float[Array, "o v k c"]
    sine: Float[Array, "o v k c"]
    free: FreePart


def forced(m: PolePairs, signals: Signals, direct, slope, layout: Layout) -> ForcedPart:
    """What does not change during a run; `direct`, `slope` (l, o, c): outputs of rho, drho/dt."""
    columns = layout.column_of
    edges, rate = edges_of(signals, layout), signals.rate[:, None]  # (v, 1, c)
    r = resonance(m, rate, m.given(columns))
    level, turn = (
        jnp.swapaxes(rows(x, columns), 0, 1) - shown(m, z)
        for x, z in zip((direct, slope), r, strict=True)
    )
    level, turn = level[:, :, None], (rate[:, 0] * turn)[:, :, None]  # (o, v, 1, c)
    free = _lags(r, edges, layout)
    free = free._replace(start=plus((m.b0[-1], m.b1[-1]), free.start))
    return ForcedPart(*turned(signals.cosine, signals.sine, level, turn), free)


def _lags(r: Resonance, edges: Edges, layout: Layout) -> FreePart:
    """What does not follow the sinusoids where they jump and where they start."""
    first, second = (summed(x) for x in at_start(r, edges))
    return FreePart(jumps(r, edges, layout), (first, second))


def free_rates(m: PolePairs, signals: Signals, layout: Layout) -> FreePart:
    """Derivatives by the poles of the free part of `forced`, of what moves them unchanged."""
    by, b = by_pole(m.kind, resonance(m, signals.rate[:, None])), m.given(layout.column_of)
    r = Resonance(*(product(m.kind, b, x) for x in by))
    return _lags(r, edges_of(signals, layout), layout)


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


class Poles(NamedTuple):
    """Poles of pairs that differ (q, see `Layout.poles`)."""

    kind: Float[Array, "q c"]
    l0: Float[Array, "q c"]
    l1: Float[Array, "q c"]

    def exp(self, time) -> Pair:
        """exp(lambda time), (..., q, c); `time` (..., 1, c)."""
        shape = (*time.shape[:-2], *self.kind.shape)
        time, kind, l0, l1 = (jnp.broadcast_to(x, shape) for x in (time, *self))
        return pair_exp(kind, (l0 * time, l1 * time))

    def stored_exp(self, time) -> Pair:
        """`exp`, stored by XLA."""
        return stored(lambda time, poles: poles.exp(time), time, self)


def poles_of(m: PolePairs, layout: Layout) -> Poles:
    """The poles that differ."""
    return Poles(*(rows(x, layout.poles) for x in (m.kind, m.l0, m.l1)))


def pole_exp(m: PolePairs, layout: Layout, time) -> Pair:
    """exp(lambda time) of every pair, (..., p, c), stored; `time` (..., 1, c).

    Pairs of equal poles share theirs.
    """
    E = poles_of(m, layout).stored_exp(time)
    return rows(E[0], layout.pole, -2), rows(E[1], layout.pole, -2)


def tables(poles: Poles, rate, step) -> BlockTables:
    """exp and sinusoids at 0, step, ..."""
    time = jnp.broadcast_to(step, (1, poles.kind.shape[1]))
    E = poles.stored_exp(time)
    s, c = stored(sincos, rate * step)
    turns = powers(jnp.ones_like(rate), (c, s), LENGTH)
    return BlockTables(*powers(poles.kind, E, LENGTH), *turns)


def parts_of(t: BlockTables, together: int) -> list[tuple[np.ndarray, BlockTables]]:
    """A block's tables part by part, with the numbers (k, 1) of the samples of each."""
    number = np.arange(LENGTH)[:, None]
    parts = [slice(k, k + together) for k in range(0, LENGTH, together)]
    return [(number[part], BlockTables(*(x[part] for x in t))) for part in parts]


class Weights(NamedTuple):
    """What a block's samples are made of, part by part of some outputs (see `OutputParts`)."""

    w0: Float[Array, "a c"]  # of the tables of poles
    w1: Float[Array, "a c"]
    f0: Float[Array, "b c"]  # of the tables of sinusoids
    f1: Float[Array, "b c"]


class OutputParts(NamedTuple):
    """What some outputs show: their parts (a) of pairs and (b) of sinusoids, output by output."""

    live: tuple[tuple[int, ...], ...]  # pairs that each output shows
    waves: tuple[tuple[int, ...], ...]  # sinusoids that each output shows
    kind: Float[Array, "a c"]
    c0: Float[Array, "a c"]
    c1: Float[Array, "a c"]
    cosine: Float[Array, "b k c"]
    sine: Float[Array, "b k c"]

    def weights(self, free: Pair, piece, turn, layout: Layout) -> Weights:
        """Weights in the block that begins with these free parts and pieces.

        `turn` (v, c): exp(i angle) of the sinusoids there.
        """
        pairs, waves = (_flat(x) for x in (self.live, self.waves))
        z = rows(free[0], pairs), rows(free[1], pairs)
        w0, w1 = onward(self.kind, (self.c0, self.c1), z)
        here = of_sinusoids(piece, layout.signal_of[waves], jnp.zeros(self.kind.shape[1:]))
        fa, fb = (at_piece(x, here) for x in (self.cosine, self.sine))
        turn = rows(turn, waves)
        return Weights(w0, w1, *turned(fa, fb, turn.real, turn.imag))

    def samples(self, w: Weights, t: BlockTables, layout: Layout, like: int, i=None) -> Array:
        """Output number `i`, traced or not, at the samples of the tables, (k, c).

        It shows the pairs and sinusoids that the output `like` shows, as all between the two do;
        without `i` it is that one.
        """
        away = 0 if i is None else i - like
        parts = (
            (self.live, (w.w0, w.w1), (t.T0, t.T1), layout.pole),
            (self.waves, (w.f0, w.f1), (t.cosine, t.sine), range(t.cosine.shape[1])),
        )
        x = jnp.zeros_like(t.cosine[:, 0])
        for shown, (a, b), (p, q), column in parts:
            first = sum(map(len, shown[:like])) + away * len(shown[like])
            for j, number in enumerate(shown[like]):
                at = column[number]
                x = x + a[first + j] * p[:, at] + b[first + j] * q[:, at]
        return x

    def together(self, outputs: Sequence[int], layout: Layout) -> int:
        """Samples that one loop over designs works out beside each other, for these outputs."""
        shown = [(self.live[o], self.waves[o]) for o in outputs]
        own = sum(len(pairs) + len(waves) for pairs, waves in shown)
        poles = {layout.pole[p] for pairs, _ in shown for p in pairs}
        sinusoids = {v for _, waves in shown for v in waves}
        read = len(poles) + len(sinusoids)  # rows of cosines or real parts, and as many others
        many = layout.together
        while 2 * (own + read * LENGTH // many) > LOADS and many < LENGTH:
            many *= 2
        return many


def shown_by(outputs: range, m: PolePairs, parts: ForcedPart, layout: Layout) -> OutputParts:
    """What these outputs show."""
    live, waves = (tuple(x[o] for o in outputs) for x in (layout.live, layout.waves))
    pair, wave = (
        np.array([(o, x) for o, part in zip(outputs, shown, strict=True) for x in part], int)
        .reshape(-1, 2).T
        for shown in (live, waves)
    )  # fmt: skip
    return OutputParts(
        live, waves, m.kind[pair[1]], m.c0[*pair], m.c1[*pair],
        parts.cosine[*wave], parts.sine[*wave],
    )  # fmt: skip


def _flat(shown: tuple[tuple[int, ...], ...]) -> list[int]:
    return [x for part in shown for x in part]
