"""RMS, refined peak and margins of many runs from the samples t = 0, step, ... , duration."""

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .arithmetic import across, materialised, summed
from .blocks import LENGTH, BlockTables, ForcedPart, Operands, row_signal, stored_forced
from .passages import outputs_at
from .poles import PolePairs
from .signals import Signals
from .system import Layout
from .walk import Walk, WalkState

ROWS = 3  # outputs that the figures are made of: dR
LANES = 64  # designs that pass through the loop together


class Lanes(NamedTuple):
    """A group of designs, batch last."""

    modes: PolePairs
    signals: Signals
    direct: Float[Array, "l o c"]
    slope: Float[Array, "l o c"]
    preload: Float[Array, "n c"]
    friction: Float[Array, "n c"]


class Near(NamedTuple):
    """dR and its rate at a run's largest sample and its neighbours."""

    time: Float[Array, "3 c"]  # s
    x: Float[Array, "3 o c"]  # m
    v: Float[Array, "3 o c"]  # m/s

    def peak(self, step):
        """Largest |dR|^2, refined as `vibration.peak` does: the cubics beside the middle time."""
        return hermite_peak(self.x, self.v, self.time, step)


class Samples(NamedTuple):
    """What a run's samples say, one entry a design."""

    total: Float[Array, " c"]  # m^2, sum of |dR|^2
    near: Near
    normal: Float[Array, " c"]  # N, of the least normal force a bound of the same sign
    slip: Float[Array, " c"]  # N, the same of the least mu N - |f|; without lift-off


class Along(NamedTuple):
    """What else is gathered on the pass over the samples."""

    gather: Callable  # (totals, dR (o, k, c), operands, tables, state) -> totals
    totals: Any
    follow: Callable = lambda carried, move: carried  # see `Walk.run`
    carried: Any = ()


class _Largest(NamedTuple):
    """The largest square so far and the samples before the block that holds it."""

    square: Float[Array, " c"]
    begin: Float[Array, " c"]
    last: Float[Array, " c"]  # samples before the last block

    def seen(self, top):
        """With the square `top` that the blocks so far have reached."""
        begin = jnp.where(top > self.square, self.last, self.begin)
        return _Largest(jnp.maximum(top, self.square), begin, self.last)


def samples_of(
    g: Lanes, layout: Layout, step, count, also: Along | None = None
) -> tuple[Samples, Any]:
    """One pass over all samples of a group, and the totals of what else it gathers."""
    number = jnp.arange(LENGTH, dtype=float)[:, None]
    parts = stored_forced(g.modes, g.signals, g.direct, g.slope, layout)
    bound = _bound(g, layout)
    walk = Walk(g.modes, g.signals, parts, layout, step, count)

    def outputs(op: Operands, t: BlockTables):
        return [row_signal(op, t, layout, o) for o in range(ROWS)]

    def kept(op: Operands, t: BlockTables):
        return jnp.where(number < op.count, jnp.stack(outputs(op, t)), 0.0)

    def gather(totals, op: Operands, t: BlockTables, s: WalkState):
        (pair, largest, low), more = totals
        largest = largest.seen(across(jnp.maximum, pair.imag))
        inside = number < op.count
        if also is None:
            x, y, z = outputs(op, t)
            square = jnp.where(inside, x * x + y * y + z * z, 0.0)
        else:
            x = materialised(kept, op, t)
            more, square = also.gather(more, x, op, t, s), summed(x * x)
        pair = jax.lax.complex(pair.real + square, jnp.maximum(pair.imag, square))
        low = _lowest(low, bound(s.free, op), op, t, inside, g, layout)
        return (pair, largest._replace(last=s.done), low), more

    lanes = g.modes.l0.shape[-1]
    none, zero = jnp.zeros((LENGTH, lanes)), jnp.zeros(lanes)
    lowest = (zero + jnp.inf, zero + jnp.inf)
    start = jax.lax.complex(none, none), _Largest(zero, zero, zero), lowest
    own = start, also and also.totals
    if also is None:
        (pair, largest, low), more = walk.run(gather, own)
    else:
        (pair, largest, low), more = walk.run(gather, own, also.follow, also.carried)
    largest = largest.seen(across(jnp.maximum, pair.imag))
    middle = largest.begin + jnp.argmax(pair.imag, axis=0)
    near = _near(g, parts, layout, middle, step, count)
    return Samples(jnp.sum(pair.real, axis=0), near, *low), more


def _near(g: Lanes, parts: ForcedPart, layout: Layout, middle, step, count) -> Near:
    """dR and its rate at a sample of each run and its neighbours."""
    time = step * jnp.concatenate([jnp.clip(middle + i, 0, count - 1) for i in (-1, 0, 1)])
    m, signals, parts = jax.tree.map(
        lambda y: jnp.concatenate([y] * 3, axis=-1), (g.modes, g.signals, parts)
    )
    x, v = outputs_at(m, signals, parts, layout, time, ROWS)
    x, v = (jnp.stack(jnp.split(y, 3, axis=-1)) for y in (x, v))
    return Near(time.reshape(3, -1), x, v)


