"""Derivatives of what the long run reaches at spots of its phases, by the envelope theorem.

A figure adds up an output, or a sum of outputs, over all phases, each at a spot of its own.
Nothing of the search for the spots is differentiated.
"""

import functools
import operator
from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._poles import PolePairs
from ..arithmetic import Pair, product, quotient, summed
from ..gradient import Slopes, seen
from ..lanes import Lanes
from ..signals import CONSTANT, Signals
from ..system import Layout
from .phases import (
    PeriodicResponse,
    Phases,
    Spot,
    columns_of,
    cycle_of,
    given,
    of_each,
    ones,
    phases_of,
    response,
    wide,
    with_edges,
)
from .pulled import with_pull_back
from .table_wave import starts_of


class AtSpots(NamedTuple):
    """Figures (f) reached at spots: what they are, and of which outputs they are sums."""

    value: Float[Array, "f c"]
    weight: Float[Array, "f o c"]  # of the outputs that figures are made of
    spots: list[Spot]  # (f, s, c), of phases of like kinds


def together(parts: Sequence[AtSpots]) -> AtSpots:
    """Figures below each other."""
    return jax.tree.map(lambda *x: jnp.concatenate(x), *parts)


def repeated(phases: Phases, numbers: Sequence[int] | np.ndarray) -> Phases:
    """The phases of these numbers, any of them more than once."""
    return Phases(*(
        tuple(tuple(signal[i] for i in numbers) for signal in signals) for signals in phases
    ))  # fmt: skip


def _of_each(phases: Phases, figures: int) -> Phases:
    """The phases once more for every figure."""
    return repeated(phases, figures * [*range(phases.count)])


def _flat(spot: Spot) -> Spot:
    """Spots (f, s, c) side by side."""
    return Spot(*(x.reshape(-1, x.shape[-1]) for x in spot))


def _apart(x, figures: int):
    """(..., f s, c) -> (f, ..., s, c)."""
    return jnp.moveaxis(x.reshape(*x.shape[:-2], figures, -1, x.shape[-1]), -3, 0)


def _joined(x):
    """(..., f, s, c) -> (..., f s, c)."""
    return x.reshape(*x.shape[:-3], -1, x.shape[-1])


def _over(x, by):
    """Sums over the figures (f) of x times `by` (m, f, ...)."""
    return functools.reduce(operator.add, (by[:, f] * x[f] for f in range(len(x))))


def _responses(g: Lanes, layout: Layout, reached: AtSpots):
    """What pairs give at the spots, of phases of like kinds (f s); and the way back.

    What is largest at an edge moves with it.
    """
    groups, figures, m = phases_of(layout), len(reached.value), wide(g.modes)

    def with_edges_at(phases: Phases, spot: Spot):
        every = _of_each(phases, figures)
        known, at = cycle_of(g.signals, layout, every), _flat(spot)

        def responses(pole: Pair, signals: Signals) -> PeriodicResponse:
            now = cycle_of(signals, layout, every)
            return response(m._replace(l0=pole[0], l1=pole[1]), now, with_edges(known, at, now))

        return responses, of_each(g.modes, known)

    def with_table(phases: Phases, spot: Spot):
        def responses(pole: Pair, signals: Signals) -> PeriodicResponse:
            now, own = cycle_of(signals, layout, phases), m._replace(l0=pole[0], l1=pole[1])
            assert now.table is not None
            starts = starts_of(own, now.table)
            each = jax.vmap(lambda spot: response(own, now, spot, starts))(spot)
            return PeriodicResponse(
                (_side_by_side(each.pole[0]), _side_by_side(each.pole[1])),
                *(x.reshape(-1, x.shape[-1]) for x in (each.level, each.slope)),
            )

        return responses, of_each(g.modes, cycle_of(g.signals, layout, phases))

    each = [
        (with_table if phases.tables else with_edges_at)(phases, spot)
        for phases, spot in zip(groups, reached.spots, strict=True)
    ]
    functions, poles = zip(*each, strict=True)
    return with_pull_back(
        functions, groups, list(poles), g.signals, lambda part: _unit(g.modes, part),
        lambda part: part.pole,
    )  # fmt: skip


def _side_by_side(x):
    """(f, p, s, c) -> (p, f s, c)."""
    return _joined(jnp.moveaxis(x, 0, 1))


