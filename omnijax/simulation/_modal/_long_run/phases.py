"""Periodic signals at constant speeds: what runs together, and the response of each in closed form.

In the long run every wheel and every floor has a phase of its own.  The signals of one wheel share
its phase: a gap profile that repeats pitch by pitch, a damaged roller and a runout turn by turn.
Phases of like kinds stand beside each other (s) and pass through every formula together.  Where a
short program is worth more than a fast one, so do phases of unlike kinds that take about as long,
with signals of 0 for those that one of them lacks.  Pairs of poles as in `poles`, batch last.
"""

import functools
import itertools
import math
import operator
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from .._poles import PolePairs
from ..arithmetic import Pair, exp_less_one, pair_exp, product, quotient, sincos, summed, turned
from ..resonance import Resonance, resonance
from ..signals import CONSTANT, FOREVER, SILENT, Signals
from ..system import Layout
from .table_wave import TablePlace, TableWave, at_piece, moved_on, passed

TURN = 2 * math.pi
LACKING = -1  # number of a signal that a phase does not have


class Phases(NamedTuple):
    """What is static about phases that stand beside each other: their signals by their numbers.

    [signal of the phase][phase]; a phase may be `LACKING` some that others have.
    """

    edged: tuple[tuple[int, ...], ...]
    endless: tuple[tuple[int, ...], ...]
    tables: tuple[tuple[int, ...], ...] = ()  # one, of wheels with measured profiles, or none

    def first(self, layout: Layout) -> tuple[int, ...]:
        """One signal of each phase, tables after all others (see `Layout.columns`)."""
        tables = (tuple(len(layout.kinds) + t for t in own) for own in self.tables)
        each = zip(*tables, *self.edged, *self.endless, strict=True)
        return tuple(next(i for i in own if i != LACKING) for own in each)

    @property
    def count(self) -> int:
        """How many."""
        return len((*self.tables, *self.edged, *self.endless)[0])


def phases_of(layout: Layout) -> tuple[Phases, ...]:
    """All phases of a design; a constant force has none."""
    own: dict[int, list[int]] = {}
    for number, kind in enumerate(layout.kinds):
        if kind.phase not in (CONSTANT, SILENT):
            own.setdefault(kind.phase, []).append(number)

    def shape(numbers: list[int]):
        return tuple((layout.kinds[i].pieces, layout.kinds[i].waves) for i in numbers)

    def cost(numbers: list[int]):
        kinds = [layout.kinds[i] for i in numbers]
        return max(kind.waves for kind in kinds), sum(kind.pieces > 1 for kind in kinds) > 1

    beside = [own.pop(column, []) for column in layout.tables]  # a wheel's phase has its number
    alike = cost if layout.short else shape
    ordered = sorted(own.values(), key=alike)
    every = [_beside(same, layout) for _, same in itertools.groupby(ordered, key=alike)]
    if layout.tables:
        numbers = tuple(range(len(layout.tables)))
        every.append(_beside(beside, layout)._replace(tables=(numbers,)))
    return tuple(every)


def _beside(every: Iterable[list[int]], layout: Layout) -> Phases:
    """Phases of these signals side by side."""
    edged, endless = [], []
    for numbers in every:
        with_edges = [i for i in numbers if layout.kinds[i].pieces > 1]
        edged.append(with_edges)
        endless.append([i for i in numbers if i not in with_edges])

    def across(each: list[list[int]]):
        return tuple(itertools.zip_longest(*each, fillvalue=LACKING))

    return Phases(across(edged), across(endless))


class Wave(NamedTuple):
    """One signal of each phase, by its pieces (k) and sinusoids (w)."""

    duration: Float[Array, "k s c"]
    place: Float[Array, "s c"]  # s, at t = 0 since its period began
    rate: Float[Array, "w s c"]
    cosine: Float[Array, "w k s c"]
    sine: Float[Array, "w k s c"]

    @property
    def period(self) -> Float[Array, "s c"]:
        """s."""
        return jnp.sum(self.duration, axis=0)

    @property
    def begin(self) -> Float[Array, "k s c"]:
        """s, from the period's begin to that of each piece."""
        return jnp.cumsum(self.duration, axis=0) - self.duration


