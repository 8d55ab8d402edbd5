"""The long run's supremum of |dR|: phases run independently of each other.

sup |sum_g x_g(phi_g)| = max over unit d of sum_g max_phi d . x_g(phi).  One pass over each phase
finds its largest value in directions all around; sums of such points give further directions, in
which a second pass looks for each phase's two best maxima.  From there Newton's method climbs |dR|
in all phases at once.  Nothing of the search is differentiated: by the envelope theorem derivatives
are those of the formula at the times found.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._steady import sphere
from .arithmetic import materialised
from .climb import ascended, climbed, together, unit
from .curves import Curves, Rows, curves_of, towards, values_at
from .gradient import ROWS
from .pass_along import LENGTH, Block, along, reach
from .phases import columns_of, constant, cycle_of, phases_of
from .system import Layout
from .transient import Lanes

AROUND = 48  # directions of the search
DIRECTIONS = np.array([d for d in sphere(AROUND, 3) if d[2] > 0])  # and their opposites
KEPT = 8  # of them gone on from
ASCENTS = 4
AGAIN = 4  # sums in whose directions every phase is looked at once more
CLOSE = 0.99  # of the largest value: a maximum below is not gone on from
ASCENDS = 4  # rounds of Newton's method of a phase alone
_MASK = LENGTH - 1


class Found(NamedTuple):
    """The supremum: where each phase is, and what their outputs add up to."""

    times: list[Float[Array, "s c"]]  # of phases of like kinds
    total: Float[Array, "o c"]  # m

    @property
    def square(self) -> Float[Array, " c"]:
        """m^2."""
        return jnp.sum(self.total**2, axis=0)


def all_curves(g: Lanes, layout: Layout, rows: slice) -> list[Curves]:
    """The outputs `rows` of every phase."""
    found = []
    for phases in phases_of(layout):
        columns = columns_of(layout, phases)
        direct, slope = (jnp.moveaxis(x[columns][:, rows], 1, 0) for x in (g.direct, g.slope))
        cycle = cycle_of(g.signals, layout, phases)
        shown = Rows(g.modes.c0[rows], g.modes.c1[rows], direct, slope)
        found.append(curves_of(g.modes, cycle, columns, shown))
    return found


def _tagged(x):
    """x (k, ...) with its last bits replaced by the sample's number, for a maximum to keep."""
    bits = jax.lax.bitcast_convert_type(x, jnp.int64)
    number = jax.lax.broadcasted_iota(jnp.int64, x.shape, 0)
    return jax.lax.bitcast_convert_type((bits & ~_MASK) | number, jnp.float64)


class _Tops(NamedTuple):
    """The largest values so far in directions (d), when they are taken, and the step there."""

    height: Float[Array, "d s c"]
    time: Float[Array, "d s c"]
    step: Float[Array, "d s c"]


def _none(f: Curves, count: int) -> _Tops:
    shape = count, *f.cycle.period.shape
    return _Tops(jnp.full(shape, -jnp.inf), jnp.zeros(shape), jnp.zeros(shape))


def _tops_of(tagged, begin, step) -> _Tops:
    """What maxima of tagged samples say of a block."""
    number = jax.lax.bitcast_convert_type(tagged, jnp.int64) & _MASK
    return _Tops(tagged, begin + number * step, jnp.broadcast_to(step, tagged.shape))


def _higher(a: _Tops, b: _Tops) -> tuple[_Tops, _Tops]:
    """The higher one of two and the other."""
    better = b.height > a.height
    return _Tops(*(jnp.where(better, y, x) for x, y in zip(a, b, strict=True))), _Tops(
        *(jnp.where(better, x, y) for x, y in zip(a, b, strict=True))
    )


def _tops(f: Curves) -> _Tops:
    """In directions all around, by the samples."""
    d, n = jnp.asarray(DIRECTIONS), len(DIRECTIONS)
    size = jnp.abs(d)

    def gather(best: _Tops, x, begin, step) -> _Tops:
        seen = _along(d[:, :, None, None], x)
        high, low = (jnp.max(_tagged(y), axis=0) for y in (seen, -seen))
        return _higher(best, _tops_of(jnp.concatenate([high, low]), begin, step))[0]

    def idle(best: _Tops, block: Block):
        known = jnp.minimum(best.height[:n], best.height[n:])
        above = reach(f, block)  # along each axis
        return jnp.all(sum(size[:, o, None, None] * above[o] for o in range(ROWS)) <= known, axis=0)

    return along(f, gather, _none(f, 2 * n), idle)


def _points(f: Curves, top: _Tops) -> Float[Array, "d o s c"]:
    """The outputs at the maxima in directions all around, a step of Newton's method further."""

    def one(at):
        d, time, step = at[0][:, None, None], *at[1:]
        here, there = (values_at(f, t)[0] for t in (time, ascended(f, d, time, step)))
        return jnp.where(jnp.sum(d * there, axis=0) > jnp.sum(d * here, axis=0), there, here)

    every = jnp.concatenate([DIRECTIONS, -DIRECTIONS])
    return jax.lax.map(one, (every, top.time, top.step))


