"""Outputs of the long run along each phase in closed form at any time.

An output shows a state z of a pair as w0 Re E + w1 Im E after a time in which that pair moves by E
(or w0 E0 + w1 E1 of two real poles), so all of it is made of the weights w at the begin of every
piece and of what goes with the signals' sinusoids.
"""

import functools
from collections.abc import Callable, Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._poles import PolePairs
from .._tables import rate_of
from ..arithmetic import (
    Pair,
    flushed,
    materialised,
    onward,
    pair_exp,
    product,
    sincos,
    stored,
    summed,
    turned,
)
from ..lanes import Lanes
from ..system import Layout
from ..table_signals import moved_on
from .phases import (
    PhaseCycle,
    Phases,
    Spot,
    Wave,
    columns_of,
    cycle_of,
    follows,
    free_starts,
    piece_of,
    spot_on,
    wide,
)
from .table_wave import TablePlace, TableWave, at_piece, passed, starts_of

BEYOND = 1e-9  # of the period: where the next piece is on, whichever it is


class TableCurves(NamedTuple):
    """What outputs (r) show of the tables of phases."""

    wave: TableWave
    start: Pair  # (k, r, q, s, c), at the begin of each piece, of a unit of rho
    weight: Pair  # (r, q, s, c), of what that moves by
    direct: Float[Array, "r s c"]
    slope: Float[Array, "r s c"]


class ModalCurves(NamedTuple):
    """Some outputs (r) of phases of like kinds, each made of pairs of poles (q).

    Pairs that all outputs or all phases have in common stand once there, at an axis of length 1.
    """

    kind: Float[Array, "r q s c"]
    pole: Pair  # (r, q, s, c)
    show: Pair  # (r, q, s, c), of those pairs
    cycle: PhaseCycle
    free: tuple[Pair, ...]  # of each signal with edges: (r, q, k, s, c) at the begin of its pieces
    cosine: tuple[Array, ...]  # of each signal: (r, w, k, s, c)
    sine: tuple[Array, ...]
    table: TableCurves | None = None

    @property
    def waves(self) -> tuple[Wave, ...]:
        """All signals, those with edges first."""
        return *self.cycle.edged, *self.cycle.endless

    @property
    def outputs(self) -> int:
        """How many."""
        return len(self.show[0])


class ShownRows(NamedTuple):
    """Numbers of the outputs that curves are of, and of the pairs that those show."""

    rows: np.ndarray  # (r, s)
    pairs: np.ndarray  # (r or 1, q, s or 1)
    live: np.ndarray  # (r, q, s): whether an output shows that pair at all


def rows_shown(layout: Layout, phases: Phases, rows: Sequence[int]) -> list[list[int]]:
    """Which of the outputs `rows` each phase moves."""
    signal = layout.signal_of
    each = []
    for i in phases.first(layout):
        if i >= len(layout.kinds):
            each.append([row for row in rows if i - len(layout.kinds) in layout.tabled[row]])
            continue
        column = layout.kinds[i].column
        own = {v for v, of in enumerate(signal) if layout.kinds[of].column == column}
        each.append([row for row in rows if own & set(layout.waves[row])])
    return each


def shown_rows(layout: Layout, rows: Sequence[Sequence[int]]) -> ShownRows:
    """Pairs of these outputs of each phase: output by output where that makes fewer, or of all."""
    live = [[layout.live[row] for row in own] for own in rows]
    of_all = [[sorted(set().union(*own))] * len(own) for own in live]

    def most(each) -> int:
        return max(1, *(len(pairs) for own in each for pairs in own))

    outputs = len(rows[0])
    if outputs > 1 and outputs * most(live) > most(of_all):
        live = of_all
    count = most(live)
    padded = [[[*pairs, *[0] * (count - len(pairs))] for pairs in own] for own in live]
    index = np.array(padded).transpose(1, 2, 0)  # (r, q, s)
    there = [[[j < len(pairs) for j in range(count)] for pairs in own] for own in live]
    for axis in (0, 2):
        first = np.take(index, [0], axis=axis)
        index = first if np.all(index == first) else index
    return ShownRows(np.array(rows).T, index, np.array(there).transpose(1, 2, 0))


