"""Derivatives of a figure from sums of its derivatives by dR along a run.

A figure whose derivatives by the outputs at the times t are the weights g_o(t) has derivatives by
poles, residues and signals that follow from sums of g_o against what a run is made of.  With the
edges k that a signal passes at t_e = t_k + n period, a unit of its column leaves free

    sum_k jump_k sum_n exp(lambda (t - t_e)) + lag exp(lambda t)

where jumps, the lag at the start and what moves with the sinusoids are a resonance times levels and
slopes (`resonance`, `edges`).
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..arithmetic import Pair, materialised, plus, product, rows, summed, times, turned
from ..gradient import Slopes, seen
from ..lanes import Lanes
from ..resonance import Resonance, by_pole, by_rate, resonance
from ..signals import Signals
from ..system import Layout
from .blocks import shown
from .edges import Edges, by_signal, edge_times, edges_of


class OutputSums(NamedTuple):
    """Sums over all times t of the weights g_o(t), or of sum_o g_o c_o as outputs show pairs."""

    edge: Pair  # (g, k, p, c): as shown, times exp(lambda (t - t_e)) of all passages
    edge_rate: Pair  # derivative of `edge` by the poles
    edge_time: Pair  # `edge` times t_e
    start: Pair  # (p, c): as shown, times exp(lambda t)
    start_rate: Pair
    free: Pair  # (o, p, c): times the free part of the pairs
    free_rate: Pair  # derivative of `free` by the poles
    wave: tuple[Array, Array]  # (o, v, k, c): times cos and sin over each piece
    late: Float[Array, "v c"]  # derivative by the rates, at fixed begins of the pieces
    begin: Float[Array, "g k c"]  # derivative by the begin of each piece
    begin_time: Float[Array, "g k c"]  # the same times those begins, s
    since: Float[Array, "g c"]  # derivative by `Signals.since` before the first edge


class _Known(NamedTuple):
    """What the figure is linear in; or its derivatives by that."""

    edges: Edges
    wave: tuple[Array, Array]  # (v, o, c): the weights times level and slope of the sinusoids
    time: Float[Array, "g k c"]  # s, first passage of each edge
    period: Float[Array, "g c"]  # s


def total(kind, z: Pair, axis: int = -2):
    """Sum over an axis and what an output shows of the pairs."""
    return summed(jnp.where(kind > 0, z[0], z[0] + z[1]), axis)


def by_begins(by_into, piece, begun, pieces: int):
    """`begin`, `begin_time` and `since` from derivatives (g, c) by the time since pieces began.

    `piece` is the one that each signal is on, `begun` (s) when it began; the first one's begin is
    none that passes.
    """
    passed = begun > 0
    on = piece[:, None] == jnp.arange(pieces)[:, None]
    begin = jnp.where(on, -jnp.where(passed, by_into, 0.0)[:, None], 0.0)
    return begin, begin * begun[:, None], jnp.where(passed, 0.0, by_into)


def slopes_of(g: Lanes, layout: Layout, sums: OutputSums) -> Slopes:
    """Derivatives by poles, signals and what goes straight to the outputs."""
    m, signals, of = g.modes, g.signals, layout.signal_of
    kind, b = m.kind, m.given(layout.column_of)
    r, known = resonance(m, signals.rate[:, None]), _known(signals, layout, sums)
    by = by_pole(kind, r)
    given, given_rate = (Resonance(*(product(kind, b, y) for y in x)) for x in (r, by))
    own = seen(kind, (m.c0[: layout.rows], m.c1[: layout.rows]))

    def against(own: Pair, known: _Known, *sums: Pair) -> tuple[Resonance, Resonance]:
        waves = ([summed(x * y[:, :, None], 1) for x in own] for y in known.wave)  # (v, p, c)
        start, slope = _against(known, layout, *sums[:2]), _against(known, layout, *sums[2:])
        each = zip(start, waves, strict=True)
        return Resonance(*(plus(x, (-y, -z)) for x, (y, z) in each)), slope

    free, slope = materialised(
        against, own, known, sums.edge, sums.start, sums.edge_rate, sums.start_rate
    )

    def together(r: Resonance, by: Resonance) -> Pair:  # (v, p, c)
        return plus(*(product(kind, x, y) for x, y in zip(r, by, strict=True)))

    def signalled(x: Pair, start: Pair) -> Pair:  # (s + 1, p, c)
        first, second = (
            jnp.concatenate([by_signal(y, of), z[None]]) for y, z in zip(x, start, strict=True)
        )
        return first, second

    def less_waves(free: Pair, lag: Resonance) -> Pair:  # (o, p, c)
        """With what moves with the sinusoids."""
        levels, slopes = known.wave
        first, second = (
            x - summed(y[:, None] * levels[:, :, None] + z[:, None] * slopes[:, :, None])
            for x, y, z in zip(free, *lag, strict=True)
        )
        return first, second

    return Slopes(
        signalled(together(r, free), sums.start),
        signalled(plus(together(r, slope), together(by, free)), sums.start_rate),
        less_waves(sums.free, given),
        less_waves(sums.free_rate, given_rate),
        _by_signals(g, layout, sums, r, given, known, free),
        *(by_signal(x, of) for x in known.wave),
    )


def _known(signals: Signals, layout: Layout, sums: OutputSums) -> _Known:
    parts = turned(signals.cosine, signals.sine, *sums.wave)  # (o, v, k, c)
    level, slope = (jnp.swapaxes(jnp.sum(x, axis=2), 0, 1) for x in parts)
    wave = level, signals.rate[:, None] * slope
    return _Known(edges_of(signals, layout), wave, *edge_times(signals))


def _against(known: _Known, layout: Layout, edge: Pair, start: Pair) -> Resonance:
    """The sums over levels and slopes that jump or lag at the start, (v, p, c)."""

    def over(jump, now) -> Pair:
        each = [now[:, None] * x for x in start]
        if count := len(jump):
            signal, size = layout.signal_of[:count], jump[:, :, None]
            more = [summed(size * rows(x, signal), 1) for x in edge]
            none = ((0, len(now) - count), (0, 0), (0, 0))
            each = [x + jnp.pad(y, none) for x, y in zip(each, more, strict=True)]
        return each[0], each[1]

    return Resonance(*(over(*x) for x in zip(*known.edges, strict=True)))


def _by_signals(
    g: Lanes, layout: Layout, sums: OutputSums, r: Resonance, given: Resonance, known: _Known,
    free: Resonance,
) -> Signals:  # fmt: skip
    """Derivatives by what the signals are made of; `given`: the resonances `r` of the inputs."""
    m, signals, of = g.modes, g.signals, layout.signal_of
    kind, rate, e = m.kind, signals.rate[:, None], len(known.edges.jump[0])
    columns = layout.column_of
    b = m.given(columns)

    def met(edge: Pair):
        """Of the passages of sinusoids with edges: all, and what their resonance gives."""
        edge = rows(edge[0], of[:e]), rows(edge[1], of[:e])
        parts = (b, *given)
        return [total(kind, product(kind, [y[:e, None] for y in x], edge)) for x in parts]

    def late(whole, level, slope):
        """Derivative by the times of the passages."""
        jump, square = known.edges.jump, rate[:e] * rate[:e]
        return by_signal(jump[0] * (whole - square * slope) + jump[1] * level, of[:e])

    period = known.period[:, None]
    more = plus(sums.edge_time, times(-known.time[:, :, None], sums.edge))  # n period
    edge, turn = met(sums.edge), met(times(1 / period[:, :, None], more))
    now = [total(kind, product(kind, x, sums.start)) for x in given]
    straight = g.direct, g.slope
    wave = [
        rows(x[:, : layout.rows], columns) - jnp.swapaxes(shown(m, z, layout.rows), 0, 1)
        for x, z in zip(straight, given, strict=True)
    ]
    by_turn = (sums.begin_time - known.time * sums.begin) / period - late(*turn)
    bar = _Known(
        Edges((edge[1], edge[2]), (now[0], now[1])),
        (wave[0], wave[1]),
        sums.begin - late(*edge),
        jnp.sum(by_turn, axis=1),
    )
    (back,) = jax.vjp(lambda x: _known(x, layout, sums), signals)[1](bar)
    turned = (
        product(kind, product(kind, b, x), y)
        for x, y in zip(by_rate(kind, r, rate), free, strict=True)
    )
    return back._replace(
        rate=back.rate + sums.late + total(kind, plus(*turned)), since=back.since + sums.since
    )
