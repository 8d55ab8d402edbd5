"""Derivatives of the mean square over the samples, from sums over the blocks of a run.

The free part of a signal is what the edges k it has passed at t_e = t_k + n period have left,

    free(t) = sum_k jump_k sum_n exp(lambda (t - t_e)) - begin exp(lambda t)

A run carries the inner sums, and those with the weights (t - t_e) and n, from block to block and
adds them up against the block's outputs; all derivatives follow afterwards, once a run.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .arithmetic import across, materialised, product, sincos, summed
from .blocks import LENGTH, BlockTables, Operands, forced, particular, row_signal, rows
from .edges import edge_times, jumps
from .gradient import Slopes, along_poles
from .moment import Pair
from .poles import PolePairs
from .signals import Signals
from .system import Layout
from .transient import ROWS, Lanes
from .walk import Onward, Walk, WalkState


class _Passed(NamedTuple):
    """Sums over the passages so far, at the begin of a block."""

    edge: Pair  # (g, k, p, c): exp(lambda (t - t_e))
    late: Pair  # the same times t - t_e
    turn: Pair  # the same times n
    decay: Pair  # (p, c): exp(lambda t)
    number: Float[Array, "g k c"]  # of passages


class _Sums(NamedTuple):
    """What the blocks of a run add up to: outputs times free parts, outputs times sinusoids."""

    edge: Pair  # (o, g, k, p, c)
    edge_rate: Pair  # derivative of `edge` by the poles
    turn: Pair  # (g, k, p, c), seen through the outputs
    start: Pair  # (o, p, c)
    start_rate: Pair
    wave: tuple[Array, Array]  # (o, v, k, c): x cos, x sin over each piece
    late: Float[Array, "v c"]  # derivative by the rates, at fixed begins of the pieces
    begin: Float[Array, "g k c"]  # derivative by the begin of each piece
    begin_turn: Float[Array, "g k c"]  # the same times n
    since: Float[Array, "g c"]  # derivative by `Signals.since` before the first edge


def _plus(a: Pair, b: Pair) -> Pair:
    return a[0] + b[0], a[1] + b[1]


def _times(x, a: Pair) -> Pair:
    return x * a[0], x * a[1]


def _seen(kind, c: Pair) -> Pair:
    """Pairs whose product with z has in its sum the output c0 z0 + c1 z1."""
    return c[0], jnp.where(kind > 0, -c[1], c[1])


def _follow(kind, carried: _Passed, move: Onward) -> _Passed:
    past = move.past[:, :, None]
    number = carried.number[:, :, None]
    after = [jnp.where(past, x, 0.0) for x in move.after]
    later = _plus(carried.late, _times(move.span, carried.edge))
    edge, late, turn = (product(kind, x, move.over) for x in (carried.edge, later, carried.turn))
    return _Passed(
        _plus(edge, (after[0], after[1])),
        _plus(late, _times(move.since, (after[0], after[1]))),
        _plus(turn, _times(number, (after[0], after[1]))),
        product(kind, carried.decay, move.over),
        carried.number + move.past,
    )


def _begin(m: PolePairs, g: int, pieces: int, waves: int) -> tuple[_Sums, _Passed]:
    pairs, lanes = m.l0.shape

    def none(*shape):
        return jnp.zeros((*shape, pairs, lanes)), jnp.zeros((*shape, pairs, lanes))

    edge, all_ = (g, pieces), (ROWS, g, pieces)
    wave, flat = jnp.zeros((ROWS, waves, pieces, lanes)), jnp.zeros((*edge, lanes))
    sums = _Sums(
        none(*all_), none(*all_), none(*edge), none(ROWS), none(ROWS), (wave, wave),
        jnp.zeros((waves, lanes)), flat, flat, jnp.zeros((g, lanes)),
    )  # fmt: skip
    one = jnp.ones_like(m.l0), jnp.where(m.kind > 0, 0.0, 1.0)
    return sums, _Passed(none(*edge), none(*edge), none(*edge), one, flat)


def mean_square_slopes(g: Lanes, layout: Layout, step, count) -> Slopes:
    """Derivatives of the mean of |dR|^2 over the samples."""
    m, edged = g.modes, g.signals.duration.shape[0]
    of = layout.signal_of
    parts = materialised(
        lambda m, signals, direct, slope: forced(m, signals, direct, slope, layout),
        m,
        g.signals,
        g.direct,
        g.slope,
    )
    number = jnp.arange(LENGTH, dtype=float)[:, None]
    kinds, pieces = m.kind, parts.cosine.shape[2]
    shown = _seen(kinds, (m.c0[:ROWS], m.c1[:ROWS]))

    def sums_of(op: Operands, t: BlockTables):
        """Sums (o, p or v, c) of the outputs times each table, and of those times the time."""
        x = [row_signal(op, t, layout, o) for o in range(ROWS)]
        x = jnp.stack([jnp.where(number < op.count, row, 0.0) for row in x])
        x = materialised(lambda x: jnp.concatenate([x, x * number * step]), x)  # (2 o, k, c)
        products = [jnp.stack([across(jnp.add, y[:, None] * z) for y in x], axis=1) for z in t]
        products[:2] = [rows(x, layout.pole) for x in products[:2]]
        products = [jnp.swapaxes(x, 0, 1) for x in products]
        return [z[:ROWS] for z in products], [z[ROWS:] for z in products]

    def gather(total: _Sums, op: Operands, t: BlockTables, s: WalkState) -> _Sums:
        (u0, u1, *w), (d0, d1, *dw) = materialised(sums_of, op, t)
        u, du, past = (u0, u1), (d0, d1), s.carried
        wide, more = ([x[:, None, None] for x in y] for y in (u, du))
        edge = product(kinds, wide, past.edge)
        rate = _plus(product(kinds, more, past.edge), product(kinds, wide, past.late))
        q = [summed(x) for x in product(kinds, shown, u)]
        now = s.done * step
        since = now - s.begun
        into = _of_waves(since, of, edged, now) * g.signals.rate
        sn, cs = sincos(into)
        waves = w[0] * cs - w[1] * sn, w[1] * cs + w[0] * sn
        f0, f1 = op.f0[:ROWS], op.f1[:ROWS]
        swing = summed(f1 * w[0] - f0 * w[1])  # by the phases at the block's begin
        late = summed(f1 * dw[0] - f0 * dw[1])
        late = late + swing * _of_waves(since, of, edged, now)
        by_into = _by_signal(swing * g.signals.rate, of, edged)
        on = s.piece[:, None] == jnp.arange(pieces)[:, None]
        passed = past.number > 0
        begin = jnp.where(on & passed, by_into[:, None], 0.0)
        first = jnp.sum(jnp.where(on & ~passed, by_into[:, None], 0.0), axis=1)
        here = _of_waves(on, of, edged, jnp.arange(pieces)[:, None] + 0 * now == 0)
        return _Sums(
            _plus(total.edge, edge),
            _plus(total.edge_rate, rate),
            _plus(total.turn, product(kinds, q, past.turn)),
            _plus(total.start, product(kinds, u, past.decay)),
            _plus(total.start_rate, product(kinds, _plus(du, _times(now, u)), past.decay)),
            _plus(total.wave, (here * waves[0][:, :, None], here * waves[1][:, :, None])),
            total.late + late,
            total.begin - begin,
            total.begin_turn - begin * (past.number - 1),
            total.since + first,
        )

    start, carried = _begin(m, edged, pieces, len(of))
    walk = Walk(m, g.signals, parts, layout, step, count)
    sums = walk.run(gather, start, lambda past, move: _follow(kinds, past, move), carried)
    return _slopes(g, layout, sums, of, 2 / count)


def _of_waves(x, of, edged: int, endless):
    """Rows of x (g, ...) for each sinusoid's signal; `endless` for signals without edges."""
    return jnp.stack([x[i] if i < edged else endless for i in of])