def curves_of(g: Lanes, layout: Layout, phases: Phases, shown: ShownRows) -> ModalCurves:
    """The outputs `shown` of these phases."""
    rows, pairs = shown.rows, shown.pairs
    cycle, columns = cycle_of(g.signals, layout, phases), columns_of(layout, phases)
    m = g.modes
    kind, *pole = (x[pairs] for x in (m.kind, m.l0, m.l1))
    flat = m._replace(**{
        name: x.reshape(-1, *x.shape[2:])
        for name, x in zip(("kind", "l0", "l1"), (kind, *pole), strict=True)
    })  # fmt: skip
    b = m.b0[columns, pairs], m.b1[columns, pairs]
    there = np.where(shown.live, 1.0, 0.0)[..., None]
    c = m.c0[rows[:, None], pairs] * there, m.c1[rows[:, None], pairs] * there
    direct, slope = g.direct[columns, rows], g.slope[columns, rows]  # (r, s, c)

    def by_pair(x):  # (..., p, s, c) -> (..., r, q, s, c)
        return x.reshape(-1, *pairs.shape[:2], *x.shape[2:])

    free, cosines, sines = [], [], []
    for wave in (*cycle.edged, *cycle.endless):
        r = follows(flat, wave)
        if len(wave.duration) > 1:
            y = free_starts(flat, wave, r)  # (k, p, s, c)
            y = product(kind, (by_pair(y[0]), by_pair(y[1])), b)
            y = [jnp.moveaxis(flushed(x), 0, 2) for x in y]
            free.append((y[0], y[1]))
        level, turn = (
            gain[:, None] - jnp.swapaxes(_seen(c, product(kind, (by_pair(x), by_pair(y)), b)), 0, 1)
            for gain, (x, y) in zip((direct, slope), r, strict=True)
        )
        level, turn = level[:, :, None], (wave.rate * turn)[:, :, None]  # (r, w, 1, s, c)
        cosine, sine = turned(wave.cosine, wave.sine, level, turn)
        cosines.append(cosine)
        sines.append(sine)
    pole, table = (pole[0], pole[1]), None
    if cycle.table is not None:
        starts = _table_starts(m, cycle, phases, pairs)
        table = TableCurves(cycle.table, starts, onward(kind, c, b), direct, slope)
    return ModalCurves(kind, pole, c, cycle, tuple(free), tuple(cosines), tuple(sines), table)


def _table_starts(m: PolePairs, cycle: PhaseCycle, phases: Phases, pairs: np.ndarray) -> Pair:
    """The pairs that outputs show where each piece of the phases' tables begins, (k, r, q, s, c).

    A table that belongs to several of the phases is passed once.
    """
    assert cycle.table is not None
    of_phases = list(phases.tables[0])
    numbers = [of_phases.index(t) for t in dict.fromkeys(of_phases)]
    duration, rho = (x[..., np.array(numbers), :] for x in cycle.table)
    starts = starts_of(wide(m), TableWave(duration, rho))
    phase = np.array([numbers.index(of_phases.index(t)) for t in of_phases])
    shown = np.broadcast_to(pairs, (*pairs.shape[:2], len(phase)))
    first, second = (x[:, shown, phase] for x in starts)
    return first, second


def phase_by_phase(function: Callable, f: ModalCurves, *own):
    """function(curves, *own) of one phase after the other, its results side by side again.

    Phases take very different numbers of blocks, and what one works with stays in the cache.
    """
    count = f.cycle.period.shape[0]
    if count == 1:
        return function(f, *own)
    leaves, tree = jax.tree.flatten((f, *own))
    apart = [x.shape[-2] == count for x in leaves]

    def one(parts):
        parts = iter(parts)
        each = [
            next(parts)[..., None, :] if yes else x for x, yes in zip(leaves, apart, strict=True)
        ]
        return function(*jax.tree.unflatten(tree, each))

    parts = [jnp.moveaxis(x, -2, 0) for x, yes in zip(leaves, apart, strict=True) if yes]
    return jax.tree.map(lambda x: jnp.moveaxis(x[..., 0, :], 0, -2), jax.lax.map(one, parts))


def _seen(c: Pair, z: Pair):
    """What outputs show of pairs, (..., r, s, c) of (..., r, q, s, c)."""
    shown = c[0] * z[0] + c[1] * z[1]
    return summed(shown, shown.ndim - 3)


def weights(f: ModalCurves, z: Pair) -> Pair:
    """What the outputs show of states that move on from z (..., q, s, c)."""
    return onward(f.kind, f.show, z)


def moved_by(f: ModalCurves, time) -> Pair:
    """exp(lambda time), (..., r, q, s, c), stored; `time` (..., 1, 1, s, c)."""

    def moved(time, kind, *pole):
        kind = jnp.broadcast_to(kind, jnp.broadcast_shapes(kind.shape, time.shape))
        return pair_exp(kind, (pole[0] * time, pole[1] * time))

    return stored(moved, time, f.kind, *f.pole)


def values_at(f: ModalCurves, spot: Spot, orders: int = 1) -> list[Array]:
    """The outputs (r, s, c) at a spot and their first `orders - 1` derivatives, stored."""
    return materialised(lambda f, spot: _values_at(f, spot, orders), f, spot)


