"""RMS, refined peak and margins of many runs from the samples t = 0, step, ... , duration."""

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...._cubic import cubic_peak
from ..arithmetic import across, materialised, product, rows, sincos, stored, summed, turned
from ..lanes import ROWS, Lanes
from ..system import Layout
from .blocks import (
    LENGTH,
    BlockTables,
    Poles,
    Weights,
    parts_of,
    poles_of,
    shown,
    shown_by,
    stored_forced,
)
from .edges import at_piece, of_sinusoids
from .loads import Loads
from .walk import Walk, WalkState


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

    gather: Callable  # (totals, dR (o, k, c), weights, tables, state, turn) -> totals
    totals: Any
    follow: Callable = lambda carried, move: carried  # see `Walk.run`
    carried: Any = ()


class _Largest(NamedTuple):
    """The largest square so far, `numbered`, and the samples up to the end of its block."""

    square: Float[Array, " c"]
    end: Float[Array, " c"]

    def seen(self, pair, done):
        """With the largest squares of the blocks up to the sample number `done`."""
        top = across(jnp.maximum, pair.imag)
        end = jnp.where(top > self.square, done, self.end)
        return _Largest(jnp.maximum(top, self.square), end)

    def sample(self):
        """Number of the sample that is the largest."""
        return self.end - 1 - (_bits(self.square) & (LENGTH - 1))


def _numbered(square, number):
    """Numbers >= 0 that end with the bits of a `number` below `LENGTH`; 1e-14 of them is lost."""
    bits = (_bits(square) & ~(LENGTH - 1)) | number
    return jax.lax.bitcast_convert_type(bits, square.dtype)


def _bits(x):
    return jax.lax.bitcast_convert_type(x, jnp.int64)


def samples_of(
    g: Lanes, layout: Layout, step, count, also: Along | None = None
) -> tuple[Samples, Any]:
    """One pass over all samples of a group, and the totals of what else it gathers."""
    parts = stored_forced(g.modes, g.signals, g.direct, g.slope, layout)
    walk = Walk(g.modes, g.signals, parts, layout, step, count)
    moved = shown_by(range(ROWS), g.modes, parts, layout)
    together = moved.together(range(ROWS), layout)
    loads = Loads(g.modes, g.preload, g.friction, parts, layout, LENGTH * step)

    def outputs(w: Weights, t: BlockTables):
        return [moved.samples(w, t, layout, o) for o in range(ROWS)]

    def kept(count, w: Weights, t: BlockTables):
        number = jnp.arange(LENGTH)[:, None]
        return jnp.where(number < count, jnp.stack(outputs(w, t)), 0.0)

    def gather(totals, s: WalkState, t: BlockTables, turn):
        (pair, largest, low), more = totals
        largest = largest.seen(pair, s.done)
        w = moved.weights(s.free, s.piece, turn, layout)
        if also is None:
            each = [(number, outputs(w, part)) for number, part in parts_of(t, together)]
        else:
            x = materialised(kept, s.count, w, t)
            more = also.gather(more, x, w, t, s, turn)
            each = [(number, _of(x, number)) for number, _ in parts_of(t, together)]
        sums, top = zip(*(_square(x, number, s.count) for number, x in each), strict=True)
        pair = jax.lax.complex(sum(sums, pair.real), functools.reduce(jnp.maximum, top, pair.imag))
        return (pair, largest, loads.lowest(low, s, t, turn)), more

    lanes = g.modes.l0.shape[-1]
    none, zero = jnp.zeros((together, lanes)), jnp.zeros(lanes)
    lowest = jax.lax.complex(zero + jnp.inf, zero + jnp.inf)
    start = jax.lax.complex(none, none), _Largest(zero, zero), lowest
    own = start, also and also.totals
    if also is None:
        (pair, largest, low), more = walk.run(gather, own)
    else:
        (pair, largest, low), more = walk.run(gather, own, also.follow, also.carried)
    near = _near(g, walk, largest.seen(pair, count).sample())
    return Samples(jnp.sum(pair.real, axis=0), near, low.real, low.imag), more


def _of(x: Float[Array, "o k c"], number: np.ndarray):
    """The samples of these numbers, one after the other."""
    return jax.lax.slice_in_dim(x, number[0, 0], number[-1, 0] + 1, axis=1)


def _square(x, number: np.ndarray, count):
    """|dR|^2 of a block's samples of these numbers, and the same numbered from its last on."""
    square = jnp.where(number < count, sum(y * y for y in x), 0.0)
    left = jnp.maximum(count.astype(int) - 1 - number, 0)
    return square, _numbered(square, left)


def _near(g: Lanes, walk: Walk, middle) -> Near:
    """dR and its rate at a sample of each run and its neighbours."""
    m, signals, step = g.modes, g.signals, walk.step
    sample = jnp.stack([jnp.clip(middle + i, 0, walk.samples - 1) for i in (-1, 0, 1)])  # (3, c)
    s = walk.blocks_of(sample)

    def moved(into, poles: Poles, s: WalkState):
        E = (rows(x, walk.layout.pole, -2) for x in poles.exp(into[:, None]))
        z = product(m.kind, s.free, tuple(E))
        return [jax.lax.complex(*y) for y in (z, product(m.kind, z, (m.l0, m.l1)))]

    z = materialised(moved, step * (sample - s.done), poles_of(m, walk.layout), s)
    value, rate = (shown(m, (x.real, x.imag), ROWS) for x in z)  # (o, 3, c)
    of = walk.layout.signal_of
    begun, piece = (jnp.swapaxes(x, 0, 1) for x in (s.begun, s.piece))
    begun, piece = (of_sinusoids(x, of, jnp.zeros_like(sample)) for x in (begun, piece))
    sin, cos = stored(sincos, signals.rate[:, None] * (step * sample - begun))  # (v, 3, c)
    a, b = (at_piece(x[:ROWS, :, None], piece) for x in (walk.parts.cosine, walk.parts.sine))
    level, slope = turned(a, b, cos, sin)
    x, v = value + summed(level, 1), rate + summed(signals.rate[:, None] * slope, 1)
    return Near(step * sample, jnp.swapaxes(x, 0, 1), jnp.swapaxes(v, 0, 1))


def hermite_peak(x: Float[Array, "3 o c"], v: Float[Array, "3 o c"], times, step):
    """Largest square of x, of rates v, at or beside the middle one of three times."""
    squares, slopes = jnp.sum(x * x, axis=1), 2 * step * jnp.sum(x * v, axis=1)
    top = squares[1]
    for i in (0, 1):
        inner = cubic_peak(squares[i], squares[i + 1], slopes[i], slopes[i + 1])
        top = jnp.where(times[i] < times[i + 1], jnp.maximum(top, inner), top)
    return top