def _placed(layout: Layout, figures: int, each: Sequence[Array], still: Array | float) -> Array:
    """Of every signal and the start, (f, s + 1, ..., c), from values (..., f s, c) of phases.

    `still`: of a unit that is constant.
    """
    one = each[0]
    whole = jnp.zeros((figures, len(layout.columns) + 1, *one.shape[:-2], one.shape[-1]))
    for phases, x in zip(phases_of(layout), each, strict=True):
        own = jnp.moveaxis(_apart(x, figures), -2, 1)
        whole = whole.at[:, np.array(phases.first(layout))].set(own)
    constant = [i for i, kind in enumerate(layout.kinds) if kind.phase == CONSTANT]
    return whole.at[:, np.array(constant, int)].set(still)


def _placed_pairs(layout: Layout, figures: int, each: list[Pair], still: Pair) -> Pair:
    """Pairs `_placed`."""
    parts = zip(*each, strict=True)
    first, second = (_placed(layout, figures, *x) for x in zip(parts, still, strict=True))
    return first, second


def spot_slopes(
    g: Lanes, layout: Layout, reached: AtSpots, by: Float[Array, "m f c"]
) -> tuple[Slopes, Float[Array, "f o c"]]:
    """Derivatives of sums of the figures, times `by`; and the outputs there, summed over phases."""
    m, weight, rows, figures = g.modes, reached.weight, np.arange(layout.rows), len(reached.value)
    c = [jnp.sum(weight[:, :, None] * x[rows], axis=1) for x in (m.c0, m.c1)]  # (f, p, c)
    own = seen(m.kind, (c[0], c[1]))
    now, back = _responses(g, layout, reached)
    bars = [
        _bar(g, columns_of(layout, phases), own, weight, by[..., None, :])
        for phases in phases_of(layout)
    ]
    slopes, signals = back(m.kind, bars)
    held = quotient(m.kind, ones(m), (-m.l0, -m.l1))
    pole = _placed_pairs(layout, figures, [part.pole for part in now], held)
    turned = _placed_pairs(layout, figures, slopes, product(m.kind, held, held))
    level = _placed(layout, figures, [part.level for part in now], 1.0)[:, :-1]
    slope = _placed(layout, figures, [part.slope for part in now], 0.0)[:, :-1]
    b = m.given([*layout.columns, -1])
    on = by[:, :, None] * weight  # (m, f, o, c)
    shown, given = [], []
    for x in (pole, turned):
        each = product(m.kind, [y[:, None] for y in own], x)  # (f, s + 1, p, c)
        shown.append(tuple(_over(y, by[:, :, None, None]) for y in each))
        given.append([summed(y, 1)[:, None] for y in product(m.kind, b, x)])  # (f, 1, p, c)
    on_rows = [tuple(_over(y, on[:, :, :, None]) for y in x) for x in given]
    straight = [_over(x[:, :, None], on[:, :, None]) for x in (level, slope)]
    columns = np.array(layout.columns)
    outputs = jnp.sum(m.c0[rows] * given[0][0] + m.c1[rows] * given[0][1], axis=2)
    for x, y in ((g.direct, level), (g.slope, slope)):
        outputs = outputs + jnp.sum(x[columns][:, rows] * y[:, :, None], axis=1)
    return Slopes(shown[0], shown[1], on_rows[0], on_rows[1], signals, *straight), outputs


def _bar(
    g: Lanes, columns: np.ndarray, own: Pair, weight: Float[Array, "f o c"], by
) -> PeriodicResponse:
    """Derivatives of sums of figures times `by` (m, f, 1, c) by the responses of some phases.

    `own` (f, p, c): what the figures show of every pair.
    """
    m, rows = g.modes, np.arange(weight.shape[1])
    b = [x[:, None] for x in given(m, columns)]  # (p, 1, s, c)
    kind = m.kind[:, None, None]
    each = product(kind, [jnp.swapaxes(x, 0, 1)[:, :, None] for x in own], b)
    first, second = (_joined(by[:, None] * x) for x in seen(kind, (each[0], each[1])))
    level, slope = (
        _joined(by * jnp.sum(weight[:, None] * x[columns][:, rows], axis=2))
        for x in (g.direct, g.slope)
    )
    return PeriodicResponse((first, second), level, slope)


def _unit(m: PolePairs, part: PeriodicResponse) -> PeriodicResponse:
    """Of the sum of what every pole gives by itself."""
    one, none = jnp.ones_like(part.pole[0]), jnp.zeros_like(part.level)
    return PeriodicResponse((one, jnp.where(m.kind[:, None] > 0, 0.0, one)), none, none)
