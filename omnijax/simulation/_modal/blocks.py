"""Responses of many designs at their samples, block by block; batch last.

A block is up to `LENGTH` samples of one design before the next edge of any of its signals; a loop
runs until every design of a group has all its samples.  Nothing about speeds, edges, step or
duration is static.  Between edges a mode is a free part, which only decays, and the sinusoids'
part; at an edge the free part jumps by the difference of the sinusoids' parts.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .arithmetic import exponential, flushed, materialised, product, quotient, sincos
from .poles import Modes
from .signals import Signals
from .system import Layout

LENGTH = 32  # samples a block at most


class Forced(NamedTuple):
    """Sinusoids' parts by piece, and the jumps of the free part where pieces begin."""

    cosine: Float[Array, "o v k c"]
    sine: Float[Array, "o v k c"]
    jump0: Float[Array, "g k p c"]
    jump1: Float[Array, "g k p c"]
    free0: Float[Array, "p c"]  # free part at the start
    free1: Float[Array, "p c"]


def particular(m: Modes, b, rate, cosine, sine):
    """z = (a cos + s sin)(rate t) of every pair, moved by b (cosine cos + sine sin)(rate t).

    a = -b (lambda cosine + rate sine)/(lambda^2 + rate^2),
    s = b (rate cosine - lambda sine)/(lambda^2 + rate^2).
    """
    pole = m.l0, m.l1
    square = product(m.kind, pole, pole)
    flat = jnp.where(m.kind > 0, 0.0, rate * rate)
    r = quotient(m.kind, b, (square[0] + rate * rate, square[1] + flat))
    turned = product(m.kind, r, pole)
    a = [-(x * cosine + y * rate * sine) for x, y in zip(turned, r, strict=True)]
    return a, [y * rate * cosine - x * sine for x, y in zip(turned, r, strict=True)]


def forced(m: Modes, signals: Signals, direct, slope, layout: Layout) -> Forced:
    """What does not change during a run; `direct`, `slope` (l, o, c): outputs of rho, drho/dt."""
    pieces = max([kind.pieces for kind in layout.kinds])
    cosines, sines, jumps = [], [], []
    free = m.b0[-1], m.b1[-1]
    first, edged = 0, 0
    for kind in layout.kinds:
        v = slice(first, first + kind.waves)
        rate = signals.rate[v, None, None]  # (w, 1, 1, c)
        cosine, sine = signals.cosine[v, : kind.pieces, None], signals.sine[v, : kind.pieces, None]
        b = m.b0[kind.column], m.b1[kind.column]
        a, s = particular(m, b, rate, cosine, sine)  # (w, k, p, c)
        D, R = direct[kind.column][:, None, None], slope[kind.column][:, None, None]

        def shown(z):
            first, second = (jnp.einsum("opc,wkpc->owkc", *x) for x in zip(m[3:5], z, strict=True))
            return first + second

        cos_, sin_, nu = cosine[:, :, 0], sine[:, :, 0], rate[:, :, 0]
        room = ((0, 0), (0, 0), (0, pieces - kind.pieces), (0, 0))
        cosines.append(jnp.pad(shown(a) + D * cos_ + R * nu * sin_, room))
        sines.append(jnp.pad(shown(s) + D * sin_ - R * nu * cos_, room))
        if kind.pieces > 1:
            turn = signals.rate[v, None] * signals.duration[edged, None, : kind.pieces]
            sn, cs = sincos(turn)  # (w, k, c)
            end = [jnp.sum(a[i] * cs[:, :, None] + s[i] * sn[:, :, None], 0) for i in (0, 1)]
            begin = [jnp.sum(a[i], 0) for i in (0, 1)]
            jump = [jnp.roll(e, 1, axis=0) - x for e, x in zip(end, begin, strict=True)]
            jumps.append([jnp.pad(x, ((0, pieces - kind.pieces), (0, 0), (0, 0))) for x in jump])
            sn, cs = sincos(signals.rate[v] * signals.since[edged])
            now = [a[i] * cs[:, None, None] + s[i] * sn[:, None, None] for i in (0, 1)]
            here = jnp.arange(kind.pieces)[:, None] == signals.piece[edged]
            now = [jnp.sum(jnp.where(here[:, None], x, 0.0), axis=(0, 1)) for x in now]
            edged += 1
        else:
            now = [jnp.sum(a[i], axis=(0, 1)) for i in (0, 1)]
        free = free[0] - now[0], free[1] - now[1]
        first += kind.waves
    none = jnp.zeros((0, pieces, *m.l0.shape))
    j0, j1 = (jnp.stack([j[i] for j in jumps]) if jumps else none for i in (0, 1))
    return Forced(jnp.concatenate(cosines, 1), jnp.concatenate(sines, 1), j0, j1, *free)


class Tables(NamedTuple):
    """Pairs and sinusoids over the samples of a block."""

    T0: Float[Array, "k p c"]
    T1: Float[Array, "k p c"]
    cosine: Float[Array, "k v c"]
    sine: Float[Array, "k v c"]


def tables(m: Modes, rate, step) -> Tables:
    """exp and sinusoids at 0, step, ..."""
    E = materialised(exponential, m.kind, m.l0, m.l1, jnp.broadcast_to(step, m.kind.shape))

    def on(row, _):
        return product(m.kind, row, (E.real, E.imag)), row

    one = jnp.ones_like(m.kind), jnp.where(m.kind > 0, 0.0, 1.0)
    T0, T1 = (flushed(x) for x in jax.lax.scan(on, one, None, length=LENGTH)[1])
    s, c = sincos(rate * step)

    def turn(row, _):
        return (row[0] * c - row[1] * s, row[1] * c + row[0] * s), row

    begin = jnp.ones_like(rate), jnp.zeros_like(rate)
    return Tables(T0, T1, *jax.lax.scan(turn, begin, None, length=LENGTH)[1])


