"""From block to block through the runs of many designs; batch last.

A block is up to `LENGTH` samples of one design before the next edge of any of its signals; a loop
runs until every design of a group has all its samples.  Nothing about speeds, edges, step or
duration is static.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .arithmetic import flushed, product, sincos, stored, turned
from .blocks import LENGTH, ForcedPart, Operands, pole_exp, tables
from .edges import at_piece, of_sinusoids
from .poles import PolePairs
from .signals import Signals
from .system import Layout


class WalkState(NamedTuple):
    """Where a design is: samples done, free part, and the pieces its signals are on."""

    done: Float[Array, " c"]
    free: tuple[Array, Array]  # (p, c)
    edge: Float[Array, "g c"]  # s, end of the piece
    begun: Float[Array, "g c"]  # s, begin of the piece
    piece: Float[Array, "g c"]
    carried: Any  # what `follow` carries along


class Onward(NamedTuple):
    """From one block to the next: `span` seconds, then perhaps past an edge, `since` after it."""

    span: Float[Array, " c"]
    over: tuple[Array, Array]  # (p, c), exp(lambda span)
    past: Float[Array, "g k c"]  # a one at the piece that begins
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
        signals, free = self.signals, (self.parts.free0, self.parts.free1)
        edge = at_piece(signals.duration, signals.piece) - signals.since
        zero = jnp.zeros(self.modes.l0.shape[-1])
        return WalkState(zero, free, edge, -signals.since, signals.piece, carried)

    def count(self, s: WalkState) -> Float[Array, " c"]:
        """Samples of the block that begins here."""
        last = jnp.min(jnp.floor(s.edge / self.step), axis=0, initial=jnp.inf)
        return jnp.clip(jnp.minimum(last + 1, self.samples) - s.done, 0.0, LENGTH)

    def operands(self, s: WalkState) -> Operands:
        """What the samples of the block that begins here are made of."""
        m, (z0, z1) = self.modes, s.free
        k = m.kind > 0
        w0 = m.c0 * z0 + jnp.where(k, m.c1 * z1, 0.0)
        w1 = m.c1 * jnp.where(k, z0, z1) - jnp.where(k, m.c0 * z1, 0.0)
        of, none = self.layout.signal_of, jnp.zeros_like(s.done)
        piece, begun = (of_sinusoids(x, of, none) for x in (s.piece, s.begun))
        fa, fb = (at_piece(x, piece) for x in (self.parts.cosine, self.parts.sine))
        phase = self.signals.rate * (s.done * self.step - begun)
        sn, cs = stored(sincos, phase)
        return Operands(self.count(s), w0, w1, *turned(fa, fb, cs, sn))

    def onward(self, s: WalkState, count, follow=lambda carried, move: carried) -> WalkState:
        """The begin of the next block, `count` samples later."""
        m, signals, edges = self.modes, self.signals, self.signals.duration.shape[0]
        pieces = np.array([kind.pieces for kind in self.layout.kinds[:edges]])[:, None]
        done = s.done + count
        now = jnp.min(s.edge, axis=0, initial=jnp.inf)
        taken = jnp.floor(now / self.step) + 1 <= done
        which = jnp.argmin(s.edge, axis=0) if edges else jnp.zeros_like(done)
        pick = (jnp.arange(edges)[:, None] == which) & taken
        later = jnp.where(s.piece + 1 >= pieces, 0.0, s.piece + 1)
        since = jnp.where(taken, done * self.step - now, 0.0)
        span = count * self.step
        E0, E1 = pole_exp(m, self.layout, jnp.stack([span, since])[:, None])
        over, after = (E0[0], E1[0]), (E0[1], E1[1])
        jump = [
            jnp.sum(jnp.where(pick[:, None], _at_jump(j, later), 0.0), axis=0)
            for j in (self.parts.jump0, self.parts.jump1)
        ]
        a, b = product(m.kind, s.free, over), product(m.kind, jump, after)
        begins = later[:, None] == jnp.arange(signals.duration.shape[1])[:, None]
        return WalkState(
            done,
            (flushed(a[0] + b[0]), flushed(a[1] + b[1])),
            jnp.where(pick, s.edge + at_piece(signals.duration, later), s.edge),
            jnp.where(pick, s.edge, s.begun),
            jnp.where(pick, later, s.piece),
            follow(s.carried, Onward(span, over, pick[:, None] & begins, since, after)),
        )

    def run(self, gather, totals, follow=lambda carried, move: carried, carried: Any = ()):
        """totals = gather(totals, operands, tables, state) over all blocks of all designs.

        carried = follow(carried, onward) goes from block to block in the state.
        """
        t = tables(self.modes, self.layout, self.signals.rate, self.step)

        def body(carry):
            totals, s, op = carry
            totals = gather(totals, op, t, s)
            s = self.onward(s, op.count, follow)
            return totals, s, self.operands(s)

        begin = self.begin(carried)
        start: Any = (totals, begin, self.operands(begin))
        return jax.lax.while_loop(lambda c: jnp.any(c[1].done < self.samples), body, start)[0]


def _at_jump(jump, piece):
    return sum(jnp.where(piece[:, None] == j, jump[:, j], 0.0) for j in range(jump.shape[1]))
