"""Edges of the signals' pieces: when they pass, and what jumps there."""

import itertools
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Shaped

from ..arithmetic import Pair, rows, sincos, stored, summed, turned
from ..resonance import Resonance
from ..signals import Signals
from ..system import Layout


class Edges(NamedTuple):
    """Levels and slopes (m, m/s) of the sinusoids: of those with edges (e), of all (v)."""

    jump: tuple[Array, Array]  # (e, k, c), at the begin of each piece
    now: tuple[Array, Array]  # (v, c), at the start


def edges_of(signals: Signals, layout: Layout) -> Edges:
    """What jumps at the begin of each piece, and where the sinusoids are at the start."""
    of, count = layout.signal_of, len(signals.duration)
    e = int(np.sum(of < count))
    rate, cosine, sine = signals.rate[:e, None], signals.cosine[:e], signals.sine[:e]
    end = _at(rate * rows(signals.duration, of[:e]), rate, cosine, sine)
    begin = cosine, rate * sine
    jump = [x - _before(y, layout) for x, y in zip(begin, end, strict=True)]
    piece = rows(signals.piece, of[:e])
    on = [at_piece(x, piece) for x in (cosine, sine)]
    now = _at(rate[:, 0] * rows(signals.since, of[:e]), rate[:, 0], *on)
    rest = signals.cosine[e:, 0], signals.rate[e:] * signals.sine[e:, 0]
    now = [jnp.concatenate(x) for x in zip(now, rest, strict=True)]
    return Edges((jump[0], jump[1]), (now[0], now[1]))


def _at(angle, rate, cosine, sine) -> Pair:
    """Level and slope of sinusoids."""
    s, c = stored(sincos, angle)
    level, slope = turned(cosine, sine, c, s)
    return level, rate * slope


def _before(x: Float[Array, "e k c"], layout: Layout):
    """The values of each sinusoid's piece before each of its pieces."""
    parts, first, most = [], 0, x.shape[1]
    edged = [kind for kind in layout.kinds if kind.pieces > 1]
    for pieces, same in itertools.groupby(edged, key=lambda kind: kind.pieces):
        after = first + sum(kind.waves for kind in same)
        own = jnp.roll(x[first:after, :pieces], 1, axis=1)
        parts.append(jnp.pad(own, ((0, 0), (0, most - pieces), (0, 0))))
        first = after
    return jnp.concatenate(parts) if parts else x


def jumps(r: Resonance, edges: Edges, layout: Layout) -> Pair:
    """What edges leave of every pair (g, k, p, c)."""
    level, slope = (x[:, :, None] for x in edges.jump)  # (e, k, 1, c)
    e = len(level)
    lag = Resonance(*((x[:e, None], y[:e, None]) for x, y in r)).lag(level, slope)
    first, second = (by_signal(x, layout.signal_of[:e]) for x in lag)
    return first, second


def at_start(r: Resonance, edges: Edges) -> Pair:
    """What of every pair does not move with the sinusoids at the start (v, p, c)."""
    return r.lag(*(x[:, None] for x in edges.now))


def by_signal(x: Float[Array, "v ..."], of: np.ndarray):
    """Sums of the rows of x over the sinusoids of each signal; `of` says whose each is."""
    ends = np.flatnonzero(np.diff(of, append=-1)) + 1
    sums = [summed(x[a:b]) for a, b in zip([0, *ends[:-1]], ends, strict=True)]
    return jnp.stack(sums) if sums else x


def of_sinusoids(x: Shaped[Array, "g ..."], of: np.ndarray, endless):
    """Rows of x for the signal of each sinusoid, (v, ...); `endless` for signals without edges."""
    return jnp.stack([x[i] if i < len(x) else endless for i in of])


def at_piece(values: Float[Array, "... k c"], piece):
    """Rows of the piece that each is on."""
    return sum(jnp.where(piece == j, values[..., j, :], 0.0) for j in range(values.shape[-2]))


def edge_times(signals: Signals) -> tuple[Array, Array]:
    """First passage of each edge (g, k, c) and the period (g, c), s."""
    offset = jnp.cumsum(signals.duration, axis=1) - signals.duration
    number = jnp.arange(signals.duration.shape[1])[:, None]
    first, period = signals.piece[:, None], jnp.sum(signals.duration, axis=1)
    begun = jnp.sum(jnp.where(number == first, offset, 0.0), axis=1) + signals.since
    later = jnp.where(number > first, 0.0, period[:, None])
    return offset - begun[:, None] + later, period