def _values_at(f: ModalCurves, spot: Spot, orders: int) -> list[Array]:
    values = [jnp.zeros((f.outputs, *spot.time.shape)) for _ in range(orders)]
    for i, wave in enumerate(f.waves):
        here, into = piece_of(wave, spot)
        s, c = stored(lambda rate, into: sincos(rate * into), wave.rate, into)
        a, b = (summed(here * x[i], 2) for x in (f.cosine, f.sine))
        value, slope = turned(a, b, c, s)
        swing = [value, slope * wave.rate, -value * wave.rate**2]
        for n in range(orders):
            values[n] = values[n] + summed(swing[n], 1)
        if i < len(f.free):
            start = [summed(here * x, 2) for x in f.free[i]]  # (r, q, s, c)
            z = stored(_from, f.kind, f.pole, into, *start)
            for n in range(orders):
                values[n] = values[n] + _seen(f.show, z)
                z = product(f.kind, z, f.pole)
    if f.table is None:
        return values
    return [x + y for x, y in zip(values, _table_values(f, spot.time, orders), strict=True)]


def _table_values(f: ModalCurves, time, orders: int) -> list[Array]:
    """What tables add to `values_at` a time."""
    t = f.table
    assert t is not None
    piece, into = TablePlace.at(t.wave, time)
    rho, (z0, z1) = at_piece(t.wave.rho, piece), (at_piece(z, piece) for z in t.start)
    z = stored(lambda kind, *x: passed(kind, x[:2], x[2:4], *x[4:]), f.kind, *f.pole, z0, z1,
               into, rho)  # fmt: skip
    return shown_by_tables(f, z, moved_on(rho, into), orders)


def shown_by_tables(
    f: ModalCurves, z: Pair, rho: Float[Array, "4 s c"], orders: int
) -> list[Array]:
    """What outputs (r, s, c) show of tables with the response z to these levels, and its rates."""
    t = f.table
    assert t is not None
    values, rho = [], jnp.concatenate([rho, jnp.zeros_like(rho[:1])])
    for n in range(orders):
        values.append(_seen(t.weight, z) + t.direct * rho[n] + t.slope * rho[n + 1])
        z = rate_of(f.kind, f.pole, z, rho[n])
    return values


def _from(kind, pole: Pair, into, *start) -> Pair:
    """States `into` s after start."""
    kind = jnp.broadcast_to(kind, start[0].shape)
    return product(kind, start, pair_exp(kind, (pole[0] * into, pole[1] * into)))


def moved(spot: Spot, move) -> Spot:
    """The spot by `move` s further, as far as its pieces go."""
    return spot._replace(time=jnp.clip(spot.time + move, spot.begin, spot.end))


def beyond(f: ModalCurves, spot: Spot) -> Spot:
    """The other side of the edge that the spot is at, if it is at one."""
    last, first = spot.end + BEYOND * f.cycle.period, spot.begin - BEYOND * f.cycle.period
    near = jnp.where(spot.time >= spot.end, last, spot.near)
    near = jnp.where(spot.time <= spot.begin, first, near)
    return spot_on(f.cycle, spot.time, near)


def free_size(kind, w: Pair):
    """What the free parts of weights w never exceed from there on."""
    a, b = (jnp.abs(x) for x in w)
    return jnp.where(kind > 0, jnp.sqrt(a * a + b * b), a + b)


def size_of(f: ModalCurves) -> Float[Array, "r s c"]:
    """Above the size of every output."""
    total = jnp.zeros((1, 1, 1)) if f.table is None else _table_size(f, f.table)
    for y in f.free:
        pieces = ((y[0][:, :, k], y[1][:, :, k]) for k in range(y[0].shape[2]))
        each = [summed(free_size(f.kind, weights(f, z)), 1) for z in pieces]
        total = total + functools.reduce(jnp.maximum, each)
    for a, b in zip(f.cosine, f.sine, strict=True):
        total = total + jnp.max(jnp.sum(jnp.sqrt(a * a + b * b), axis=1), axis=1)
    return total


def _table_size(f: ModalCurves, t: TableCurves) -> Float[Array, "r s c"]:
    """Above the size of what outputs show of tables."""

    def one(most, piece):
        z, v, rho = piece
        size = jnp.abs(rho)
        level = size[0] + v * (size[1] + v / 2 * (size[2] + v / 3 * size[3]))
        rate = size[1] + v * (size[2] + v / 2 * size[3])
        k = f.kind > 0
        forced = (
            level * jnp.minimum(v, 1 / jnp.maximum(-pole, 1e-30))
            for pole in (f.pole[0], jnp.where(k, f.pole[0], f.pole[1]))
        )
        first, second = (jnp.abs(x) for x in t.weight)
        begun = free_size(f.kind, onward(f.kind, t.weight, z))
        one, two = forced
        more = jnp.where(k, jnp.sqrt(first**2 + second**2) * one, first * one + second * two)
        whole = summed(begun + more, 1) + jnp.abs(t.direct) * level + jnp.abs(t.slope) * rate
        return jnp.maximum(most, whole), None

    none = jnp.zeros((f.outputs, *f.cycle.period.shape))
    return jax.lax.scan(one, none, (t.start, t.wave.duration, t.wave.rho))[0]
