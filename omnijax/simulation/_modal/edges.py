"""Edges of the signals' pieces: when they pass, and what a passage leaves of every pair."""

import jax.numpy as jnp
from jaxtyping import Array

from .arithmetic import sincos
from .blocks import particular
from .moment import Pair
from .poles import PolePairs
from .signals import Signals
from .system import Layout


def jumps(m: PolePairs, signals: Signals, layout: Layout) -> tuple[Pair, Pair]:
    """What edges leave (g, k, p, c) and begins take (s, p, c), for a unit of a signal's column."""
    one = jnp.ones_like(m.l0), jnp.where(m.kind > 0, 0.0, 1.0)
    jumps, begins, first = [], [], 0
    pieces = signals.duration.shape[1]
    for s, kind in enumerate(layout.kinds):
        v = slice(first, first + kind.waves)
        rate = signals.rate[v, None, None]
        cosine, sine = signals.cosine[v, : kind.pieces, None], signals.sine[v, : kind.pieces, None]
        unit = m._replace(b0=one[0][None], b1=one[1][None], c0=m.c0[:0], c1=m.c1[:0])
        a, b = particular(unit, one, rate, cosine, sine)  # (w, k, p, c)
        first += kind.waves
        if kind.pieces == 1:
            begins.append([jnp.sum(x, axis=(0, 1)) for x in a])
            continue
        sn, cs = sincos(signals.rate[v, None] * signals.duration[s, None, : kind.pieces])
        end = [
            jnp.sum(x * cs[:, :, None] + y * sn[:, :, None], 0) for x, y in zip(a, b, strict=True)
        ]
        jump = [jnp.roll(x, 1, axis=0) - jnp.sum(y, axis=0) for x, y in zip(end, a, strict=True)]
        jumps.append([jnp.pad(x, ((0, pieces - kind.pieces), (0, 0), (0, 0))) for x in jump])
        sn, cs = sincos(signals.rate[v] * signals.since[s])
        on = (jnp.arange(kind.pieces)[:, None] == signals.piece[s])[:, None]
        now = [x * cs[:, None, None] + y * sn[:, None, None] for x, y in zip(a, b, strict=True)]
        begins.append([jnp.sum(jnp.where(on, x, 0.0), axis=(0, 1)) for x in now])
    none = jnp.zeros((0, pieces, *m.l0.shape))
    first_, second = (jnp.stack([x[i] for x in jumps]) if jumps else none for i in (0, 1))
    begin = jnp.stack([x[0] for x in begins]), jnp.stack([x[1] for x in begins])
    return (first_, second), begin


def edge_times(signals: Signals) -> tuple[Array, Array]:
    """First passage of each edge (g, k, c) and the period (g, c), s."""
    offset = jnp.cumsum(signals.duration, axis=1) - signals.duration
    number = jnp.arange(signals.duration.shape[1])[:, None]
    first, period = signals.piece[:, None], jnp.sum(signals.duration, axis=1)
    begun = jnp.sum(jnp.where(number == first, offset, 0.0), axis=1) + signals.since
    later = jnp.where(number > first, 0.0, period[:, None])
    return offset - begun[:, None] + later, period