class Operands(NamedTuple):
    """What a block's samples are made of."""

    count: Float[Array, " c"]
    w0: Float[Array, "o p c"]
    w1: Float[Array, "o p c"]
    f0: Float[Array, "o v c"]
    f1: Float[Array, "o v c"]


def row_signal(op: Operands, t: Tables, o, pairs=None) -> Array:
    """Output number `o`, traced or not, at the samples of a block, (k, c); `pairs`: it shows."""
    w0, w1, f0, f1 = (x[o] for x in (op.w0, op.w1, op.f0, op.f1))
    x = jnp.zeros_like(t.T0[:, 0])
    for p in range(t.T0.shape[1]) if pairs is None else pairs:
        x = x + w0[p] * t.T0[:, p] + w1[p] * t.T1[:, p]
    for v in range(t.cosine.shape[1]):
        x = x + f0[v] * t.cosine[:, v] + f1[v] * t.sine[:, v]
    return x


class State(NamedTuple):
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


def run(
    m: Modes, signals: Signals, F: Forced, layout: Layout, step, samples, gather, totals,
    follow=lambda carried, onward: carried, carried=(),
):  # fmt: skip
    """totals = gather(totals, operands, tables, state) over all blocks of all designs.

    carried = follow(carried, onward) goes from block to block in the state.
    """
    k, G = m.kind > 0, signals.duration.shape[0]
    counts = np.array([kind.pieces for kind in layout.kinds[:G]])[:, None]
    of = np.repeat(np.arange(len(layout.kinds)), [kind.waves for kind in layout.kinds])
    edged = np.flatnonzero(of < G)  # sinusoids of signals with edges
    t = tables(m, signals.rate, step)

    def at_piece(values, piece):
        """Rows (..., g, k, c) of each signal's piece."""
        return sum(jnp.where(piece == j, values[..., j, :], 0.0) for j in range(values.shape[-2]))

    def operands(s: State, count) -> Operands:
        z0, z1 = s.free
        w0 = m.c0 * z0 + jnp.where(k, m.c1 * z1, 0.0)
        w1 = m.c1 * jnp.where(k, z0, z1) - jnp.where(k, m.c0 * z1, 0.0)
        none = jnp.zeros((len(of) - len(edged), *s.done.shape))  # of signals without edges
        piece, begun = (jnp.concatenate([x[of[edged]], none]) for x in (s.piece, s.begun))
        fa, fb = at_piece(F.cosine, piece), at_piece(F.sine, piece)
        phase = signals.rate * (s.done * step - begun)
        sc = materialised(lambda a: jax.lax.complex(*sincos(a)), phase)
        sn, cs = sc.real, sc.imag
        return Operands(count, w0, w1, fa * cs + fb * sn, fb * cs - fa * sn)

    def ahead(s: State):
        last = jnp.min(jnp.floor(s.edge / step), axis=0, initial=jnp.inf)
        return jnp.clip(jnp.minimum(last + 1, samples) - s.done, 0.0, LENGTH)

    def onward(s: State, count) -> State:
        done = s.done + count
        now = jnp.min(s.edge, axis=0, initial=jnp.inf)
        taken = jnp.floor(now / step) + 1 <= done
        which = jnp.argmin(s.edge, axis=0) if G else jnp.zeros_like(done)
        pick = (jnp.arange(G)[:, None] == which) & taken
        later = jnp.where(s.piece + 1 >= counts, 0.0, s.piece + 1)
        since = jnp.where(taken, done * step - now, 0.0)
        spans = jnp.stack([jnp.broadcast_to(x, m.kind.shape) for x in (count * step, since)])
        pairs = [jnp.stack([x, x]) for x in (m.kind, m.l0, m.l1)]
        E = materialised(exponential, *pairs, spans)
        jump = [
            jnp.sum(jnp.where(pick[:, None], at_jump(j, later), 0.0), axis=0)
            for j in (F.jump0, F.jump1)
        ]
        a = product(m.kind, s.free, (E[0].real, E[0].imag))
        b = product(m.kind, jump, (E[1].real, E[1].imag))
        length = at_piece(signals.duration, later)
        begins = later[:, None] == jnp.arange(signals.duration.shape[1])[:, None]
        move = Onward(
            spans[0, 0], (E[0].real, E[0].imag), pick[:, None] & begins, since,
            (E[1].real, E[1].imag),
        )  # fmt: skip
        return State(
            done,
            (flushed(a[0] + b[0]), flushed(a[1] + b[1])),
            jnp.where(pick, s.edge + length, s.edge),
            jnp.where(pick, s.edge, s.begun),
            jnp.where(pick, later, s.piece),
            follow(s.carried, move),
        )

    def at_jump(jump, piece):
        return sum(jnp.where(piece[:, None] == j, jump[:, j], 0.0) for j in range(jump.shape[1]))

    def body(carry):
        totals, s, op = carry
        totals = gather(totals, op, t, s)
        s = onward(s, op.count)
        return totals, s, operands(s, ahead(s))

    zero = jnp.zeros(m.l0.shape[-1])
    edge = at_piece(signals.duration, signals.piece) - signals.since
    begin = State(zero, (F.free0, F.free1), edge, -signals.since, signals.piece, carried)
    start: Any = (totals, begin, operands(begin, ahead(begin)))
    return jax.lax.while_loop(lambda c: jnp.any(c[1].done < samples), body, start)[0]
