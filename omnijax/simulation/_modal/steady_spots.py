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

from .arithmetic import Pair, product, quotient, summed
from .gradient import Slopes, along_poles, seen
from .phases import (
    Phases,
    Spot,
    columns_of,
    cycle_of,
    given,
    ones,
    phases_of,
    response,
    with_edges,
)
from .poles import PolePairs
from .signals import CONSTANT, Signals
from .system import Layout
from .transient import Lanes


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


class _States(NamedTuple):
    """What pairs show at the spots of each figure (f), of every signal and the start (s)."""

    pole: Pair  # (f, s + 1, p, c), of a unit of the signal's column
    level: Float[Array, "f s c"]  # rho
    slope: Float[Array, "f s c"]  # drho/dt


def _states(g: Lanes, m: PolePairs, layout: Layout, spots: list[Spot]) -> _States:
    """The pairs `m` at the spots (f, s, c)."""
    figures, lanes = len(spots[0].time), m.l0.shape[-1]
    count = len(layout.kinds)
    pole = [jnp.zeros((figures, count + 1, len(m.kind), lanes)) for _ in range(2)]
    level, slope = (jnp.zeros((figures, count, lanes)) for _ in range(2))
    for phases, spot in zip(phases_of(layout), spots, strict=True):
        now = response(m, cycle_of(g.signals, layout, _of_each(phases, figures)), _flat(spot))
        at = np.array(phases.first)
        each = zip(pole, now.pole, strict=True)
        pole = [x.at[:, at].set(jnp.swapaxes(_apart(y, figures), 1, 2)) for x, y in each]
        level = level.at[:, at].set(_apart(now.level, figures))
        slope = slope.at[:, at].set(_apart(now.slope, figures))
    still = np.array([i for i, kind in enumerate(layout.kinds) if kind.phase == CONSTANT], int)
    held = quotient(m.kind, ones(m), (-m.l0, -m.l1))
    first, second = (x.at[:, still].set(y) for x, y in zip(pole, held, strict=True))
    return _States((first, second), level.at[:, still].set(1.0), slope)


def _of_each(phases: Phases, figures: int) -> Phases:
    """The phases once more for every figure."""
    return repeated(phases, figures * [*range(len(phases.first))])


def _flat(spot: Spot) -> Spot:
    """Spots (f, s, c) side by side."""
    return Spot(*(x.reshape(-1, x.shape[-1]) for x in spot))


def _apart(x, figures: int):
    """(..., f s, c) -> (f, ..., s, c)."""
    return jnp.moveaxis(x.reshape(*x.shape[:-2], figures, -1, x.shape[-1]), -3, 0)


def _over(x, by):
    """Sums over the figures (f) of x times `by` (m, f, ...)."""
    return functools.reduce(operator.add, (by[:, f] * x[f] for f in range(len(x))))


def spot_slopes(
    g: Lanes, layout: Layout, reached: AtSpots, by: Float[Array, "m f c"]
) -> tuple[Slopes, Float[Array, "f o c"]]:
    """Derivatives of sums of the figures, times `by`; and the outputs there, summed over phases."""
    m, weight, rows = g.modes, reached.weight, np.arange(layout.rows)
    c = [jnp.sum(weight[:, :, None] * x[rows], axis=1) for x in (m.c0, m.c1)]  # (f, p, c)
    own = [x[:, None] for x in seen(m.kind, (c[0], c[1]))]
    b = m.given([*(kind.column for kind in layout.kinds), -1])
    now, turned = along_poles(m, lambda m: _states(g, m, layout, reached.spots))
    on = by[:, :, None] * weight  # (m, f, o, c)
    shown, given = [], []
    for x in (now.pole, turned.pole):
        each = product(m.kind, own, x)  # (f, s + 1, p, c)
        shown.append(tuple(_over(y, by[:, :, None, None]) for y in each))
        given.append([summed(y, 1)[:, None] for y in product(m.kind, b, x)])  # (f, 1, p, c)
    on_rows = [tuple(_over(y, on[:, :, :, None]) for y in x) for x in given]
    straight = [_over(x[:, :, None], on[:, :, None]) for x in (now.level, now.slope)]
    signals = jax.vmap(
        lambda by: jax.grad(_figure, 3)(g, layout, reached, g.signals, (c[0], c[1]), by)
    )(by)
    columns = np.array([kind.column for kind in layout.kinds])
    outputs = jnp.sum(m.c0[rows] * given[0][0] + m.c1[rows] * given[0][1], axis=2)
    for x, y in ((g.direct, now.level), (g.slope, now.slope)):
        outputs = outputs + jnp.sum(x[columns][:, rows] * y[:, :, None], axis=1)
    return Slopes(shown[0], shown[1], on_rows[0], on_rows[1], signals, *straight), outputs


def _figure(g: Lanes, layout: Layout, reached: AtSpots, signals: Signals, c: Pair, by):
    """The sum of the figures times `by` (f, c), of other signals; `c` (f, p, c): what they show."""
    value, m, figures = 0.0, g.modes, len(by)
    rows = np.arange(layout.rows)
    direct, slope = (
        jnp.sum(reached.weight[:, None] * x[:, rows], axis=2) for x in (g.direct, g.slope)
    )  # (f, l, c)
    for phases, spot in zip(phases_of(layout), reached.spots, strict=True):
        every = _of_each(phases, figures)
        known, cycle = (cycle_of(x, layout, every) for x in (g.signals, signals))
        now = response(m, cycle, with_edges(known, _flat(spot), cycle))
        columns = columns_of(layout, phases)
        b = [x[None] for x in given(m, columns)]  # (1, p, s, c)
        z = product(m.kind[:, None], b, [_apart(x, figures) for x in now.pole])
        shown = summed(c[0][:, :, None] * z[0] + c[1][:, :, None] * z[1], 1)  # (f, s, c)
        shown = shown + direct[:, columns] * _apart(now.level, figures)
        shown = shown + slope[:, columns] * _apart(now.slope, figures)
        value += jnp.sum(by[:, None] * shown)
    return value
