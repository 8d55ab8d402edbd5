"""RMS, refined peak and margins of many runs from the samples t = 0, step, ... , duration."""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .arithmetic import across, materialised, product, sincos, stored, summed
from .blocks import LENGTH, BlockTables, Operands, pole_exp, row_signal, stored_forced
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
    """The largest square so far, and where runs are around it: states as `packed`, (r, c)."""

    square: Array  # (c,)
    block: Array  # (c,), samples before the block that holds it
    before: Array  # the last block with samples before that one
    last: Array  # the block before the present one, with its samples
    count: Array
    earlier: Array  # the last block with samples before `last`

    def seen(self, top):
        """With the square `top` that `last` has reached."""
        larger = top > self.square
        return self._replace(
            square=jnp.maximum(top, self.square),
            block=jnp.where(larger, self.last[0], self.block),
            before=jnp.where(larger, self.earlier, self.before),
        )

    def moved(self, s: WalkState, count):
        """On to the block that begins at `s`."""
        earlier = jnp.where(self.count > 0, self.last, self.earlier)
        return self._replace(last=s.packed(), count=count, earlier=earlier)


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
        return (pair, largest.moved(s, op.count), low), more

    lanes = g.modes.l0.shape[-1]
    none, zero, begin = jnp.zeros((LENGTH, lanes)), jnp.zeros(lanes), walk.begin()
    largest = _Largest(zero, zero, begin.packed(), begin.packed(), zero, begin.packed())
    start = jax.lax.complex(none, none), largest, (zero + jnp.inf, zero + jnp.inf)
    own = start, also and also.totals
    if also is None:
        (pair, largest, low), more = walk.run(gather, own)
    else:
        (pair, largest, low), more = walk.run(gather, own, also.follow, also.carried)
    largest = largest.seen(across(jnp.maximum, pair.imag))
    best = largest.block + jnp.argmax(pair.imag, axis=0)
    numbers = jnp.stack([jnp.clip(best + i, 0, count - 1) for i in (-1, 0, 1)])
    near = Near(numbers * step, *_at_samples(walk, begin.unpacked(largest.before), numbers))
    return Samples(jnp.sum(pair.real, axis=0), near, *low), more


def _at_samples(walk: Walk, begin: WalkState, numbers: Float[Array, "3 c"]):
    """dR and its rate at the samples of these numbers, all from the state `begin` on, (3, o, c)."""
    m, rate = walk.modes, walk.signals.rate

    def body(carry):
        s, op, samples = carry
        local = numbers - s.done
        E = pole_exp(m, walk.layout, (local * walk.step)[:, None])
        sn, cs = stored(sincos, rate * (local * walk.step)[:, None])
        turned = stored(lambda k, *x: product(k, x[:2], x[2:]), m.kind, m.l0, m.l1, *E)

        def seen(pairs, cosine, sine):  # (3, o, c)
            parts = zip(op[1:], (*pairs, cosine, sine), strict=True)
            return sum(x[:ROWS, i] * y[:, i][:, None] for x, y in parts for i in range(x.shape[1]))

        inside = ((local >= 0) & (local < op.count))[:, None]
        now = seen(E, cs, sn), seen(turned, -rate * sn, rate * cs)
        s = walk.onward(s, op.count)
        samples = [jnp.where(inside, x, y) for x, y in zip(now, samples, strict=True)]
        return s, walk.operands(s), samples

    none = jnp.zeros((3, ROWS, numbers.shape[-1]))
    start = begin, walk.operands(begin), [none, none]
    return jax.lax.while_loop(lambda c: jnp.any(c[0].done <= numbers[2]), body, start)[2]


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

    def wheel(i, least, like):
        normal = row_signal(op, t, layout, 3 + like, 3 + i) + g.preload[i]
        drive = row_signal(op, t, layout, 3 + n + like, 3 + n + i)
        slip = g.friction[i] * normal - jnp.abs(drive)
        normal, slip = (jnp.where(inside, x, jnp.inf) for x in (normal, slip))
        return jax.lax.complex(jnp.minimum(least.real, normal), jnp.minimum(least.imag, slip))

    none = jnp.full(inside.shape, jnp.inf)
    least = jax.lax.complex(none, none)
    if len(set(shown[:n])) == len(set(shown[n:])) == 1:  # one wheel's program does for all
        least = jax.lax.fori_loop(0, n, lambda i, least: wheel(i, least, 0), least)
    else:
        for i in range(n):
            least = wheel(i, least, i)
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
