"""The long run's suprema of vectors of outputs: phases run independently of each other.

sup |sum_g x_g(phi_g)| = max over unit d of sum_g max_phi d . x_g(phi).  One pass over each phase
finds its largest value in directions all around; sums of such points give further directions, in
which a second pass looks for each phase's two best maxima.  From there Newton's method climbs the
length in all phases at once.  Where every phase moves along one axis alone, as with orthogonal
contacts that do not move each other, all of an axis are at their largest or all at their smallest
(`steady_figures`), so that no direction is looked for.
"""

import functools
import operator
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float

from .._steady import sphere
from .arithmetic import across, materialised, summed
from .climb import ascended, chosen, climbed, move_up, unit
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
from .phases import Spot, constant, phases_of, spot_on
from .system import Layout
from .transient import ROWS, Lanes

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

    spots: list[Spot]  # (s, c), of phases of like kinds
    total: Float[Array, "o c"]


def is_straight(layout: Layout, rows: np.ndarray) -> bool:
    """Whether every phase moves one of the outputs at most."""
    each = (rows_shown(layout, phases, rows.tolist()) for phases in phases_of(layout))
    return max(len(own) for group in each for own in group) <= 1


def _curves(g: Lanes, layout: Layout, rows: np.ndarray) -> list[ModalCurves]:
    """A vector of outputs of every phase."""
    return [
        curves_of(g, layout, phases, shown_rows(layout, [rows.tolist()] * len(phases.first)))
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

    def gather(best: _Tops, x, block: Block):
        both = materialised(extremes, x)
        height = jnp.concatenate([both.real, -both.imag])
        height = jnp.where(block.counts, height, -jnp.inf)
        return _higher(best, height, jax.lax.complex(block.begin, block.step))

    def idle(best: _Tops, above):  # along each axis
        known = jnp.minimum(best.height[:n], best.height[n:])
        over = [sum(x * y for x, y in zip(own, above, strict=True)) for own in size]
        return functools.reduce(operator.and_, (x <= y for x, y in zip(over, known, strict=True)))

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


def _two_tops(f: ModalCurves, d: Float[Array, "n r c"]) -> tuple[_Tops, _Tops]:
    """In directions of each design, by parabolas through three samples: the best two maxima."""
    d, half = d[:, :, None], LENGTH // 2

    def tops(d, x):
        """Largest of a block's first half and, imaginary, of its second."""
        seen = [_along(d, x[k][None])[0] for k in range(LENGTH)]  # (n, s, c)
        best = [seen[0]]
        for before, now, after in zip(seen, seen[1:], seen[2:], strict=False):
            rise, bend = after - before, 2 * now - before - after
            inside = jnp.abs(rise) < 2 * bend
            more = jnp.where(inside, rise * rise / jnp.where(inside, 8 * bend, 1.0), 0.0)
            best.append(now + more)
        best = [_marked(top, k) for k, top in enumerate([*best, seen[-1]])]
        halves = (functools.reduce(jnp.maximum, part) for part in (best[:half], best[half:]))
        return jax.lax.complex(*halves)

    def gather(best, x, block: Block):
        both = materialised(tops, d, x)
        both = both.real, both.imag
        place = jax.lax.complex(block.begin, block.step)
        high = jnp.where(block.counts, jnp.maximum(*both), -jnp.inf)
        low = jnp.where(block.counts, jnp.minimum(*both), -jnp.inf)
        first, second = best
        above = high > first.height
        lost = _Tops(*(jnp.where(above, x, y) for x, y in zip(first, second, strict=True)))
        return _higher(first, high, place), _higher(lost, jnp.where(above, low, high), place)

    def idle(best, above):
        return functools.reduce(operator.and_, list(above <= CLOSE * best[0].height))

    return along(f, gather, (_none(f, len(d)), _none(f, len(d))), idle, d=d)


def two_tops_of_each(f: ModalCurves, d: Float[Array, "n r c"]) -> tuple[_Tops, _Tops]:
    """The same of one phase after the other."""
    return phase_by_phase(lambda f: _two_tops(f, d), f)


def _along(d, x):
    """d . x of directions (n, o, ...) and samples (k, o, s, c), (k, n, s, c)."""
    return functools.reduce(operator.add, (d[:, o] * x[:, None, o] for o in range(d.shape[1])))


def _best_sums(tops: list[_Tops], points, held):
    """Directions (n, o, c) of the longest sums of points of each phase; `points` (d, o, s, c)."""
    height = sum(jnp.sum(t.height, axis=1) for t in tops)  # (d, c)
    every = jnp.concatenate([DIRECTIONS, -DIRECTIONS])
    height = height + jnp.einsum("do,oc->dc", every, held)
    number = jnp.arange(len(every))[:, None, None]

    def sums(pick):
        """Total (o, c) of the points picked (d, s, c)."""
        return summed(across(jnp.add, jnp.where(pick[:, None], points, 0.0)), 1) + held

    def follow(left, _):
        begin = jnp.argmax(left, axis=0)
        total = sums(jnp.broadcast_to(number == begin, (*points.shape[:1], *points.shape[2:])))
        for _ in range(ASCENTS):
            d = unit(total)
            seen = _tagged(sum(d[o] * points[:, o] for o in range(ROWS)))  # (d, s, c)
            total = sums(seen == across(jnp.maximum, seen))
        return jnp.where(number[:, 0] == begin, -jnp.inf, left), total

    totals = jax.lax.scan(follow, height, None, KEPT)[1]  # (n, o, c)
    pick = _longest(jnp.sum(totals**2, axis=1), AGAIN)
    return jax.vmap(unit)(jnp.sum(jnp.where(pick[:, :, None], totals, 0.0), axis=1))


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
    longest = _best_sums(tops, jnp.concatenate(points, axis=2), held)
    starts = [two_tops_of_each(f, longest) for f in every]
    spots, sizes = jax.vmap(lambda begin: _refined(every, held, begin))(starts)
    best = (jnp.arange(AGAIN)[:, None] == jnp.argmax(sizes, axis=0))[:, None]
    spots, steps = jax.tree.map(
        lambda t: jnp.sum(jnp.where(best, t, 0.0), axis=0),
        (spots, [first.step for first, _ in starts]),
    )
    return Supremum(*climbed(every, held, spots, steps, NEAREST)[:2])


def _refined(every: list[ModalCurves], held, starts: list[tuple[_Tops, _Tops]]):
    """Spots of each phase and the square of the sum there, from its best maxima in one direction.

    Up from the best ones; then once more, from the other of a phase's two, or from the other side
    of the edge that it has come to, where that is higher in the direction found.
    """
    steps = [first.step for first, _ in starts]

    def swapped(f: ModalCurves, d, now: Spot, other: _Tops) -> Spot:
        """The spot of the highest maximum in the direction found."""
        rivals = jax.tree.map(lambda *x: jnp.stack(x), beyond(f, now), other.spots(f))

        def climb(_, rivals: Spot) -> Spot:
            return jax.vmap(lambda spot: ascended(f, d[:, None], spot, other.step))(rivals)

        def height(spot: Spot):
            return summed(d[:, None] * values_at(f, spot)[0])

        rivals = jax.lax.fori_loop(0, ASCENDS, climb, rivals)
        highest, heights = height(now), jax.vmap(height)(rivals)
        for k in range(len(heights)):
            rival = jax.tree.map(lambda x, k=k: x[k], rivals)
            now = chosen(heights[k] > highest, rival, now)
            highest = jnp.maximum(highest, heights[k])
        return now

    def climb(turn, carry):
        begin, best, size = carry
        spots, total, square = climbed(every, held, begin, steps, NEARER)
        best = [chosen(square > size, x, t) for x, t in zip(spots, best, strict=True)]

        def others():
            d = unit(total)
            each = zip(every, spots, starts, strict=True)
            return [swapped(f, d, t, other) for f, t, (_, other) in each]

        return jax.lax.cond(turn == 0, others, lambda: spots), best, jnp.maximum(size, square)

    begin = [first.spots(f) for f, (first, _) in zip(every, starts, strict=True)]
    lowest = jnp.full(begin[0].time.shape[-1], -1.0)
    return jax.lax.fori_loop(0, 2, climb, (begin, begin, lowest))[1:]
