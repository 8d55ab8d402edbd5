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
from .arithmetic import across, materialised, summed
from .climb import ascended, climbed, move_up, unit
from .curves import ModalCurves, OutputRows, curves_of, towards, values_at
from .gradient import ROWS
from .pass_along import COARSE, LENGTH, Block, along, reach
from .phases import columns_of, constant, cycle_of, phases_of
from .system import Layout
from .transient import Lanes

AROUND = 48  # directions of the search
DIRECTIONS = np.array([d for d in sphere(AROUND, 3) if d[2] > 0])  # and their opposites
KEPT = 8  # of them gone on from
ASCENTS = 4
AGAIN = 4  # sums in whose directions every phase is looked at once more
CLOSE = 0.99  # of the largest value: a maximum below is not gone on from
ASCENDS = 3  # rounds of Newton's method of a phase alone
NEARER, NEAREST = 3, 5  # and of all phases: in every sum, then in the longest
LOOKED = 8  # points looked at together
_MASK = 63  # of the bits that tell which of up to 64 values a maximum is


class Supremum(NamedTuple):
    """The supremum: where each phase is, and what their outputs add up to."""

    times: list[Float[Array, "s c"]]  # of phases of like kinds
    total: Float[Array, "o c"]  # m

    @property
    def square(self) -> Float[Array, " c"]:
        """m^2."""
        return jnp.sum(self.total**2, axis=0)


def all_curves(g: Lanes, layout: Layout, rows: slice) -> list[ModalCurves]:
    """The outputs `rows` of every phase."""
    curves = []
    for phases in phases_of(layout):
        columns = columns_of(layout, phases)
        direct, slope = (jnp.moveaxis(x[columns][:, rows], 1, 0) for x in (g.direct, g.slope))
        cycle = cycle_of(g.signals, layout, phases)
        shown = OutputRows(g.modes.c0[rows], g.modes.c1[rows], direct, slope)
        curves.append(curves_of(g.modes, cycle, columns, shown))
    return curves


def _tagged(x):
    """x (k, ...) with its last bits replaced by its number of k, for a maximum to keep."""
    bits = jax.lax.bitcast_convert_type(x, jnp.int64)
    number = jax.lax.broadcasted_iota(jnp.int64, x.shape, 0)
    return jax.lax.bitcast_convert_type((bits & ~_MASK) | number, jnp.float64)


class _Tops(NamedTuple):
    """The largest values so far in directions (d), when they are taken, and the step there."""

    height: Float[Array, "d s c"]
    time: Float[Array, "d s c"]
    step: Float[Array, "d s c"]


def _none(f: ModalCurves, count: int) -> _Tops:
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


def _tops(f: ModalCurves) -> _Tops:
    """In directions all around, by the samples."""
    d, n = jnp.asarray(DIRECTIONS), len(DIRECTIONS)
    size = jnp.abs(d)

    def gather(best: _Tops, x, begin, step) -> _Tops:
        seen = _along(d[:, :, None, None], x)
        high, low = (across(jnp.maximum, _tagged(y)) for y in (seen, -seen))
        return _higher(best, _tops_of(jnp.concatenate([high, low]), begin, step))[0]

    def idle(best: _Tops, block: Block):
        known = jnp.minimum(best.height[:n], best.height[n:])
        above = reach(f, block)  # along each axis
        return jnp.all(sum(size[:, o, None, None] * above[o] for o in range(ROWS)) <= known, axis=0)

    return along(f, gather, _none(f, 2 * n), idle, COARSE)


def _points(f: ModalCurves, top: _Tops) -> Float[Array, "d o s c"]:
    """The outputs at the maxima in directions all around, moved on by a parabola in time."""

    def one(at):
        d, time, step = at[0][:, None, None], *at[1:]
        x, v, a = values_at(f, time, 3)
        on = move_up(summed(d * v), summed(d * a), step)
        further = x + on * (v + 0.5 * on * a)
        return jnp.where(summed(d * further) > summed(d * x), further, x)

    every = jnp.concatenate([DIRECTIONS, -DIRECTIONS])
    return jax.lax.map(one, (every, top.time, top.step), batch_size=LOOKED)