class PhaseCycle(NamedTuple):
    """The signals of phases beside each other; `endless` has one piece, all of one rate.

    A second signal with edges comes once a turn, and has the pieces and rates of the first.
    Phases with a table have none with edges.
    """

    edged: tuple[Wave, ...]
    endless: tuple[Wave, ...]
    period: Float[Array, "s c"]  # s, of the phase
    table: TableWave | None = None


def cycle_of(signals: Signals, layout: Layout, phases: Phases) -> PhaseCycle:
    """The phases' signals as arrays.

    A phase that lacks one of the edged signals is given the edges of its first signal; where it has
    none, one edge at the period's begin.
    """
    endless = [_endless(signals, layout, numbers) for numbers in phases.endless]
    kinds = [layout.kinds[i] for numbers in phases.edged for i in numbers if i != LACKING]
    size = max((k.waves for k in kinds), default=1), max((k.pieces for k in kinds), default=1)
    edged: list[Wave] = []
    for numbers in phases.edged:
        known = (edged or endless or [None])[0]
        edged.append(_edged(signals, layout, numbers, known, size))
    table = None
    if phases.tables:
        assert signals.tables is not None
        table = TableWave.of(signals.tables, phases.tables[0])
    period = (table or (edged or endless)[0]).period
    if (table or edged) and endless:  # at rest nothing repeats
        moves = _there(phases.endless[0]) & (endless[0].rate[0] != 0)
        period = jnp.where(moves, endless[0].period, period)
    for numbers, wave in zip(phases.edged[1:], edged[1:], strict=True):
        period = jnp.where(_there(numbers), wave.period, period)
    return PhaseCycle(tuple(edged), tuple(endless), period, table)


def _there(numbers: Sequence[int]) -> Bool[np.ndarray, "s 1"]:
    """Which phases have a signal."""
    return np.array(numbers)[:, None] != LACKING


def _sinusoids(signals: Signals, layout: Layout, numbers: Sequence[int], size: tuple[int, int]):
    """Rates (w, s, c) and amplitudes (w, k, s, c) of one signal of each phase; `size`: w, k."""
    waves, pieces = size
    first = np.cumsum([0, *(kind.waves for kind in layout.kinds)])
    rows = np.full((waves, len(numbers)), LACKING)
    for s, i in enumerate(numbers):
        if i != LACKING:
            rows[: layout.kinds[i].waves, s] = np.arange(first[i], first[i + 1])
    parts = signals.rate, signals.cosine[:, :pieces], signals.sine[:, :pieces]
    if LACKING in rows:
        parts = (jnp.concatenate([x, jnp.zeros_like(x[:1])]) for x in parts)
    rate, cosine, sine = (x[rows] for x in parts)
    return rate, jnp.swapaxes(cosine, 1, 2), jnp.swapaxes(sine, 1, 2)


def _endless(signals: Signals, layout: Layout, numbers: Sequence[int]) -> Wave:
    """A signal without edges."""
    rate, cosine, sine = _sinusoids(signals, layout, numbers, (1, 1))
    still = rate[0] == 0
    length = jnp.where(still, 1.0, TURN / jnp.where(still, 1.0, jnp.abs(rate[0])))
    return Wave(length[None], 0.0 * length, rate, cosine, sine)


def _edged(
    signals: Signals, layout: Layout, numbers: Sequence[int], known: Wave | None,
    size: tuple[int, int],
) -> Wave:  # fmt: skip
    """A signal with edges; phases that lack it have the pieces `known`."""
    there, pieces = _there(numbers), size[1]
    number = np.where(there[:, 0], numbers, 0)  # signals with edges come first
    duration = jnp.swapaxes(signals.duration[number, :pieces], 0, 1)
    duration = jnp.where(duration >= FOREVER, 1.0, duration)
    begin = jnp.cumsum(duration, axis=0) - duration
    here = jnp.arange(pieces)[:, None, None] == signals.piece[number]
    place = jnp.sum(jnp.where(here, begin, 0.0), axis=0) + signals.since[number]
    if not there.all():
        assert known is not None
        room = ((0, pieces - len(known.duration)), (0, 0), (0, 0))
        duration = jnp.where(there, duration, jnp.pad(known.duration, room))
        place = jnp.where(there, place, known.place)
    return Wave(duration, place, *_sinusoids(signals, layout, numbers, size))


def longest_period(signals: Signals, layout: Layout) -> Array:
    """s, of all phases of a batch; signals batch first."""
    last = jax.tree.map(lambda x: jnp.moveaxis(x, 0, -1), signals)
    cycles = [cycle_of(last, layout, phases) for phases in phases_of(layout)]
    return jnp.nanmax(jnp.concatenate([cycle.period.ravel() for cycle in cycles]))


