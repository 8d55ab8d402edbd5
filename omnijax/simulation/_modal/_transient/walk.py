"""From block to block through the runs of many designs; batch last.

A block is up to `LENGTH` samples of one design before the next edge of any of its signals; a loop
runs until every design of a group has all its samples.  Nothing about speeds, edges, step or
duration is static.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Complex, Float

from ..._one_kernel import one_kernel
from .._poles import PolePairs
from ..arithmetic import Pair, across, flushed, materialised, product, rows, sincos, summed
from ..signals import Signals
from ..system import Layout
from .blocks import LENGTH, ForcedPart, FreePart, Poles, pole_exp, poles_of, tables
from .edges import at_piece, of_sinusoids
from .passages import left_of, passages, pole_edge_sums


class WalkState(NamedTuple):
    """Where a design is: samples done, free part, and the pieces its signals are on."""

    done: Float[Array, " c"]
    count: Float[Array, " c"]  # samples of the block that begins here
    free: tuple[Array, Array]  # (p, c)
    edge: Float[Array, "g c"]  # s, end of the piece
    begun: Float[Array, "g c"]  # s, begin of the piece
    piece: Float[Array, "g c"]
    carried: Any  # what `follow` carries along


class Moved(NamedTuple):
    """What poles and sinusoids move by in a block."""

    edge: Float[Array, " c"]  # s, of the next edge
    past: Bool[Array, " c"]  # whether it lies before the sample after the block
    span: Float[Array, " c"]  # s, of the block
    since: Float[Array, " c"]  # s, from that edge to the block's end; 0 where it is not past
    over: Complex[Array, "q c"]  # exp(lambda span), see `Layout.poles`
    after: Complex[Array, "q c"]  # exp(lambda since)
    turn: Complex[Array, "v c"]  # exp(i angle) of the sinusoids at its begin


class Onward(NamedTuple):
    """From one block to the next: `span` seconds, then perhaps past an edge, `since` after it."""

    free: tuple[Array, Array]  # (p, c), the free part before
    span: Float[Array, " c"]
    over: tuple[Array, Array]  # (p, c), exp(lambda span)
    past: Float[Array, "g k c"]  # a one at the piece that begins
    jump: tuple[Array, Array]  # (p, c), of the free part there
    since: Float[Array, " c"]
    after: tuple[Array, Array]  # (p, c), exp(lambda since)


class Walk(NamedTuple):
    """The runs of a group of designs, `samples` at t = 0, step, ..."""

    modes: PolePairs
    signals: Signals
    parts: ForcedPart
    layout: Layout
    step: Array
    samples: Array

    def begin(self, carried: Any = ()) -> WalkState:
        """The start of all runs."""
        signals, free = self.signals, self.parts.free.start
        edge = at_piece(signals.duration, signals.piece) - signals.since
        zero = jnp.zeros(self.modes.l0.shape[-1])
        count = self._count(zero, edge)
        return WalkState(zero, count, free, edge, -signals.since, signals.piece, carried)

    def _count(self, done, edge) -> Float[Array, " c"]:
        """Samples of the block that begins after so many."""
        last = jnp.floor(_first(edge) / self.step)
        return jnp.clip(jnp.minimum(last + 1, self.samples) - done, 0.0, LENGTH)

    def moved(self, s: WalkState, poles: Poles) -> Moved:
        """What moves in the block that begins here."""
        begun = of_sinusoids(s.begun, self.layout.signal_of, jnp.zeros_like(s.done))

        def moved(span, since, into, poles, rate):
            sn, cs = sincos(rate * into)
            over = jax.lax.complex(*poles.exp(jnp.stack([span, since])[:, None]))
            return over, jax.lax.complex(cs, sn)

        done, edge = s.done + s.count, _first(s.edge)
        past = jnp.floor(edge / self.step) + 1 <= done
        since = jnp.where(past, done * self.step - edge, 0.0)
        span, into = s.count * self.step, s.done * self.step - begun
        over, turn = materialised(moved, span, since, into, poles, self.signals.rate)
        return Moved(edge, past, span, since, over[0], over[1], turn)

    def onward(self, s: WalkState, moved: Moved, follow=lambda carried, move: carried) -> WalkState:
        """The begin of the next block."""
        m, signals, edges = self.modes, self.signals, self.signals.duration.shape[0]
        pieces = np.array([kind.pieces for kind in self.layout.kinds[:edges]])[:, None]
        done = s.done + s.count
        pick = (s.edge == moved.edge) & moved.past
        later = jnp.where(s.piece + 1 >= pieces, 0.0, s.piece + 1)
        over, after = (rows(x, self.layout.pole) for x in (moved.over, moved.after))
        over, after = (over.real, over.imag), (after.real, after.imag)
        first, second = (
            summed(jnp.where(pick[:, None], _at_jump(j, later), 0.0)) for j in self.parts.free.jump
        )
        jump = first, second
        a, b = product(m.kind, s.free, over), product(m.kind, jump, after)
        edge = jnp.where(pick, s.edge + at_piece(signals.duration, later), s.edge)
        begins = later[:, None] == jnp.arange(signals.duration.shape[1])[:, None]
        past = pick[:, None] & begins
        move = Onward(s.free, moved.span, over, past, jump, moved.since, after)
        return WalkState(
            done,
            self._count(done, edge),
            (flushed(a[0] + b[0]), flushed(a[1] + b[1])),
            edge,
            jnp.where(pick, s.edge, s.begun),
            jnp.where(pick, later, s.piece),
            follow(s.carried, move),
        )

    def at(self, sample: Float[Array, " c"]) -> WalkState:
        """The state at a sample in closed form: a block begins there."""
        m, signals, time = self.modes, self.signals, self.step * sample
        p = passages(signals, self.layout, time)
        sums = pole_edge_sums(m, p, self.layout)

        def left(kind, free: FreePart, sums: Pair, decay: Pair):
            return jax.lax.complex(*left_of(kind, free, sums, decay))

        decay = pole_exp(m, self.layout, time[None])
        free = materialised(left, m.kind, self.parts.free, sums, decay)
        edge = p.begun + at_piece(signals.duration, p.piece)
        count = self._count(sample, edge)
        return WalkState(sample, count, (free.real, free.imag), edge, p.begun, p.piece, ())

    def blocks_of(self, sample: Float[Array, "n c"]) -> WalkState:
        """Begins (n, ...) of blocks that hold samples, rising and beside each other."""
        poles = poles_of(self.modes, self.layout)

        def body(carry):
            each, s = carry
            here = (s.done <= sample) & (sample < s.done + s.count)
            every = jax.vmap(lambda yes, old: _chosen(yes, s, old))(here, each)
            return every, self.onward(s, self.moved(s, poles))

        s = self.at(sample[0])
        each = jax.tree.map(lambda x: jnp.broadcast_to(x, (len(sample), *x.shape)), s)

        def forward(start):
            return jax.lax.while_loop(lambda c: jnp.any(c[1].done <= sample[-1]), body, start)[0]

        return one_kernel(forward, (each, s))

    def run(self, gather, totals, follow=lambda carried, move: carried, carried: Any = ()):
        """totals = gather(totals, state, tables, turn) over all blocks of all designs.

        carried = follow(carried, onward) goes from block to block in the state.
        """
        poles = poles_of(self.modes, self.layout)
        t = tables(poles, self.signals.rate, self.step)

        def body(carry):
            totals, s = carry
            moved = self.moved(s, poles)
            return gather(totals, s, t, moved.turn), self.onward(s, moved, follow)

        start: Any = (totals, self.begin(carried))

        def forward(start):
            return jax.lax.while_loop(lambda c: jnp.any(c[1].done < self.samples), body, start)[0]

        return one_kernel(forward, start)


def _chosen(better: Bool[Array, " c"], one: WalkState, other: WalkState) -> WalkState:
    """The state of one where that is better, else of the other."""
    return jax.tree.map(lambda x, y: jnp.where(better, x, y), one, other)


def _first(edge: Float[Array, "g c"]):
    """The next edge of any signal."""
    return across(jnp.minimum, edge) if len(edge) else jnp.full(edge.shape[1:], jnp.inf)


def _at_jump(jump, piece):
    return sum(jnp.where(piece[:, None] == j, jump[:, j], 0.0) for j in range(jump.shape[1]))
