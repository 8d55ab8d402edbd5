"""The long run's supremum of |dR|: phases run independently of each other.

sup |sum_g x_g(phi_g)| = max over unit d of sum_g max_phi d . x_g(phi).  One pass over each phase
finds its largest value in directions all around; sums of such points give further directions;
from the best sum the phases' times and the direction are refined in turn.  Nothing of the search is
differentiated: by the envelope theorem derivatives are those of the formula at the times found.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._steady import sphere
from .arithmetic import materialised
from .curves import LENGTH, Curves, Rows, along, curves_of, values_at
from .gradient import ROWS
from .phases import columns_of, constant, cycle_of, phases_of
from .system import Layout
from .transient import Lanes

AROUND = 48  # directions of the search
DIRECTIONS = np.array([d for d in sphere(AROUND, 3) if d[2] > 0])  # and their opposites
KEPT = 8  # of them gone on from
ASCENTS = 4
AGAIN = 4  # sums in whose directions every phase is looked at once more
REFINED = 2  # of them
POINTS, ZOOMS = 33, 2
ROUNDS = 10
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


def _tops(f: Curves) -> _Tops:
    """In directions all around, by the samples."""
    d = jnp.asarray(DIRECTIONS)[:, :, None, None]

    def heights(x):
        seen = _along(d, x)
        high, low = (jnp.max(_tagged(y), axis=0) for y in (seen, -seen))
        return jnp.concatenate([high, low])

    return _pass(f, heights, 2 * len(DIRECTIONS))


def _tops_again(f: Curves, d) -> _Tops:
    """In directions (n, o, c) of each design, by parabolas through three samples."""
    d = d[:, :, None]

    def heights(x):
        seen = materialised(lambda x: _along(d, x), x)
        rise, bend = seen[2:] - seen[:-2], 2 * seen[1:-1] - seen[:-2] - seen[2:]
        inside = jnp.abs(rise) < 2 * bend
        more = jnp.where(inside, rise * rise / jnp.where(inside, 8 * bend, 1.0), 0.0)
        return jnp.max(_tagged(seen + jnp.pad(more, ((1, 1), (0, 0), (0, 0), (0, 0)))), axis=0)

    return _pass(f, heights, len(d))


def _along(d, x):
    """d . x of directions (n, o, ...) and samples (k, o, s, c), (k, n, s, c)."""
    return d[:, 0] * x[:, None, 0] + d[:, 1] * x[:, None, 1] + d[:, 2] * x[:, None, 2]


def _pass(f: Curves, heights, count: int) -> _Tops:
    """`heights` (n, s, c) of the samples of a block: largest values, tagged by their sample."""

    def gather(best: _Tops, x, begin, step) -> _Tops:
        top = heights(x)
        number = jax.lax.bitcast_convert_type(top, jnp.int64) & _MASK
        better = top > best.height
        return _Tops(
            jnp.where(better, top, best.height),
            jnp.where(better, begin + number * step, best.time),
            jnp.where(better, step, best.step),
        )

    shape = count, *f.cycle.period.shape
    none = _Tops(jnp.full(shape, -jnp.inf), jnp.zeros(shape), jnp.zeros(shape))
    return along(f, gather, none, lambda t: jnp.maximum(jnp.max(t.height, axis=0), 0.0))


def _unit(total):
    size = jnp.sqrt(jnp.sum(total**2, axis=0))
    return total / jnp.where(size > 0, size, 1.0)


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
            d = _unit(total)
            seen = sum(d[o] * points[:, o] for o in range(ROWS))  # (d, s, c)
            total = sums(number == jnp.argmax(seen, axis=0))
        return None, total

    totals = jax.lax.scan(follow, None, first)[1]  # (n, o, c)
    pick = _longest(jnp.sum(totals**2, axis=1), AGAIN)
    return jax.vmap(_unit)(jnp.sum(jnp.where(pick[:, :, None], totals, 0.0), axis=1))


def _longest(size, count: int):
    """Which (count, n, c) of sums (n, c) are the longest ones; equal ones count once."""
    found, number = [], jnp.arange(len(size))[:, None]
    for _ in range(count):
        found.append(number == jnp.argmax(size, axis=0))
        size = jnp.where(size > (1 - 1e-9) * jnp.max(size, axis=0), -1.0, size)
    return jnp.stack(found)


def _zoomed(f: Curves, d, time, step):
    """The largest of d . x on points around `time`, ever closer."""
    for _ in range(ZOOMS):
        around = jnp.linspace(-1.0, 1.0, POINTS)[:, None, None] * step + time

        def seen(t):
            return jnp.sum(d[:, None] * values_at(f, t)[0], axis=0)

        height = jax.vmap(seen)(around)
        pick = jnp.arange(POINTS)[:, None, None] == jnp.argmax(height, axis=0)
        time = jnp.sum(jnp.where(pick, around, 0.0), axis=0)
        step = 2 * step / (POINTS - 1)
    return time


def _climbed(f: Curves, d, time, step):
    """One step of Newton's method up d . x, and the outputs after it."""
    _, rise, bend = (jnp.sum(d[:, None] * x, axis=0) for x in values_at(f, time, 3))
    move = jnp.where(bend < 0, -rise / jnp.where(bend < 0, bend, -1.0), step * jnp.sign(rise))
    return time + jnp.clip(move, -step, step)


