"""RMS, refined peak and margins of many runs from the samples t = 0, step, ... , duration."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .arithmetic import materialised, product
from .blocks import LENGTH, Operands, State, Tables, forced, row_signal, run
from .moment import Moment, moment
from .poles import Modes
from .signals import Signals
from .system import Layout

LANES = 64  # designs that pass through the loop together


class Lanes(NamedTuple):
    """A group of designs, batch last."""

    modes: Modes
    signals: Signals
    direct: Float[Array, "l o c"]
    slope: Float[Array, "l o c"]
    preload: Float[Array, "n c"]
    friction: Float[Array, "n c"]


class Samples(NamedTuple):
    """What a run's samples say, one entry a design."""

    total: Float[Array, " c"]  # m^2, sum of |dR|^2
    best: Float[Array, " c"]  # number of the sample with the largest |dR|
    normal: Float[Array, " c"]  # N, of the least normal force a bound of the same sign
    slip: Float[Array, " c"]  # N, the same of the least mu N - |f|; without lift-off


def samples_of(g: Lanes, layout: Layout, step, count) -> Samples:
    """One pass over all samples of a group."""
    number = jnp.arange(LENGTH, dtype=float)[:, None]
    parts = materialised(
        lambda m, signals, direct, slope: forced(m, signals, direct, slope, layout),
        g.modes, g.signals, g.direct, g.slope,
    )  # fmt: skip
    bound = _bound(g, layout)

    def seen(pair, best, at, block):
        """The largest so far and its block, from totals that a loop has stored."""
        top = jnp.max(pair.imag, axis=0)
        return jnp.maximum(top, best), jnp.where(top > best, block, at)

    def gather(totals, op: Operands, t: Tables, s: State):
        pair, best, at, block, low = totals
        best, at = seen(pair, best, at, block)
        x, y, z = (row_signal(op, t, o, layout.live[o]) for o in range(3))
        inside = number < op.count
        square = jnp.where(inside, x * x + y * y + z * z, 0.0)
        pair = jax.lax.complex(pair.real + square, jnp.maximum(pair.imag, square))
        low = _lowest(low, bound(s.free, op), op, t, inside, g, layout.wheels)
        return pair, best, at, s.done, low

    lanes = g.modes.l0.shape[-1]
    none, zero = jnp.zeros((LENGTH, lanes)), jnp.zeros(lanes)
    start = jax.lax.complex(none, none), zero, zero, zero, (zero + jnp.inf, zero + jnp.inf)
    pair, best, at, block, low = run(g.modes, g.signals, parts, layout, step, count, gather, start)
    _, at = seen(pair, best, at, block)
    return Samples(jnp.sum(pair.real, axis=0), at + jnp.argmax(pair.imag, axis=0), *low)


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


def _lowest(low, bounds, op: Operands, t: Tables, inside, g: Lanes, n: int):
    """The least margins so far: by the bounds where those say enough, else sample by sample.

    Nothing more is asked of a design that has lifted off, nor of the grip of one that has slipped.
    """
    some = op.count > 0
    bounds = [jnp.where(some, jnp.min(b, axis=0), jnp.inf) for b in bounds]
    open_ = (bounds[0] <= 0) | ((bounds[1] < 0) & (low[1] >= 0))
    asked = jnp.any(open_ & (low[0] > 0))

    def exact(op, t):
        def wheel(i, least):
            normal = row_signal(op, t, 3 + i) + g.preload[i]
            slip = g.friction[i] * normal - jnp.abs(row_signal(op, t, 3 + n + i))
            normal, slip = (jnp.where(inside, x, jnp.inf) for x in (normal, slip))
            return jax.lax.complex(jnp.minimum(least.real, normal), jnp.minimum(least.imag, slip))

        none = jnp.full(inside.shape, jnp.inf)
        least = jax.lax.fori_loop(0, n, wheel, jax.lax.complex(none, none))
        return jnp.min(least.real, axis=0), jnp.min(least.imag, axis=0)

    found = jax.lax.cond(asked, exact, lambda *_: (bounds[0], bounds[1]), op, t)
    return jnp.minimum(low[0], found[0]), jnp.minimum(low[1], found[1])


def outputs_at(g: Lanes, layout: Layout, now: Moment, rows: int = 3):
    """The first outputs and their rates at a moment, (o, c) each; none has a drho/dt part."""
    m = g.modes
    columns = np.array([kind.column for kind in layout.kinds])
    b = m.b0[columns], m.b1[columns]
    start = product(m.kind, (m.b0[-1], m.b1[-1]), now.decay)
    parts = product(m.kind, b, now.pole)
    z = [jnp.sum(x, axis=0) + y for x, y in zip(parts, start, strict=True)]
    turned = product(m.kind, (m.l0, m.l1), z)
    rate = [x + jnp.sum(y * now.level[:, None], axis=0) for x, y in zip(turned, b, strict=True)]
    direct = g.direct[columns][:, :rows]

    def seen(z, levels):
        part = jnp.sum(m.c0[:rows] * z[0] + m.c1[:rows] * z[1], axis=1)
        return part + jnp.sum(direct * levels[:, None], axis=0)

    return seen(z, now.level), seen(rate, now.slope)


def refined_peak(g: Lanes, layout: Layout, best, step, count):
    """Largest |dR|^2, refined as `vibration.peak` does: the cubics beside the largest sample."""
    times = jnp.stack([jnp.clip(best + i, 0, count - 1) for i in (-1, 0, 1)]) * step

    def at(time):
        return outputs_at(g, layout, moment(g.modes, g.signals, layout, time))

    x, v = jax.lax.map(at, times)
    return hermite_peak(x, v, times, step)


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
