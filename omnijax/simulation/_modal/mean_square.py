"""Sums over the blocks of a run from which the derivatives of the mean square follow.

A run carries what the edges that its signals have passed leave, sum_n exp(lambda (t - t_e)) and the
same times t - t_e, from block to block and adds them up against the block's outputs.
"""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np

from .arithmetic import Pair, materialised, plus, product, rows, sincos, summed, times
from .blocks import LENGTH, BlockTables, Weights
from .edges import by_signal, of_sinusoids
from .output_sums import OutputSums, by_begins, seen
from .poles import PolePairs
from .system import Layout
from .transient import ROWS, Along, Lanes
from .walk import Onward, WalkState


class _Passed(NamedTuple):
    """Sums over the passages so far, at the begin of a block."""

    edge: Pair  # (g, k, p, c): exp(lambda (t - t_e))
    late: Pair  # the same times t - t_e
    decay: Pair  # (p, c): exp(lambda t)


def _follow(kind, carried: _Passed, move: Onward) -> _Passed:
    past = move.past[:, :, None]
    after = jnp.where(past, move.after[0], 0.0), jnp.where(past, move.after[1], 0.0)
    later = plus(carried.late, times(move.span, carried.edge))
    edge, late, decay = (product(kind, x, move.over) for x in (carried.edge, later, carried.decay))
    return _Passed(plus(edge, after), plus(late, times(move.since, after)), decay)


def _begin(m: PolePairs, g: int, pieces: int, waves: int) -> tuple[OutputSums, _Passed]:
    pairs, lanes = m.l0.shape

    def none(*shape):
        return jnp.zeros((*shape, pairs, lanes)), jnp.zeros((*shape, pairs, lanes))

    edge, each = (g, pieces), (g, pieces, ROWS)
    wave, flat = jnp.zeros((ROWS, waves, pieces, lanes)), jnp.zeros((*edge, lanes))
    sums = OutputSums(
        none(*each), none(*each), none(*edge), none(ROWS), none(ROWS), (wave, wave),
        jnp.zeros((waves, lanes)), flat, flat, jnp.zeros((g, lanes)),
    )  # fmt: skip
    one = jnp.ones_like(m.l0), jnp.where(m.kind > 0, 0.0, 1.0)
    return sums, _Passed(none(*edge), none(*edge), one)


def square_sums(g: Lanes, layout: Layout, step) -> Along:
    """Sums over the samples of half the derivatives of |dR|^2, dR itself; `OutputSums`."""
    m, edged, of = g.modes, len(g.signals.duration), layout.signal_of
    number = jnp.arange(LENGTH, dtype=float)[:, None]
    kind, pieces = m.kind, g.signals.cosine.shape[1]
    own = seen(kind, (m.c0[:ROWS], m.c1[:ROWS]))

    def against(x, t: BlockTables):
        """Sums (2 o, q or v, c) of the outputs, and of those times the time, times each table."""
        x = materialised(lambda x: jnp.concatenate([x, x * number * step]), x)  # (2 o, k, c)
        return [sum(x[:, k, None] * z[k] for k in range(LENGTH)) for z in t]

    def gather(total: OutputSums, x, weights: Weights, t: BlockTables, s: WalkState) -> OutputSums:
        T0, T1, *turns = materialised(against, x, t)
        poles = rows(T0, layout.pole, 1), rows(T1, layout.pole, 1)
        u, du = (poles[0][:ROWS], poles[1][:ROWS]), (poles[0][ROWS:], poles[1][ROWS:])
        w, dw, past = [x[:ROWS] for x in turns], [x[ROWS:] for x in turns], s.carried
        edge, late = ([x[:, :, None] for x in y] for y in (past.edge, past.late))
        now = s.done * step
        timed = plus(times(now, past.edge), times(-1.0, past.late))  # t_e exp(lambda (t - t_e))
        q = [summed(x) for x in product(kind, own, u)]
        since = now - s.begun
        ago = of_sinusoids(since, of, now)
        sn, cs = sincos(ago * g.signals.rate)
        waves = w[0] * cs - w[1] * sn, w[1] * cs + w[0] * sn
        swing = _swing(weights, w, layout)  # by the phases at the block's begin
        moved = _swing(weights, dw, layout) + swing * ago
        e = int(np.sum(of < edged))
        by_into = by_signal((swing * g.signals.rate)[:e], of[:e])
        begin, begin_time, first = by_begins(by_into, s.piece, s.begun, pieces)
        on = s.piece[:, None] == jnp.arange(pieces)[:, None]
        here = of_sinusoids(on, of, jnp.arange(pieces)[:, None] + 0 * now == 0)
        return OutputSums(
            plus(total.edge, product(kind, u, edge)),
            plus(total.edge_rate, plus(product(kind, du, edge), product(kind, u, late))),
            plus(total.edge_time, product(kind, q, timed)),
            plus(total.start, product(kind, u, past.decay)),
            plus(total.start_rate, product(kind, plus(du, times(now, u)), past.decay)),
            plus(total.wave, (here * waves[0][:, :, None], here * waves[1][:, :, None])),
            total.late + moved,
            total.begin + begin,
            total.begin_time + begin_time,
            total.since + first,
        )

    start, carried = _begin(m, edged, pieces, len(of))
    return Along(gather, start, lambda past, move: _follow(kind, past, move), carried)


def _swing(weights: Weights, w, layout: Layout):
    """Derivatives (v, c) by the phases of the sinusoids, from sums w (o, v, c) of dR."""
    parts: list[list] = [[] for _ in layout.signal_of]
    each = [(o, v) for o in range(ROWS) for v in layout.waves[o]]
    for f0, f1, (o, v) in zip(weights.f0, weights.f1, each, strict=True):
        parts[v].append(f1 * w[0][o, v] - f0 * w[1][o, v])
    return jnp.stack([sum(part, jnp.zeros_like(w[0][0, 0])) for part in parts])