def supremum(g: Lanes, layout: Layout) -> Found:
    """Where the phases are at the largest |dR|, and dR there."""
    every = all_curves(g, layout, slice(0, ROWS))
    held = constant(g.modes, layout, slice(0, ROWS), g.direct)
    tops = [_tops(f) for f in every]
    found = [
        jax.vmap(lambda t, f=f: values_at(f, t)[0])(top.time)
        for f, top in zip(every, tops, strict=True)
    ]
    found = _best_sums(tops, jnp.concatenate(found, axis=2), held)
    tops = [_tops_again(f, found) for f in every]
    height = sum(jnp.sum(top.height, axis=1) for top in tops)  # (n, c)
    height = height + jnp.sum(found * held, axis=1)
    pick = _longest(height, REFINED)

    def picked(x):  # (n, ..., c) -> (REFINED, ..., c)
        wide = pick.reshape(*pick.shape[:2], *(1,) * (x.ndim - 2), pick.shape[-1])
        return jnp.sum(jnp.where(wide, x, 0.0), axis=1)

    def refined(begin):
        return _refined(every, held, *begin)

    starts = [(picked(top.time), picked(top.step)) for top in tops]
    times, sizes = jax.lax.map(refined, (picked(found), starts))
    best = jnp.arange(REFINED)[:, None] == jnp.argmax(sizes, axis=0)
    times = [jnp.sum(jnp.where(best[:, None], t, 0.0), axis=0) for t in times]
    return Found(times, _together(every, held, times))


def _together(every: list[Curves], held, times):
    """dR (o, c)."""
    return held + sum(
        jnp.sum(values_at(f, t)[0], axis=1) for f, t in zip(every, times, strict=True)
    )


def _refined(every: list[Curves], held, d, starts):
    """Times of each phase near the `starts` (time, step), and |dR|^2 there; d (o, c) to begin."""
    times = [_zoomed(f, d, *start) for f, start in zip(every, starts, strict=True)]

    def turn(carry, _):
        times, best, size = carry
        d = _unit(_together(every, held, times))
        times = [
            _climbed(f, d, t, step / 2)
            for f, t, (_, step) in zip(every, times, starts, strict=True)
        ]
        now = jnp.sum(_together(every, held, times) ** 2, axis=0)
        better = now > size
        best = [jnp.where(better, t, b) for t, b in zip(times, best, strict=True)]
        return (times, best, jnp.maximum(now, size)), None

    begin = times, times, jnp.sum(_together(every, held, times) ** 2, axis=0)
    return jax.lax.scan(turn, begin, None, length=ROUNDS)[0][1:]
