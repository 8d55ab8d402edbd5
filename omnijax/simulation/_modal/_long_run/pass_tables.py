"""The long run's outputs along phases with a table, interval by interval.

Each piece of a table is cut into as many intervals as the fastest pole asks for that still bends an
output there.  Designs pass the same piece together.  On an interval outputs are cubics through
their values and slopes at its ends.
"""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from ...._cubic import crossing
from ..._one_kernel import one_kernel
from .._tables import forced_on, rate_of, unit_moves
from ..arithmetic import Pair, across, materialised, sincos, stored, turned
from ..table_signals import moved_on
from .curves import ModalCurves, TableCurves, shown_by_tables, size_of

STEP = 0.3  # of a pole's 1/|lambda|: a cubic is within 2e-5 of what that moves
ROUGH = 1.0  # where directions are looked for, not times
BENDS = 2e-3  # of the largest bend: what bends less hardly moves a maximum
NOTHING = 1e-7  # of an output's size: not asked for
MOST = 4096  # intervals a piece
LOW = -1e300  # stands for "no maximum"


class Interval(NamedTuple):
    """Outputs (r, s, c) and their slopes at both ends."""

    begin: Float[Array, "s c"]  # s
    length: Float[Array, "s c"]  # s
    counts: Bool[Array, "s c"]
    value: tuple[Array, Array]
    slope: tuple[Array, Array]


def highest(interval: Interval, heights: Callable) -> tuple[Array, Array]:
    """The maximum inside of some heights(x) of the outputs, `LOW` without, and how far in it is.

    The period begins with a maximum too, so that each has one.
    """
    each = zip(interval.value, interval.slope, strict=True)
    (h0, s0), (h1, s1) = (jax.jvp(heights, (x,), (v,)) for x, v in each)
    s0, s1 = s0 * interval.length, s1 * interval.length
    inside = (s0 >= 0) & (s1 <= 0) & (s0 > s1)
    rise = h1 - h0
    bend, twist = 3 * rise - 2 * s0 - s1, s0 + s1 - 2 * rise
    at = jnp.clip(crossing(s0, bend, twist), 0.0, 1.0)
    top = h0 + at * (s0 + at * (bend + at * twist))
    first = interval.begin <= 0
    height = jnp.where(inside, top, jnp.where(first, h0, LOW))
    return jnp.where(interval.counts, height, -jnp.inf), jnp.where(inside, at, 0.0)


def _intervals(f: ModalCurves, t: TableCurves, size, share: float, piece) -> Float[Array, "s c"]:
    """How many intervals a piece is cut into."""
    z, after, v, rho = piece
    k = f.kind > 0
    z4 = z
    for r in rho:
        z4 = rate_of(f.kind, f.pole, z4, r)
    ends = shown_by_tables(f, z, rho, 3)[2], shown_by_tables(f, after, moved_on(rho, v), 3)[2]
    first, second = (jnp.abs(x) for x in t.weight)
    one, two = (jnp.abs(x) for x in z4)
    w, x = jnp.sqrt(first**2 + second**2), jnp.sqrt(one**2 + two**2)
    square = jnp.where(k, f.pole[0] ** 2 + f.pole[1] ** 2, f.pole[0] ** 2)
    parts = (
        (jnp.where(k, w * x, first * one), square),
        (jnp.where(k, 0.0, second * two), jnp.where(k, 0.0, f.pole[1] ** 2)),
    )
    safe = [(shown, jnp.maximum(own, 1e-30)) for shown, own in parts]
    bend = jnp.maximum(jnp.abs(ends[0]), jnp.abs(ends[1]))[:, None]
    bends = [shown * jnp.minimum(1 / own, v * v) for shown, own in safe]
    for x in bends:
        bend = jnp.maximum(bend, across(jnp.maximum, jnp.swapaxes(x, 0, 1))[:, None])
    fastest = jnp.zeros_like(v)
    for (shown, own), x in zip(safe, bends, strict=True):
        much = (x > BENDS * bend) & (shown > NOTHING * size[:, None] * own * own)
        each = jnp.where(much, own, 0.0)
        fastest = jnp.maximum(fastest, across(jnp.maximum, across(jnp.maximum, each)))
    for wave in f.cycle.endless:
        fastest = jnp.maximum(fastest, wave.rate[0] ** 2)
    count = jnp.clip(jnp.ceil(v * jnp.sqrt(fastest) / share), 1, MOST)
    return jnp.where(jnp.isnan(count), 1.0, count)  # others pass beside such a design


def along_tables(f: ModalCurves, gather: Callable, totals, share: float = STEP):
    """totals = gather(totals, interval) over one period of every phase."""
    t = f.table
    assert t is not None
    wave = t.wave
    size = size_of(f)
    size = jnp.maximum(size, NOTHING * jnp.max(size, axis=0))

    def shown(z: Pair, rho, time) -> list[Array]:
        values = shown_by_tables(f, z, rho, 2)
        for cycle, a, b in zip(f.cycle.endless, f.cosine, f.sine, strict=True):
            s, c = sincos(cycle.rate[0] * time)
            level, slope = turned(a[:, 0, 0], b[:, 0, 0], c, s)
            values = [values[0] + level, values[1] + cycle.rate[0] * slope]
        return values

    def seen(z: Pair, rho, time) -> list[Array]:
        return materialised(lambda *x: shown(x[:2], *x[2:]), *z, rho, time)

    def of_piece(carry, piece):
        totals, begin = carry
        z, _, v, rho = piece
        count = materialised(lambda *x: _intervals(f, t, size, share, x), *piece)
        h = v / count

        def moves(h, kind, *pole):
            over, forces = unit_moves(kind, pole, h)
            return [jax.lax.complex(*jnp.broadcast_arrays(*x)) for x in (over, *forces)]

        over, *forces = ((x.real, x.imag) for x in materialised(moves, h, f.kind, *f.pole))

        def more(state):
            totals, number, z, x, v = state
            here, later = moved_on(rho, number * h), moved_on(rho, (number + 1) * h)

            z = stored(lambda here, *z: forced_on(f.kind, z, over, forces, here), here, *z)
            begun = begin + number * h
            counts = (number < count) & (h > 0) & (begun < f.cycle.period * (1 - 1e-12))
            x1, v1 = seen(z, later, begin + (number + 1) * h)
            totals = gather(totals, Interval(begun, h, counts, (x, x1), (v, v1)))
            return totals, number + 1, z, x1, v1

        most = jnp.where(jnp.any(v > 0), jnp.max(count), 0.0)
        start = totals, jnp.zeros(()), z, *seen(z, rho, begin)
        totals = jax.lax.while_loop(lambda state: state[1] < most, more, start)[0]
        return (totals, begin + v), None

    def forward(totals):
        after = tuple(jnp.roll(x, -1, axis=0) for x in t.start)
        pieces = t.start, after, wave.duration, wave.rho
        repeats = jnp.nanmax(jnp.round(f.cycle.period / wave.period), initial=1.0)

        def period(state):
            number, totals = state
            begin = number * wave.period
            return number + 1, jax.lax.scan(of_piece, (totals, begin), pieces)[0][0]

        return jax.lax.while_loop(lambda s: s[0] < repeats, period, (jnp.zeros(()), totals))[1]

    return one_kernel(forward, totals)