def _by_signal(x, of, count: int):
    """Sums of the rows of x over the sinusoids of each of the first `count` signals."""
    sums = [sum(x[i] for i in np.flatnonzero(of == s)) for s in range(count)]
    return jnp.stack(sums) if sums else jnp.zeros((0, *x.shape[1:]))


def _psi(m: PolePairs, signals: Signals, layout: Layout, edge: Pair, start: Pair):
    """(o, s, p, c): sums of the outputs times the free parts, from those over the passages."""
    jump, begin = jumps(m, signals, layout)
    left = product(m.kind, begin, [x[:, None] for x in start])
    passed = [jnp.sum(x, axis=2) for x in product(m.kind, jump, edge)]
    rest = len(layout.kinds) - passed[0].shape[1]
    passed = [jnp.pad(x, ((0, 0), (0, rest), (0, 0), (0, 0))) for x in passed]
    return passed[0] - left[0], passed[1] - left[1]


def _ending(a: Pair, b: Pair) -> Pair:
    """Signals (o, s, p, c), then the start (o, p, c)."""
    first, second = (jnp.concatenate([x, y[:, None]], axis=1) for x, y in zip(a, b, strict=True))
    return first, second


def _by_signals(g: Lanes, layout: Layout, sums: _Sums) -> Signals:
    """Derivatives by what the signals are made of."""
    m, edged = g.modes, g.signals.duration.shape[0]
    columns = np.array([kind.column for kind in layout.kinds])
    b = m.b0[columns], m.b1[columns]
    shown = _seen(m.kind, (m.c0[:ROWS], m.c1[:ROWS]))
    back = product(m.kind, (b[0][:edged, None], b[1][:edged, None]), jumps(m, g.signals, layout)[0])
    back = product(m.kind, back, (m.l0, m.l1))

    def summed(a: Pair, axis):
        return jnp.sum(jnp.where(m.kind > 0, a[0], a[0] + a[1]), axis=axis)

    edge = product(m.kind, [x[:, None, None] for x in shown], sums.edge)
    edge = [jnp.sum(x, axis=0) for x in edge]
    by_time = sums.begin - summed(product(m.kind, edge, back), 2)  # (g, k, c)
    by_turn = sums.begin_turn - summed(product(m.kind, sums.turn, back), 2)

    def figure(signals: Signals):
        psi = _psi(m, signals, layout, sums.edge, sums.start)
        seen = product(m.kind, [x[:, None] for x in shown], product(m.kind, b, psi))
        times, period = edge_times(signals)
        moved = jnp.sum(by_time * times) + jnp.sum(by_turn * period[:, None])
        response = forced(m, signals, g.direct, g.slope, layout)
        waves = jnp.sum(response.cosine[:ROWS] * sums.wave[0])
        waves = waves + jnp.sum(response.sine[:ROWS] * sums.wave[1])
        rates = jnp.sum(sums.late * signals.rate) + jnp.sum(sums.since * signals.since)
        return jnp.sum(summed(seen, 2)) + moved + waves + rates

    return jax.grad(figure)(g.signals)


