"""The long run's suprema of vectors of outputs: phases run independently of each other.

sup |sum_g x_g(phi_g)| = max over unit d of sum_g max_phi d . x_g(phi).  One pass over each phase
finds its largest value in directions all around.  Of such points each phase in turn takes the one
that makes the sum longest, in a few rounds; a second pass looks for each phase's two best maxima
of the length beside what the others add up to.  From there Newton's method climbs the length in
all phases at once.  Where every phase moves along one axis alone, as with orthogonal
contacts that do not move each other, all of an axis are at their largest or all at their smallest
(`figures`), so that no direction is looked for.
"""

import functools
import operator
from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Complex, Float

from ..._steady import sphere
from ..arithmetic import across, materialised, summed
from ..lanes import Lanes
from ..system import Layout
from .climb import ascended, chosen, climbed, following, move_up, unit
from .curves import (
    ModalCurves,
    beyond,
    curves_of,
    phase_by_phase,
    rows_shown,
    shown_rows,
    values_at,
)
from .pass_along import COARSE, LENGTH, Block, along
from .pass_tables import ROUGH, Interval, along_tables, highest
from .phases import Spot, constant, phases_of, spot_on

AROUND = 48  # directions of the search
DIRECTIONS = sphere(AROUND, 3)[: AROUND // 2]  # and their opposites
KEPT = 4  # of them gone on from
EXCHANGES = 3  # rounds in which each phase may take another point
AGAIN = 2  # sums beside which every phase is looked at once more
CLOSE = 0.99  # of the largest value: a maximum below is not gone on from
ASCENDS = 3  # rounds of Newton's method of a phase alone
NEARER, NEAREST = 3, 5  # and of all phases: in every sum, then in the longest
LOOKED = 8  # points looked at together
LOW = -1e300  # stands for "no maximum": finite, as `_tagged` writes an index into its last bits
_MASK = 63  # of the bits that tell which of up to 64 values a maximum is


class Supremum(NamedTuple):
    """The supremum: where each phase is, and what their outputs add up to."""

    spots: list[Spot]  # (s, c), of phases of like kinds
    total: Float[Array, "o c"]


def is_straight(layout: Layout, rows: np.ndarray) -> bool:
    """Whether every phase moves one of the outputs at most."""
    each = (rows_shown(layout, phases, rows.tolist()) for phases in phases_of(layout))
    return max(len(own) for group in each for own in group) <= 1


def _curves(g: Lanes, layout: Layout, rows: np.ndarray) -> list[ModalCurves]:
    """A vector of outputs of every phase."""
    return [
        curves_of(g, layout, phases, shown_rows(layout, [rows.tolist()] * phases.count))
        for phases in phases_of(layout)
    ]


def _tagged(x):
    """x (k, ...) with its last bits replaced by its number of k, for a maximum to keep."""
    bits = jax.lax.bitcast_convert_type(x, jnp.int64)
    number = jax.lax.broadcasted_iota(jnp.int64, x.shape, 0)
    return jax.lax.bitcast_convert_type((bits & ~_MASK) | number, jnp.float64)


class _Tops(NamedTuple):
    """The largest values so far in directions (d), `_tagged` with the sample of their block."""

    height: Float[Array, "*d s c"]
    place: Complex[Array, "*d s c"]  # s, of that block: its begin, and its step imaginary

    @property
    def time(self) -> Float[Array, "*d s c"]:
        """s, when they are taken."""
        return self.place.real + _number(self.height) * self.place.imag

    def spots(self, f: ModalCurves) -> Spot:
        """Then, on the pieces of that block."""
        middle = self.place.real + (LENGTH - 1) / 2 * self.place.imag
        on = functools.partial(spot_on, f.cycle)
        return (jax.vmap(on) if middle.ndim > f.cycle.period.ndim else on)(self.time, middle)

    @property
    def step(self) -> Float[Array, "*d s c"]:
        """s, between the samples there."""
        return self.place.imag


def _none(f: ModalCurves, count: int) -> _Tops:
    shape = count, *f.cycle.period.shape
    return _Tops(jnp.full(shape, -jnp.inf), jnp.zeros(shape, complex))


def _number(tagged):
    return jax.lax.bitcast_convert_type(tagged, jnp.int64) & _MASK


def _marked(x, number: int):
    """x with its last bits replaced by a number."""
    bits = jax.lax.bitcast_convert_type(x, jnp.int64)
    return jax.lax.bitcast_convert_type((bits & ~_MASK) | number, jnp.float64)


def _higher(known: _Tops, height, place) -> _Tops:
    """The higher ones of those known and of others."""
    better = height > known.height
    return _Tops(jnp.maximum(height, known.height), jnp.where(better, place, known.place))


def _tops(f: ModalCurves) -> _Tops:
    """In directions all around, by the samples."""
    d, n = jnp.asarray(DIRECTIONS)[:, :, None, None], len(DIRECTIONS)
    size = np.abs(DIRECTIONS)

    def extremes(x):
        """Largest and, imaginary, smallest values along the directions."""
        seen = [_marked(_along(d, y[None])[0], k) for k, y in enumerate(x)]
        return jax.lax.complex(
            functools.reduce(jnp.maximum, seen), functools.reduce(jnp.minimum, seen)
        )

    def highest_of(best: _Tops, x, counts, begin, step):
        both = materialised(extremes, x)
        height = jnp.concatenate([both.real, -both.imag])
        height = jnp.where(counts, height, -jnp.inf)
        return _higher(best, height, jax.lax.complex(begin, step))

    def gather(best: _Tops, x, block: Block):
        return highest_of(best, x, block.counts, block.begin, block.step)

    def gather_ends(best: _Tops, on: Interval):
        return highest_of(best, jnp.stack(on.value), on.counts, on.begin, on.length)

    def idle(best: _Tops, above):  # along each axis
        known = jnp.minimum(best.height[:n], best.height[n:])
        over = [sum(x * y for x, y in zip(own, above, strict=True)) for own in size]
        return functools.reduce(operator.and_, (x <= y for x, y in zip(over, known, strict=True)))

    if f.table is not None:
        return along_tables(f, gather_ends, _none(f, 2 * n), ROUGH)
    return along(f, gather, _none(f, 2 * n), idle, COARSE)


def _points(f: ModalCurves, top: _Tops) -> Float[Array, "d o s c"]:
    """The outputs at the maxima in directions all around, moved on by a parabola in time."""

    def one(at):
        d, spot, step = at[0][:, None, None], *at[1:]
        x, v, a = values_at(f, spot, 3)
        on = move_up(summed(d * v), summed(d * a), step)
        further = x + on * (v + 0.5 * on * a)
        return jnp.where(summed(d * further) > summed(d * x), further, x)

    every = jnp.concatenate([DIRECTIONS, -DIRECTIONS])
    return jax.lax.map(one, (every, top.spots(f), top.step), batch_size=LOOKED)


def _two_tops(f: ModalCurves, heights: Callable, start, count: int, idle: Callable, d=None):
    """By parabolas through three samples: the best two maxima of `count` heights.

    heights(start, x (r, s, c)) (n, s, c) are those of outputs x; for `idle` and `d` see `along`.
    """
    half = LENGTH // 2

    def tops(start, x, block: Block):
        """Largest maximum of a block's first half and, imaginary, of its second.

        Its ends are maxima where they lie at edges; else they stand inside the block beside.
        """
        seen = [heights(start, x[k]) for k in range(LENGTH)]
        best = [jnp.where(block.first & (seen[0] >= seen[1]), seen[0], LOW)]
        for before, now, after in zip(seen, seen[1:], seen[2:], strict=False):
            rise, bend = after - before, 2 * now - before - after
            inside = jnp.abs(rise) < 2 * bend
            more = jnp.where(inside, rise * rise / jnp.where(inside, 8 * bend, 1.0), LOW)
            best.append(now + more)
        best.append(jnp.where(block.last & (seen[-1] >= seen[-2]), seen[-1], LOW))
        best = [_marked(top, k) for k, top in enumerate(best)]
        halves = (functools.reduce(jnp.maximum, part) for part in (best[:half], best[half:]))
        return jax.lax.complex(*halves)

    def gather(best, x, block: Block):
        both = materialised(tops, start, x, block)
        both = both.real, both.imag
        place = jax.lax.complex(block.begin, block.step)
        high = jnp.where(block.counts, jnp.maximum(*both), -jnp.inf)
        low = jnp.where(block.counts, jnp.minimum(*both), -jnp.inf)
        return kept(best, high, low, place)

    def kept(best, high, low, place):
        first, second = best
        above = high > first.height
        lost = _Tops(*(jnp.where(above, x, y) for x, y in zip(first, second, strict=True)))
        return _higher(first, high, place), _higher(lost, jnp.where(above, low, high), place)

    def gather_inside(best, on: Interval):
        def top(start, on: Interval):
            high, at = highest(on, functools.partial(heights, start))
            return jax.lax.complex(_marked(high, 0), on.begin + at * on.length)

        both = materialised(top, start, on)
        place = jax.lax.complex(both.imag, jnp.broadcast_to(on.length, both.shape))
        return kept(best, both.real, jnp.full_like(both.real, -jnp.inf), place)

    if f.table is not None:
        return along_tables(f, gather_inside, (_none(f, count), _none(f, count)))
    return along(f, gather, (_none(f, count), _none(f, count)), idle, d=d)


def two_tops_of_each(f: ModalCurves, d: Float[Array, "n r c"]) -> tuple[_Tops, _Tops]:
    """In directions of each design, of one phase after the other."""
    d = d[:, :, None]

    def heights(d, x):
        return _along(d, x[None])[0]

    def idle(best, above):
        return functools.reduce(operator.and_, list(above <= CLOSE * best[0].height))

    return phase_by_phase(lambda f: _two_tops(f, heights, d, len(d), idle, d), f)


def _two_longest(f: ModalCurves, others: Float[Array, "n r s c"]) -> tuple[_Tops, _Tops]:
    """The best two maxima of each phase of the length of the sum with what the others add up to."""

    def heights(others, x):
        return summed((others + x) ** 2, 1)

    def one(f: ModalCurves, others):
        def idle(best, above):
            most = summed((jnp.abs(others) + above) ** 2, 1)
            return functools.reduce(operator.and_, list(most <= CLOSE**2 * best[0].height))

        return _two_tops(f, heights, others, len(others), idle)

    return phase_by_phase(one, f, others)


def _along(d, x):
    """d . x of directions (n, o, ...) and samples (k, o, s, c), (k, n, s, c)."""
    return functools.reduce(operator.add, (d[:, o] * x[:, None, o] for o in range(d.shape[1])))


def _exchanged(held, every: Float[Array, "s d o c"], begin: Bool[Array, "d c"], follow=None):
    """The sum (o, c) of a point of each phase (s, o, c), and which (s, d, c) of `every` they are.

    All phases begin with the same direction's point.  Then each in turn takes the point that makes
    the sum longest.  (The point furthest along the present sum would be the best only beside the
    others' present points.)  With the matrices `follow` (s, o, o, c) of `following`, the others
    move to their new maxima meanwhile; without, they stay.
    """
    picks = jnp.broadcast_to(begin, (len(every), *begin.shape))

    def picked(x, pick):
        return across(jnp.add, jnp.where(pick[:, None], x, 0.0))

    def square(x, follow):
        if follow is None:
            return summed(x**2, 1)
        return summed(x * (x + summed(follow * x[:, None], 2)), 1)

    def exchange(total, phase):
        some, now, follow = phase
        others = total - now
        size = _tagged(square(others + some, follow))  # (d, c)
        pick = size == across(jnp.maximum, size)
        now = picked(some, pick)
        return others + now, (now, pick)

    each = jax.vmap(picked)(every, picks)
    total = held + jnp.sum(each, axis=0)
    for _ in range(EXCHANGES):
        total, (each, picks) = jax.lax.scan(exchange, total, (every, each, follow))
    return total, each, picks


def _longest_sums(points: Float[Array, "d o s c"], held) -> Float[Array, "n o s c"]:
    """What all other phases add up to beside each, in the longest sums of points of each."""
    number, every = jnp.arange(len(points))[:, None], jnp.moveaxis(points, 2, 0)

    def follow(left, _):
        begin = number == jnp.argmax(left, axis=0)
        return jnp.where(begin, -jnp.inf, left), _exchanged(held, every, begin)[:2]

    farthest = jnp.sum((jnp.sum(every, axis=0) + held) ** 2, axis=1)  # (d, c)
    total, each = jax.lax.scan(follow, farthest, None, KEPT)[1]  # (n, o, c), (n, s, o, c)
    pick = _longest(jnp.sum(total**2, axis=1), AGAIN)
    others = jnp.moveaxis(total[:, None] - each, 1, 2)
    return jnp.sum(jnp.where(pick[:, :, None, None], others, 0.0), axis=1)


def _longest(size, count: int):
    """Which (count, n, c) of sums (n, c) are the longest ones; equal ones count once."""
    longest, number = [], jnp.arange(len(size))[:, None]
    for _ in range(count):
        longest.append(number == jnp.argmax(size, axis=0))
        size = jnp.where(size > (1 - 1e-9) * jnp.max(size, axis=0), -1.0, size)
    return jnp.stack(longest)


def suprema(g: Lanes, layout: Layout, rows: list[np.ndarray]) -> list[Supremum]:
    """Where the phases are at the greatest length of each vector of outputs, and it there.

    Vectors that show as many pairs of poles pass through one program.
    """
    given = [(_curves(g, layout, own), constant(g.modes, layout, own, g.direct)) for own in rows]
    alike: dict[str, list[int]] = {}
    for i, one in enumerate(given):
        alike.setdefault(str(jax.tree.map(jnp.shape, one)), []).append(i)
    tops: dict[int, Supremum] = {}
    for numbers in alike.values():
        some = [given[i] for i in numbers]
        if len(some) == 1:
            tops[numbers[0]] = _supremum(*some[0])
            continue
        each = jax.lax.map(
            lambda one: _supremum(*one), jax.tree.map(lambda *x: jnp.stack(x), *some)
        )
        tops |= {i: jax.tree.map(lambda x, k=k: x[k], each) for k, i in enumerate(numbers)}
    return [tops[i] for i in range(len(rows))]


def _supremum(every: list[ModalCurves], held: Float[Array, "o c"]) -> Supremum:
    tops = [phase_by_phase(_tops, f) for f in every]
    points = [_points(f, top) for f, top in zip(every, tops, strict=True)]
    others = _longest_sums(jnp.concatenate(points, axis=2), held)
    others = jnp.split(others, _ends(every), axis=2)
    starts = [_two_longest(f, own) for f, own in zip(every, others, strict=True)]
    spots, sizes = jax.vmap(lambda begin: _refined(every, held, begin))(starts)
    best = (jnp.arange(AGAIN)[:, None] == jnp.argmax(sizes, axis=0))[:, None]
    spots, steps = jax.tree.map(
        lambda t: jnp.sum(jnp.where(best, t, 0.0), axis=0),
        (spots, [first.step for first, _ in starts]),
    )
    return Supremum(*climbed(every, held, spots, steps, NEAREST)[:2])


def _ends(every: list[ModalCurves]) -> np.ndarray:
    """Where the phases of the next curves begin."""
    return np.cumsum([len(f.cycle.period) for f in every])[:-1]


def _refined(every: list[ModalCurves], held, starts: list[tuple[_Tops, _Tops]]):
    """Spots of each phase and the square of the sum there, from its best maxima beside the others.

    Up from the best ones; then once more, from the other of a phase's two, or from the other side
    of the edge that it has come to, where that makes the sum longer.
    """
    steps = [first.step for first, _ in starts]

    def rivals(f: ModalCurves, d, now: Spot, other: _Tops) -> Spot:
        """The spots now, and those that each phase may go to."""
        others = jax.tree.map(lambda *x: jnp.stack(x), beyond(f, now), other.spots(f))

        def climb(_, others: Spot) -> Spot:
            return jax.vmap(lambda spot: ascended(f, d[:, None], spot, other.step))(others)

        others = jax.lax.fori_loop(0, ASCENDS, climb, others)
        return jax.tree.map(lambda x, y: jnp.concatenate([x[None], y]), now, others)

    def exchanged(total, now: list[Spot]) -> list[Spot]:
        """With the rivals that make the sum longest."""
        d = unit(total)
        each = zip(every, now, starts, strict=True)
        some = [rivals(f, d, spot, other) for f, spot, (_, other) in each]
        points = [
            jax.vmap(lambda spot, f=f: values_at(f, spot)[0])(spots)
            for f, spots in zip(every, some, strict=True)
        ]
        points = jnp.moveaxis(jnp.concatenate(points, axis=2), 2, 0)  # (s, k, o, c)
        first = jnp.arange(points.shape[1])[:, None] == jnp.zeros(points.shape[-1], int)
        picks = _exchanged(held, points, first, following(every, now, total))[2]
        picks = jnp.moveaxis(picks, 1, 0)  # (k, s, c)
        return [
            jax.tree.map(lambda x, pick=pick: jnp.sum(jnp.where(pick, x, 0.0), axis=0), spots)
            for spots, pick in zip(some, jnp.split(picks, _ends(every), axis=1), strict=True)
        ]

    def climb(turn, carry):
        begin, best, size = carry
        spots, total, square = climbed(every, held, begin, steps, NEARER)
        best = [chosen(square > size, x, t) for x, t in zip(spots, best, strict=True)]
        begin = jax.lax.cond(turn == 0, lambda: exchanged(total, spots), lambda: spots)
        return begin, best, jnp.maximum(size, square)

    begin = [first.spots(f) for f, (first, _) in zip(every, starts, strict=True)]
    lowest = jnp.full(begin[0].time.shape[-1], -1.0)
    return jax.lax.fori_loop(0, 2, climb, (begin, begin, lowest))[1:]