def _two_tops(f: ModalCurves, d: Float[Array, "n o c"]) -> tuple[_Tops, _Tops]:
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
            first, left = _higher(first, _tops_of(across(jnp.maximum, part), begin, step))
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
        return summed(across(jnp.add, jnp.where(pick[:, None], points, 0.0)), 1) + held

    def follow(_, begin):
        total = sums(jnp.broadcast_to(number == begin, (*points.shape[:1], *points.shape[2:])))
        for _ in range(ASCENTS):
            d = unit(total)
            seen = _tagged(sum(d[o] * points[:, o] for o in range(ROWS)))  # (d, s, c)
            total = sums(seen == across(jnp.maximum, seen))
        return None, total

    totals = jax.lax.scan(follow, None, first)[1]  # (n, o, c)
    pick = _longest(jnp.sum(totals**2, axis=1), AGAIN)
    return jax.vmap(unit)(jnp.sum(jnp.where(pick[:, :, None], totals, 0.0), axis=1))


def _longest(size, count: int):
    """Which (count, n, c) of sums (n, c) are the longest ones; equal ones count once."""
    longest, number = [], jnp.arange(len(size))[:, None]
    for _ in range(count):
        longest.append(number == jnp.argmax(size, axis=0))
        size = jnp.where(size > (1 - 1e-9) * jnp.max(size, axis=0), -1.0, size)
    return jnp.stack(longest)


def supremum(g: Lanes, layout: Layout) -> Supremum:
    """Where the phases are at the largest |dR|, and dR there."""
    every = all_curves(g, layout, slice(0, ROWS))
    held = constant(g.modes, layout, slice(0, ROWS), g.direct)
    tops = [_tops(f) for f in every]
    points = [_points(f, top) for f, top in zip(every, tops, strict=True)]
    longest = _best_sums(tops, jnp.concatenate(points, axis=2), held)
    starts = [_two_tops(f, longest) for f in every]
    times, sizes = jax.vmap(lambda begin: _refined(every, held, begin))(starts)
    best = jnp.arange(AGAIN)[:, None] == jnp.argmax(sizes, axis=0)
    times, steps = (
        [jnp.sum(jnp.where(best[:, None], t, 0.0), axis=0) for t in x]
        for x in (times, [first.step for first, _ in starts])
    )
    return Supremum(*climbed(every, held, times, steps, NEAREST)[:2])


def _refined(every: list[ModalCurves], held, starts: list[tuple[_Tops, _Tops]]):
    """Times of each phase and |dR|^2 there, from its best maxima in one direction.

    Up from the best ones; then once more, from the other of a phase's two where that is higher in
    the direction found.
    """
    steps = [first.step for first, _ in starts]

    def swapped(f: ModalCurves, d, now, other: _Tops):
        """The time of the higher maximum in the direction found."""
        time = jax.lax.fori_loop(
            0, ASCENDS, lambda _, t: ascended(f, d[:, None], t, other.step), other.time
        )
        height, rival = (summed(d[:, None] * values_at(f, t)[0]) for t in (now, time))
        return jnp.where(rival > height, time, now)

    def climb(turn, carry):
        begin, best, size = carry
        times, total, square = climbed(every, held, begin, steps, NEARER)
        best = [jnp.where(square > size, x, t) for x, t in zip(times, best, strict=True)]

        def others():
            d = unit(total)
            each = zip(every, times, starts, strict=True)
            return [swapped(f, d, t, other) for f, t, (_, other) in each]

        return jax.lax.cond(turn == 0, others, lambda: times), best, jnp.maximum(size, square)

    begin = [first.time for first, _ in starts]
    lowest = jnp.full(begin[0].shape[-1], -1.0)
    return jax.lax.fori_loop(0, 2, climb, (begin, begin, lowest))[1:]
