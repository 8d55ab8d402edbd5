"""The response at any one time in closed form: what one unit of each input gives to each pole.

With q = exp(lambda period) the n passages of an edge add up to (1 - q^n)/(1 - q); the function is
analytic in the poles, so its derivatives and its divided differences are those of the response.
Everything is in pairs (`poles`), batch last.
"""

import itertools
import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .arithmetic import Pair, pair_exp, product, quotient, sincos
from .blocks import particular
from .poles import PolePairs
from .signals import Signals
from .system import Layout

TURN = 2 * math.pi


class Moment(NamedTuple):
    """At one time: what one unit of each signal's column gives to each pair, and the signals."""

    pole: Pair  # (s, p, c)
    level: Float[Array, "s c"]  # rho
    slope: Float[Array, "s c"]  # drho/dt
    decay: Pair  # (p, c): exp(lambda t), what is left of the start
    free: Pair  # (s, p, c), of `pole` what only decays
    into: Float[Array, "s c"]  # s, since the piece began
    piece: Float[Array, "s c"]


@jax.custom_jvp
def _real_less_one(x):
    """e^x - 1, vectorised by XLA (its own is not)."""
    near = jnp.abs(x) < 0.3
    y, series = jnp.where(near, x, 0.0), 0.0
    for n in range(13, 0, -1):
        series = (1.0 + series) * y / n
    return jnp.where(near, series, jnp.exp(jnp.where(near, 0.0, x)) - 1.0)


@_real_less_one.defjvp
def _(primals, tangents):
    value = _real_less_one(*primals)
    return value, (value + 1.0) * tangents[0]


def exp_less_one(kind, a: Pair) -> Pair:
    """e^a - 1 without cancellation."""
    k = kind > 0
    first, second = _real_less_one(a[0]), _real_less_one(jnp.where(k, 0.0, a[1]))
    s, c = sincos(jnp.where(k, a[1] / 2, 0.0))
    off = -2 * s * s
    return (
        jnp.where(k, first + off + first * off, first),
        jnp.where(k, (1 + first) * 2 * s * c, second),
    )


def _repeated(kind, a: Pair, count) -> Pair:
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


class _Waves(NamedTuple):
    """Sinusoids of signals of one kind (w, k, s, c), and the pairs' parts (w, k, p, s, c)."""

    rate: Array  # (w, s, c)
    cosine: Array
    sine: Array
    a: Pair
    b: Pair

    def ends(self, since) -> Pair:
        """The pairs' parts of every piece `since` (k, s, c) seconds into it, (k, p, s, c)."""
        s, c = sincos(self.rate[:, None] * since)
        s, c = s[:, :, None], c[:, :, None]
        first, second = (
            jnp.sum(x * c + y * s, axis=0) for x, y in zip(self.a, self.b, strict=True)
        )
        return first, second

    def level(self, piece, since) -> Pair:
        """rho and drho/dt of the piece that each signal is on, (s, c)."""
        s, c = sincos(self.rate * since)
        cosine, sine = _on(self.cosine, piece, 1), _on(self.sine, piece, 1)
        slope = self.rate * (sine * c - cosine * s)
        return jnp.sum(cosine * c + sine * s, axis=0), jnp.sum(slope, axis=0)


def _on(values, piece, axis: int):
    """Entries of the piece (s, c) that each signal is on; pieces on `axis`."""
    rows = jnp.moveaxis(values, axis, 0)
    return sum(jnp.where(piece == j, rows[j], 0.0) for j in range(len(rows)))


