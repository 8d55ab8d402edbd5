"""Sums over the blocks of a run from which derivatives of what its samples give follow.

A run carries what the edges that its signals have passed leave, sum_n exp(lambda (t - t_e)) and the
same times t - t_e, from block to block, beside the free part's derivative by the poles, and adds
them up against weights on the block's outputs.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from .._poles import PolePairs
from ..arithmetic import Pair, flushed, materialised, plus, product, rows, summed, times, turned
from ..gradient import seen
from ..lanes import Lanes
from ..system import Layout
from .blocks import LENGTH, BlockTables, Weights, free_rates
from .edges import by_signal, of_sinusoids
from .figures import Along
from .output_sums import OutputSums, by_begins
from .walk import Onward, WalkState


class _Passed(NamedTuple):
    """Sums over the passages so far, at the begin of a block."""

    edge: Pair  # (g, k, p, c): exp(lambda (t - t_e))
    late: Pair  # the same times t - t_e
    decay: Pair  # (p, c): exp(lambda t)
    slope: Pair  # (p, c): derivative of the free part by the poles


def _follow(kind, rates: Pair, carried: _Passed, move: Onward) -> _Passed:
    """`rates` (g, k, p, c): derivatives of the jumps by the poles."""
    past = move.past[:, :, None]
    after = jnp.where(past, move.after[0], 0.0), jnp.where(past, move.after[1], 0.0)
    later = plus(carried.late, times(move.span, carried.edge))
    edge, late, decay = (product(kind, x, move.over) for x in (carried.edge, later, carried.decay))
    first, second = (summed(summed(jnp.where(past, x, 0.0))) for x in rates)
    jumped = plus((first, second), times(move.since, move.jump))
    slope = plus(carried.slope, times(move.span, move.free))
    slope = plus(product(kind, slope, move.over), product(kind, jumped, move.after))
    return _Passed(
        plus(edge, after),
        plus(late, times(move.since, after)),
        decay,
        (flushed(slope[0]), flushed(slope[1])),
    )


def _begin(m: PolePairs, g: int, pieces: int, layout: Layout, slope: Pair):
    pairs, lanes = m.l0.shape

    def none(*shape):
        return jnp.zeros((*shape, pairs, lanes)), jnp.zeros((*shape, pairs, lanes))

    edge, shown, waves = (g, pieces), layout.rows, len(layout.signal_of)
    wave, flat = jnp.zeros((shown, waves, pieces, lanes)), jnp.zeros((*edge, lanes))
    sums = OutputSums(
        none(*edge), none(*edge), none(*edge), none(), none(), none(shown), none(shown),
        (wave, wave), jnp.zeros((waves, lanes)), flat, flat, jnp.zeros((g, lanes)),
    )  # fmt: skip
    one = jnp.ones_like(m.l0), jnp.where(m.kind > 0, 0.0, 1.0)
    return sums, _Passed(none(*edge), none(*edge), one, slope)


def sums_along(g: Lanes, layout: Layout, step) -> Along:
    """`OutputSums` over the samples of weights on the outputs that figures are made of.

    Half the derivatives of |dR|^2 are dR itself.
    """
    m, edged, of = g.modes, len(g.signals.duration), layout.signal_of
    kind, pieces = m.kind, g.signals.cosine.shape[1]
    own = seen(kind, (m.c0[: layout.rows], m.c1[: layout.rows]))
    rates = free_rates(m, g.signals, layout)

    def shown(now, u: Pair, du: Pair) -> tuple[Pair, Pair, Pair]:
        """As the outputs show pairs: sums u, those times the block's time, u times `now`."""
        q0, q1 = (summed(y) for y in product(kind, own, u))
        d0, d1 = (summed(y) for y in product(kind, own, du))
        return (q0, q1), (d0, d1), times(now, (q0, q1))

    def gather(total: OutputSums, x, weights: Weights, t: BlockTables, s: WalkState, turn):
        sums = [(y.real, step * y.imag) for y in materialised(_against, x, t)]
        (u0, du0), (u1, du1) = ([rows(y, layout.pole, 1) for y in x] for x in sums[:2])
        u, du, past = (u0, u1), (du0, du1), s.carried
        w, dw = ([x[n] for x in sums[2:]] for n in (0, 1))
        now = s.done * step
        q, dq, later = materialised(shown, now, u, du)
        ago = of_sinusoids(now - s.begun, of, now)
        waves = turned(w[0], w[1], turn.real, -turn.imag)
        swing = _swing(weights, w, layout)  # by the phases at the block's begin
        moved = _swing(weights, dw, layout) + swing * ago
        e = int(np.sum(of < edged))
        by_into = by_signal((swing * g.signals.rate)[:e], of[:e])
        begin, begin_time, first = by_begins(by_into, s.piece, s.begun, pieces)
        on = s.piece[:, None] == jnp.arange(pieces)[:, None]
        here = of_sinusoids(on, of, jnp.arange(pieces)[:, None] + 0 * now == 0)
        return OutputSums(
            plus(total.edge, product(kind, q, past.edge)),
            plus(total.edge_rate, plus(product(kind, dq, past.edge), product(kind, q, past.late))),
            plus(
                total.edge_time,
                plus(product(kind, later, past.edge), times(-1.0, product(kind, q, past.late))),
            ),
            plus(total.start, product(kind, q, past.decay)),
            plus(total.start_rate, product(kind, plus(dq, later), past.decay)),
            plus(total.free, product(kind, u, s.free)),
            plus(total.free_rate, plus(product(kind, du, s.free), product(kind, u, past.slope))),
            plus(total.wave, (here * waves[0][:, :, None], here * waves[1][:, :, None])),
            total.late + moved,
            total.begin + begin,
            total.begin_time + begin_time,
            total.since + first,
        )

    start, carried = _begin(m, edged, pieces, layout, rates.start)
    return Along(gather, start, lambda past, move: _follow(kind, rates.jump, past, move), carried)


def _against(x, t: BlockTables):
    """Sums (o, q or v, c) of the outputs times each table, and imaginary the same times the number.

    Sums from the last sample on add up to the second: one loop reads what both are made of.
    """

    def sums(z):
        value = moment = 0.0
        for k in reversed(range(LENGTH)):
            value = value + x[:, k, None] * z[k]
            moment = moment + value if k else moment
        return jax.lax.complex(value, moment)

    return [sums(z) for z in t]


def _swing(weights: Weights, w, layout: Layout):
    """Derivatives (v, c) by the phases of the sinusoids, from sums w (o, v, c) of dR."""
    parts: list[list] = [[] for _ in layout.signal_of]
    each = [(o, v) for o in range(layout.rows) for v in layout.waves[o]]
    for f0, f1, (o, v) in zip(weights.f0, weights.f1, each, strict=True):
        parts[v].append(f1 * w[0][o, v] - f0 * w[1][o, v])
    return jnp.stack([sum(part, jnp.zeros_like(w[0][0, 0])) for part in parts])