def _slopes(g: Lanes, layout: Layout, sums: _Sums, of, factor) -> Slopes:
    """Derivatives by poles, signals and what goes straight to the outputs."""
    m, signals, count = g.modes, g.signals, len(layout.kinds)
    one = jnp.ones_like(m.l0), jnp.where(m.kind > 0, 0.0, 1.0)

    def own(m: PolePairs):
        unit = m._replace(b0=one[0][None], b1=one[1][None], c0=m.c0[:0], c1=m.c1[:0])
        rate = signals.rate[:, None, None]
        parts = signals.cosine[:, :, None], signals.sine[:, :, None]
        by_signal = []
        for x, y in zip(*particular(unit, one, rate, *parts), strict=True):
            each = jnp.einsum("ovkc,vkpc->vopc", sums.wave[0], x)
            each = each + jnp.einsum("ovkc,vkpc->vopc", sums.wave[1], y)
            by_signal.append(jnp.swapaxes(_by_signal(each, of, count), 0, 1))
        return by_signal[0], by_signal[1]

    def psi(m: PolePairs):
        return _plus(own(m), _psi(m, signals, layout, sums.edge, sums.start))

    value, rate = along_poles(m, psi)
    rate = _plus(rate, _psi(m, signals, layout, sums.edge_rate, sums.start_rate))
    level = sums.wave[0] * signals.cosine + sums.wave[1] * signals.sine  # (o, v, k, c)
    direct = _by_signal(jnp.swapaxes(jnp.sum(level, axis=2), 0, 1), of, count)
    by_signal = Slopes(
        _ending(value, sums.start),
        _ending(rate, sums.start_rate),
        _by_signals(g, layout, sums),
        direct,
    )
    return jax.tree.map(lambda x: factor * x, by_signal)