def _bound(g: Lanes, layout: Layout):
    """(free part, operands) -> bounds from below of N and mu N - |f| over a block, (n, c) each."""
    n, m = layout.wheels, g.modes
    loads = slice(3, 3 + n)
    k = m.kind > 0
    c0, c1 = m.c0[loads], m.c1[loads]
    size = jnp.where(k, jnp.sqrt(c0 * c0 + c1 * c1), jnp.abs(c0)), jnp.where(k, 0.0, jnp.abs(c1))

    def low(free, op: Operands):
        z0 = jnp.where(k, jnp.sqrt(free[0] ** 2 + free[1] ** 2), jnp.abs(free[0]))
        wave = jnp.sum(jnp.sqrt(op.f0[3:] ** 2 + op.f1[3:] ** 2), axis=1)
        swing = jnp.sum(size[0] * z0 + size[1] * jnp.abs(free[1]), axis=1) + wave[:n]
        normal = g.preload - swing
        return normal, g.friction * normal - wave[n:]

    return low


def _lowest(low, bounds, op: Operands, t: BlockTables, inside, g: Lanes, layout: Layout):
    """The least margins so far: by the bounds where those say enough, else sample by sample.

    Nothing more is asked of a design that has lifted off, nor of the grip of one that has slipped.
    """
    some = op.count > 0
    bounds = [jnp.where(some, jnp.min(b, axis=0), jnp.inf) for b in bounds]
    open_ = (bounds[0] <= 0) | ((bounds[1] < 0) & (low[1] >= 0))
    asked = jnp.any(open_ & (low[0] > 0))
    margins = jax.lax.cond(
        asked,
        lambda op, t: _margins(op, t, inside, g, layout),
        lambda *_: (bounds[0], bounds[1]),
        op,
        t,
    )
    return jnp.minimum(low[0], margins[0]), jnp.minimum(low[1], margins[1])


def _margins(op: Operands, t: BlockTables, inside, g: Lanes, layout: Layout):
    """The least N and mu N - |f| of all wheels over the samples of a block."""
    n = layout.wheels
    shown = [(layout.live[o], layout.waves[o]) for o in range(3, 3 + 2 * n)]

    def wheel(i, like, op, t):
        normal = row_signal(op, t, layout, 3 + like, 3 + i) + g.preload[i]
        drive = row_signal(op, t, layout, 3 + n + like, 3 + n + i)
        return normal, g.friction[i] * normal - jnp.abs(drive)

    def pair(normal, slip):
        normal, slip = (jnp.where(inside, x, jnp.inf) for x in (normal, slip))
        return jax.lax.complex(normal, slip)

    def lower(i, least):
        normal, slip = wheel(i, 0, op, t)
        return pair(jnp.minimum(least.real, normal), jnp.minimum(least.imag, slip))

    def every(op, t):
        each = zip(*(wheel(i, i, op, t) for i in range(n)), strict=True)
        return pair(*(functools.reduce(jnp.minimum, x) for x in each))

    if len(set(shown[:n])) == len(set(shown[n:])) == 1:  # one wheel's program does for all
        none = jnp.full(inside.shape, jnp.inf)
        least = jax.lax.fori_loop(0, n, lower, jax.lax.complex(none, none))
    else:
        least = materialised(every, op, t)
    return across(jnp.minimum, least.real), across(jnp.minimum, least.imag)


def hermite_peak(x: Float[Array, "3 o c"], v: Float[Array, "3 o c"], times, step):
    """Largest square of x, of rates v, at or beside the middle one of three times."""
    squares, slopes = jnp.sum(x * x, axis=1), 2 * step * jnp.sum(x * v, axis=1)
    top = squares[1]
    for i in (0, 1):
        inner = cubic_peak(squares[i], squares[i + 1], slopes[i], slopes[i + 1])
        top = jnp.where(times[i] < times[i + 1], jnp.maximum(top, inner), top)
    return top


def cubic_peak(y0, y1, d0, d1):
    """Largest value of the Hermite cubic on [0, 1] at its inner maximum; y0 without one."""
    c2, c3 = 3 * (y1 - y0) - 2 * d0 - d1, 2 * (y0 - y1) + d0 + d1
    below = -c2 + jnp.sqrt(jnp.maximum(c2 * c2 - 3 * c3 * d0, 0.0))
    u = d0 / jnp.where(jnp.abs(below) > 0, below, 1.0)
    u = jax.lax.stop_gradient(jnp.where((jnp.abs(below) > 0) & (u > 0) & (u < 1), u, 0.0))
    return y0 + u * (d0 + u * (c2 + u * c3))