def wide(m: PolePairs) -> PolePairs:
    """The poles alone, (p, 1, c)."""
    return m._replace(kind=m.kind[:, None], l0=m.l0[:, None], l1=m.l1[:, None])


def of_each(m: PolePairs, cycle: PhaseCycle) -> Pair:
    """The poles once for every phase, (p, s, c)."""
    m, room = wide(m), jnp.zeros_like(cycle.period)
    return m.l0 + room, m.l1 + room


def ones(m: PolePairs) -> Pair:
    """The pair 1."""
    return jnp.ones_like(m.l0), jnp.where(m.kind > 0, 0.0, 1.0)


def follows(m: PolePairs, wave: Wave) -> Resonance:
    """What a unit of the phases' column gives to the pairs by every sinusoid, (w, p, s, c)."""
    return resonance(m, wave.rate[:, None])


def _levels(wave: Wave, angle) -> Pair:
    """Levels and slopes of the sinusoids of every piece at an angle, (w, k, s, c)."""
    s, c = sincos(angle)
    level, slope = turned(wave.cosine, wave.sine, c, s)
    return level, wave.rate[:, None] * slope


def free_starts(m: PolePairs, wave: Wave, r: Resonance) -> Pair:
    """The free part at the begin of every piece of the periodic response, (k, p, s, c)."""
    end = _levels(wave, wave.rate[:, None] * wave.duration)
    begin = wave.cosine, wave.rate[:, None] * wave.sine
    jump = [(x - jnp.roll(y, 1, axis=1))[:, :, None] for x, y in zip(begin, end, strict=True)]
    wide_ = Resonance(*((x[:, None], y[:, None]) for x, y in r))
    jump = [summed(x) for x in wide_.lag(*jump)]  # (k, p, s, c)
    pole = m.l0, m.l1
    decay = pair_exp(m.kind, (pole[0] * wave.duration[:, None], pole[1] * wave.duration[:, None]))
    carried = jump[0][0], jump[1][0]  # what reaches the begin of piece 0
    over = ones(m)
    for k in range(len(wave.duration) - 1, 0, -1):
        over = product(m.kind, over, (decay[0][k], decay[1][k]))
        more = product(m.kind, over, (jump[0][k], jump[1][k]))
        carried = carried[0] + more[0], carried[1] + more[1]
    whole = exp_less_one(m.kind, (pole[0] * wave.period, pole[1] * wave.period))
    y = quotient(m.kind, carried, (-whole[0], -whole[1]))
    starts = [y]
    for k in range(1, len(wave.duration)):
        y = product(m.kind, y, (decay[0][k - 1], decay[1][k - 1]))
        y = y[0] + jump[0][k], y[1] + jump[1][k]
        starts.append(y)
    return jnp.stack([x[0] for x in starts]), jnp.stack([x[1] for x in starts])


class PeriodicResponse(NamedTuple):
    """The periodic response of every pair to one unit of a phase's column at one time."""

    pole: Pair  # (p, s, c)
    level: Float[Array, "s c"]  # rho
    slope: Float[Array, "s c"]  # drho/dt


class Spot(NamedTuple):
    """A time of each phase, and begin and end of the pieces that its signals are taken to be on.

    At an edge that says which of its sides is meant.  Signals without edges have no such end.
    """

    time: Float[Array, "s c"]  # s
    begin: Float[Array, "s c"]  # s
    end: Float[Array, "s c"]  # s

    @property
    def near(self) -> Float[Array, "s c"]:
        """A time inside the pieces, s."""
        return 0.5 * (self.begin + self.end)


def spot_on(cycle: PhaseCycle, time, near) -> Spot:
    """That time, on the pieces that the signals are on at the time `near`."""
    begin, end = jnp.full_like(near, -FOREVER), jnp.full_like(near, FOREVER)
    for wave in cycle.edged:
        here, into = piece_at(wave, near)
        begin = jnp.maximum(begin, near - into)
        end = jnp.minimum(end, near - into + summed(here * wave.duration))
    return Spot(time, begin, end)