def _two_tops(f: Curves, d: Float[Array, "n o c"]) -> tuple[_Tops, _Tops]:
    """In directions of each design, by parabolas through three samples: the best two maxima."""
    f = towards(f, d)
    half = LENGTH // 2

    def gather(best, x, begin, step):
        seen = materialised(lambda x: 1.0 * x, x)
        rise, bend = seen[2:] - seen[:-2], 2 * seen[1:-1] - seen[:-2] - seen[2:]
        inside = jnp.abs(rise) < 2 * bend
        more = jnp.where(inside, rise * rise / jnp.where(inside, 8 * bend, 1.0), 0.0)
        tagged = _tagged(seen + jnp.pad(more, ((1, 1), (0, 0), (0, 0), (0, 0))))
        first, second = best
        for part in (tagged[:half], tagged[half:]):
            first, left = _higher(first, _tops_of(jnp.max(part, axis=0), begin, step))
            second = _higher(second, left)[0]
        return first, second

    def idle(best, block: Block):
        return jnp.all(reach(f, block) <= CLOSE * best[0].height, axis=0)

    return along(f, gather, (_none(f, d.shape[0]), _none(f, d.shape[0])), idle)


def _along(d, x):
    """d . x of directions (n, o, ...) and samples (k, o, s, c), (k, n, s, c)."""
    return d[:, 0] * x[:, None, 0] + d[:, 1] * x[:, None, 1] + d[:, 2] * x[:, None, 2]


def _best_sums(tops: list[_Tops], points, held):
    """Directions (n, o, c) of the longest sums of points of each phase; `points` (d, o, s, c)."""
    height = sum(jnp.sum(t.height, axis=1) for t in tops)  # (d, c)
    every = jnp.concatenate([DIRECTIONS, -DIRECTIONS])
    height = height + jnp.einsum("do,oc->dc", every, held)
    first = jax.lax.top_k(height.T, KEPT)[1].T  # (n, c)
    number = jnp.arange(len(every))[:, None, None]

    def sums(pick):
        """Total (o, c) of the points picked (d, s, c)."""
        return jnp.sum(jnp.where(pick[:, None], points, 0.0), axis=(0, 2)) + held

    def follow(_, begin):
        total = sums(jnp.broadcast_to(number == begin, (*points.shape[:1], *points.shape[2:])))
        for _ in range(ASCENTS):
            d = unit(total)
            seen = sum(d[o] * points[:, o] for o in range(ROWS))  # (d, s, c)
            total = sums(number == jnp.argmax(seen, axis=0))
        return None, total

    totals = jax.lax.scan(follow, None, first)[1]  # (n, o, c)
    pick = _longest(jnp.sum(totals**2, axis=1), AGAIN)
    return jax.vmap(unit)(jnp.sum(jnp.where(pick[:, :, None], totals, 0.0), axis=1))


def _longest(size, count: int):
    """Which (count, n, c) of sums (n, c) are the longest ones; equal ones count once."""
    found, number = [], jnp.arange(len(size))[:, None]
    for _ in range(count):
        found.append(number == jnp.argmax(size, axis=0))
        size = jnp.where(size > (1 - 1e-9) * jnp.max(size, axis=0), -1.0, size)
    return jnp.stack(found)


def supremum(g: Lanes, layout: Layout) -> Found:
    """Where the phases are at the largest |dR|, and dR there."""
    every = all_curves(g, layout, slice(0, ROWS))
    held = constant(g.modes, layout, slice(0, ROWS), g.direct)
    tops = [_tops(f) for f in every]
    points = [_points(f, top) for f, top in zip(every, tops, strict=True)]
    found = _best_sums(tops, jnp.concatenate(points, axis=2), held)
    starts = [_two_tops(f, found) for f in every]
    times, sizes = jax.lax.map(lambda begin: _refined(every, held, begin), starts)
    best = jnp.arange(AGAIN)[:, None] == jnp.argmax(sizes, axis=0)
    times = [jnp.sum(jnp.where(best[:, None], t, 0.0), axis=0) for t in times]
    return Found(times, together(every, held, times))


def _refined(every: list[Curves], held, starts: list[tuple[_Tops, _Tops]]):
    """Times of each phase and |dR|^2 there, from its best maxima in one direction."""
    steps = [first.step for first, _ in starts]
    times, size = climbed(every, held, [first.time for first, _ in starts], steps)
    d = unit(together(every, held, times))

    def swapped(f: Curves, now, other: _Tops):
        """The time of the higher maximum in the direction found."""
        time = jax.lax.fori_loop(
            0, ASCENDS, lambda _, t: ascended(f, d[:, None], t, other.step), other.time
        )
        height, rival = (jnp.sum(d[:, None] * values_at(f, t)[0], axis=0) for t in (now, time))
        return jnp.where(rival > height, time, now)

    others = [swapped(f, t, o) for f, t, (_, o) in zip(every, times, starts, strict=True)]
    again, more = climbed(every, held, others, steps)
    best = [jnp.where(more > size, x, t) for x, t in zip(again, times, strict=True)]
    return best, jnp.maximum(size, more)
