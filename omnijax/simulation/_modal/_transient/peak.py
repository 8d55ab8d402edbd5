"""Sums from which the derivatives of a run's refined peak follow, in closed form."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from .._poles import PolePairs
from ..arithmetic import (
    Pair,
    materialised,
    pair_exp,
    plus,
    product,
    sincos,
    summed,
    times,
    turned,
)
from ..gradient import seen
from ..lanes import ROWS, Lanes
from ..system import Layout
from .blocks import free_rates, stored_forced
from .edges import at_piece, by_signal, of_sinusoids
from .figures import Near, hermite_peak
from .output_sums import OutputSums, by_begins
from .passages import PassedEdges, edge_sums, left_of, of_edges, passages


def peak_sums(g: Lanes, layout: Layout, near: Near, step) -> tuple[Array, OutputSums]:
    """Square of the refined peak, and the sums of its derivatives by dR near there."""
    moments, x, v = near
    top, back = jax.vjp(lambda x, v: hermite_peak(x, v, moments, step), x, v)
    gx, gv = back(jnp.ones_like(top))
    # one of the cubics is above: its two ends have all the weight
    late = jnp.any((gx[2] != 0) | (gv[2] != 0), axis=0)
    ends = jnp.where(late, moments[1:], moments[:2])
    weights = (jnp.where(late, y[1:], y[:2]) for y in (gx, gv))

    both = jax.tree.map(lambda y: jnp.concatenate([y, y], axis=-1), g)  # a lane for each end
    sums = _sums_at(
        both, layout, *(jnp.concatenate([y[0], y[1]], axis=-1) for y in (ends, *weights))
    )
    lanes = top.shape[-1]
    return top, jax.tree.map(lambda y: y[..., :lanes] + y[..., lanes:], sums)


def _sums_at(g: Lanes, layout: Layout, time, gx, gv) -> OutputSums:
    """Sums of a figure whose derivatives are gx by dR and gv by its rate (o, c) at one time."""
    m, signals, of = g.modes, g.signals, layout.signal_of
    kind, pole = m.kind, (m.l0, m.l1)
    passed = passages(signals, layout, time)
    edge, by_poles = _edge_sums(m, passed, layout)
    own = seen(kind, (m.c0[:ROWS], m.c1[:ROWS]))
    shown = [(summed(own[0] * y[:, None]), summed(own[1] * y[:, None])) for y in (gx, gv)]  # (p, c)

    def weighed(by_x, by_v, weigh, a: Pair, rate: Pair) -> tuple[Pair, Pair]:
        """The weights times functions of the poles, and the derivative by the poles."""
        rated, slope = product(kind, pole, a), plus(a, product(kind, pole, rate))
        value = plus(weigh(by_x, a), weigh(by_v, rated))
        return value, plus(weigh(by_x, rate), weigh(by_v, slope))

    def as_shown(a: Pair, rate: Pair):
        return weighed(shown[0], shown[1], partial(product, kind), a, rate)

    timed = plus(times(time, edge), times(-1.0, by_poles))  # t_e exp(lambda (t - t_e))
    edge_time, _ = as_shown(timed, timed)
    decay = pair_exp(kind, times(time, pole))
    later = times(time, decay)
    few = m._replace(c0=m.c0[:ROWS], c1=m.c1[:ROWS])
    parts = stored_forced(few, signals, g.direct[:, :ROWS], g.slope[:, :ROWS], layout)
    rates = free_rates(m, signals, layout)

    def moved(edge: Pair, by_poles: Pair, decay: Pair, later: Pair) -> tuple[Pair, Pair]:
        moving = left_of(kind, rates, edge, decay)
        slope = plus(moving, left_of(kind, parts.free, by_poles, later))
        return left_of(kind, parts.free, edge, decay), slope

    z, rate = materialised(moved, edge, by_poles, decay, later)
    free = weighed(gx[:, None], gv[:, None], times, z, rate)  # (o, p, c)

    e = int(np.sum(of < len(passed.begun)))
    none = jnp.zeros_like(time)
    piece, begun = (of_sinusoids(y, of, none) for y in (passed.piece, passed.begun))
    into, rate = time - begun, signals.rate
    sn, cs = sincos(rate * into)  # (v, c)
    cos, sin, rated = cs[None], sn[None], rate[None]
    by_x, by_v = gx[:, None], gv[:, None]  # (o, 1, c)
    wave = by_x * cos - by_v * rated * sin, by_x * sin + by_v * rated * cos  # (o, v, c)
    here = piece[:, None] == jnp.arange(signals.cosine.shape[1])[:, None]  # (v, k, c)
    a, b = (at_piece(y, piece) for y in (parts.cosine, parts.sine))  # (o, v, c)
    level, slope = turned(a, b, cos, sin)
    late = summed(into * (by_x * slope - by_v * rate * level) + by_v * slope)
    by_into = summed(by_x * rate * slope - by_v * rate * rate * level)
    by_into = by_signal(by_into[:e], of[:e])
    first, second = (jnp.where(here, x[:, :, None], 0.0) for x in wave)
    begins = by_begins(by_into, passed.piece, passed.begun, signals.duration.shape[1])
    edges, starts = as_shown(edge, by_poles), as_shown(decay, later)
    return OutputSums(*edges, edge_time, *starts, *free, (first, second), late, *begins)


def _edge_sums(m: PolePairs, passed: PassedEdges, layout: Layout) -> list[Pair]:
    """`edge_sums` and their derivatives by the poles."""

    def both(kind, l0, l1):
        one = jnp.ones_like(l0), jnp.where(kind > 0, 0.0, 1.0)
        return jax.jvp(lambda *pole: edge_sums(kind, pole, passed), (l0, l1), one)

    return of_edges(both, m, passed, layout)