def piece_at(wave: Wave, time):
    """A one at the piece (k, s, c) that each signal is on, and the time since it began."""
    begin = wave.begin
    if len(begin) == 1:
        return jnp.ones_like(begin), time
    local = jnp.mod(time + wave.place, wave.period)
    piece = summed(jnp.where(local >= begin[1:], 1, 0))
    here = jnp.where(jnp.arange(len(begin))[:, None, None] == piece, 1.0, 0.0)
    return here, local - summed(here * begin)


def piece_of(wave: Wave, spot: Spot):
    """`piece_at` of a spot."""
    here, into = piece_at(wave, spot.near)
    return here, into + (spot.time - spot.near)


def with_edges(known: PhaseCycle, spot: Spot, cycle: PhaseCycle) -> Spot:
    """The spot for signals `cycle` that differ a little from those `known`.

    What is largest at an edge moves with it; elsewhere nothing hangs on the time.
    """
    if not known.edged:
        return spot
    close = 1e-12 * known.period
    here, into = piece_of(known.edged[0], spot)
    first, last = into <= close, into >= summed(here * known.edged[0].duration) - close
    here, into = piece_at(cycle.edged[0], spot.near)
    begin = spot.near - into
    end = begin + summed(here * cycle.edged[0].duration)
    return spot._replace(time=jnp.where(first, begin, jnp.where(last, end, spot.time)))


def response(
    m: PolePairs, cycle: PhaseCycle, spot: Spot, starts: Pair | None = None
) -> PeriodicResponse:
    """The response at a spot, at any time of the periodic motion.

    Of `wide` modes, or of modes (p, s, c) of each phase; `starts`: those of the phases' tables.
    """
    of_phases = []
    if cycle.table is not None:
        assert starts is not None
        of_phases.append(_table_response(m, cycle.table, starts, spot.time))
    for wave in (*cycle.edged, *cycle.endless):
        r = follows(m, wave)
        here, into = piece_of(wave, spot)
        free = None
        if len(wave.duration) > 1:
            start = [jnp.sum(here[:, None] * y, axis=0) for y in free_starts(m, wave, r)]
            free = product(m.kind, start, pair_exp(m.kind, (m.l0 * into, m.l1 * into)))
        levels = _levels(wave, (wave.rate * into)[:, None])
        level, slope = (jnp.sum(here * x, axis=1) for x in levels)  # (w, s, c)
        now = [-summed(x) for x in r.lag(level[:, None], slope[:, None])]
        if free is not None:
            now = [x + y for x, y in zip(now, free, strict=True)]
        level, slope = jnp.sum(level, axis=0), jnp.sum(slope, axis=0)
        of_phases.append((*now, level, slope))
    first, second, level, slope = (
        functools.reduce(operator.add, x) for x in zip(*of_phases, strict=True)
    )
    return PeriodicResponse((first, second), level, slope)


def _table_response(m: PolePairs, wave: TableWave, starts: Pair, time):
    """The response at a time to the phases' tables, and their levels and slopes."""
    piece, into = TablePlace.at(wave, time)
    begin, rho = (at_piece(starts[0], piece), at_piece(starts[1], piece)), at_piece(wave.rho, piece)
    z = passed(m.kind, (m.l0, m.l1), begin, into, rho)
    return (*z, *moved_on(rho, into)[:2])


def columns_of(layout: Layout, phases: Phases) -> np.ndarray:
    """The input column of each phase."""
    return np.array(layout.columns)[list(phases.first(layout))]


def given(m: PolePairs, columns: np.ndarray) -> Pair:
    """What the phases' columns give to the pairs, (p, s, c)."""
    return jnp.swapaxes(m.b0[columns], 0, 1), jnp.swapaxes(m.b1[columns], 0, 1)


def constant_columns(layout: Layout) -> np.ndarray:
    """The columns of what is constant."""
    return np.array([kind.column for kind in layout.kinds if kind.phase == CONSTANT], int)


def constant(m: PolePairs, layout: Layout, rows: np.ndarray, direct) -> Float[Array, "o c"]:
    """The outputs `rows` that a constant force holds; `direct` (l, o, c)."""
    number = constant_columns(layout)
    z = quotient(m.kind, (m.b0[number], m.b1[number]), (-m.l0, -m.l1))
    z = [jnp.sum(x, axis=0) for x in z]
    seen = jnp.sum(m.c0[rows] * z[0] + m.c1[rows] * z[1], axis=1)
    return seen + jnp.sum(direct[number][:, rows], axis=0)