def _signals(m: PolePairs, waves: _Waves, duration, first, since, time):
    """Signals of one kind: every edge's passages so far, and the piece that each is on."""
    pole = m.l0[:, None], m.l1[:, None]  # (p, 1, c)
    kind = m.kind[:, None]
    decay = pair_exp(kind, (pole[0] * time, pole[1] * time))
    begin = [_on(x, first, 0) for x in waves.ends(jnp.broadcast_to(since, duration.shape))]
    left = product(kind, begin, decay)
    pieces = len(duration)
    if pieces == 1:
        now = waves.ends((time + since)[None])
        free, total = (-left[0], -left[1]), (now[0][0] - left[0], now[1][0] - left[1])
        return total, free, *waves.level(first, time + since), time + since, first
    offset = jnp.cumsum(duration, axis=0) - duration  # (k, s, c)
    period, number = jnp.sum(duration, axis=0), jnp.arange(pieces)[:, None, None]
    edge = offset - _on(offset, first, 0) - since + jnp.where(number > first, 0.0, period)
    count = jax.lax.stop_gradient(jnp.maximum(jnp.floor((time - edge) / period) + 1, 0.0))
    alive = count > 0
    last = jnp.where(alive, edge + (count - 1) * period, time)
    step, ago = jnp.where(alive, period, 0.0)[:, None], (time - last)[:, None]
    many = _repeated(kind, (pole[0] * step, pole[1] * step), jnp.maximum(count, 1.0)[:, None])
    many = product(kind, pair_exp(kind, (pole[0] * ago, pole[1] * ago)), many)
    ends, begins = waves.ends(duration), waves.ends(0.0 * duration)
    jump = [jnp.roll(x, 1, axis=0) - y for x, y in zip(ends, begins, strict=True)]
    jump = product(kind, jump, many)
    piece = jnp.mod(first + jnp.sum(count, axis=0), pieces)
    into = time - jnp.max(jnp.where(alive, last, -since), axis=0)
    now = waves.ends(jnp.broadcast_to(into, duration.shape))
    free = [
        jnp.sum(jnp.where(alive[:, None], x, 0.0), axis=0) - y
        for x, y in zip(jump, left, strict=True)
    ]
    total = [x + _on(y, piece, 0) for x, y in zip(free, now, strict=True)]
    return (total[0], total[1]), (free[0], free[1]), *waves.level(piece, into), into, piece


def moment(m: PolePairs, signals: Signals, layout: Layout, time) -> Moment:
    """The response of every pair to one unit of every signal's column at `time` (c,), s."""
    one = jnp.ones_like(m.l0), jnp.where(m.kind > 0, 0.0, 1.0)
    parts, first, edged = [], 0, 0
    for kind, same in itertools.groupby((kind.pieces, kind.waves) for kind in layout.kinds):
        (pieces, count), size = kind, len(list(same))
        v = slice(first, first + count * size)

        def rows(x, count=count, size=size, v=v):  # (v, ..., c) -> (w, ..., s, c)
            x = x[v].reshape(size, count, *x.shape[1:])
            return jnp.moveaxis(x, 0, -2)

        rate, cosine, sine = rows(signals.rate), rows(signals.cosine), rows(signals.sine)
        cosine, sine = cosine[:, :pieces], sine[:, :pieces]
        wide = m._replace(kind=m.kind[:, None], l0=m.l0[:, None], l1=m.l1[:, None])
        b = one[0][:, None], one[1][:, None]
        a, b = particular(wide, b, rate[:, None, None], cosine[:, :, None], sine[:, :, None])
        waves = _Waves(rate, cosine, sine, (a[0], a[1]), (b[0], b[1]))
        if pieces > 1:
            here = slice(edged, edged + size)
            duration = jnp.swapaxes(signals.duration[here, :pieces], 0, 1)
            known = duration, signals.piece[here], signals.since[here]
            edged += size
        else:
            none = jnp.zeros((size, *time.shape))
            known = none[None], none, none
        parts.append(_signals(m, waves, *known, time))
        first += count * size
    decay = pair_exp(m.kind, (m.l0 * time, m.l1 * time))

    def pairs(n: int) -> Pair:
        first, second = (jnp.concatenate([part[n][i] for part in parts], axis=1) for i in (0, 1))
        return jnp.swapaxes(first, 0, 1), jnp.swapaxes(second, 0, 1)

    level, slope, into, piece = (jnp.concatenate([part[i] for part in parts]) for i in range(2, 6))
    return Moment(pairs(0), level, slope, decay, pairs(1), into, piece)
