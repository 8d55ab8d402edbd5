"""Samples of many designs at once: RMS and peak of |dR| for contacts that do not couple.

Time is cut into blocks of `length` samples.  In a block each direction's response is

    x_k = sum_modes (z + [k >= k_e] kick) . T_k + (f + [k >= k_e] df) . (cos, sin)(nu k H)

with the free state z, the forced sinusoid f, and what a gap edge inside the block adds to both,
carried back to the block's start.  States go from block to block; tables T_k are common to all
blocks.  Everything that the inner kernel reads is a plain operand of a scan, batch last: then XLA
makes one vectorised loop of it and computes nothing twice.
"""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from .design import Design, Layout, Wheel
from .edges import pick, window_edges
from .free_response import Follow, follow_poles, free_states, waves_of
from .modes import Modes, modes, onto_directions
from .pole_pair import Pair, sincos


class Operands(NamedTuple):
    """What the inner kernel reads of one block; slots s, pairs p, directions a."""

    free: tuple[Array, Array]  # (2, a, c)
    forced: tuple[Array, Array]  # (p, c): cosine and sine parts
    kick: tuple[Array, Array]  # (s, 2, p, c)
    shift: tuple[Array, Array]  # (s, p, c)
    spike: Array  # (s, p, c)
    first: Array  # (s, j, c)


def _free_part(op: Operands, follow: Follow, layout: Layout, a: int, k):
    """x of one direction from its free state, at the samples of a block."""
    pairs = [(p, j) for p, j in enumerate(layout.wheel) if layout.axis[p] == a]
    x = 0.0
    for m in range(2):
        for i in (0, 1):
            state = op.free[i][m, a]
            for p, j in pairs:
                for s in range(layout.slots):
                    state = state + jnp.where(k >= op.first[s, j], op.kick[i][s, m, p], 0.0)
            x = x + state * follow.table[i][:, m, layout.sets[a]]
    return x


def _forced_part(op: Operands, waves, layout: Layout, p: int, k):
    """x of one pair from its forced state, and what a clipped pole adds."""
    j, x = layout.wheel[p], 0.0
    for i in (0, 1):
        state = op.forced[i][p]
        for s in range(layout.slots):
            state = state + jnp.where(k >= op.first[s, j], op.shift[i][s, p], 0.0)
        x = x + state * waves[i][:, j]
    for s in range(layout.slots if layout.stiff else 0):
        x = x + jnp.where(k == op.first[s, j], op.spike[s, p], 0.0)
    return x


def signals(op: Operands, follow: Follow, waves, layout: Layout) -> list[Array]:
    """x of every direction at the samples of one block, and the sinusoids by themselves."""
    k = jnp.arange(layout.length, dtype=float)[:, None]
    x: list = [_free_part(op, follow, layout, a, k) for a in range(layout.directions)]
    x += [0.0] * (max(layout.axis) + 1 - layout.directions)
    for p, a in enumerate(layout.axis):
        x[a] = x[a] + _forced_part(op, waves, layout, p, k)
    return x


def square_of(x: list[Array], gram):
    """|dR|^2 of the directions' x."""
    if gram is None:
        return sum(v * v for v in x)
    total = 0.0
    for a in range(len(x)):
        for b in range(a, len(x)):
            total = total + (1.0 if a == b else 2.0) * gram[a, b] * x[a] * x[b]
    return total


def _onward(op: Operands, follow: Follow, waves, layout: Layout):
    """Free and forced states at the next block's start."""
    za, zb = op.free
    kicks = [jnp.sum(k, axis=0) for k in op.kick]
    ka, kb = onto_directions(Pair(*kicks), layout)
    za, zb = za + ka, zb + kb
    M = [x[:, np.array(layout.sets[: layout.directions])] for x in follow.block]
    free = (M[0] * za + M[2] * zb, M[1] * za + M[3] * zb)
    j = np.array(layout.wheel)
    c, s = waves[0][-1][j], waves[1][-1][j]
    f0, f1 = (f + jnp.sum(d, axis=0) for f, d in zip(op.forced, op.shift, strict=True))
    return free, (f0 * c + f1 * s, f1 * c - f0 * s)


def samples(design: Design, layout: Layout, gram=None, tag: bool = True):
    """Sum of |dR|^2 over the samples, the largest of them, and its number; (c,) each.

    The number of its block rides in the last 16 bits of the largest square.
    """
    return samples_of(modes(design, layout), design.wheel, layout, gram, tag)


def samples_of(m: Modes, wheel: Wheel, layout: Layout, gram=None, tag: bool = True):
    """`samples` of designs whose modes are known."""

    def gather(total, x, block, counts):
        square = square_of(x, gram)
        tagged = _tag(square, jnp.maximum(block, 0)) if tag else square
        if counts is not None:
            square, tagged = jnp.where(counts, square, 0.0), jnp.where(counts, tagged, 0.0)
        return jax.lax.complex(total.real + square, jnp.maximum(total.imag, tagged))

    total = jnp.zeros((layout.length, wheel.depth.shape[-1]), complex)
    total = over_blocks(gather, total, m, wheel, layout)
    row = jnp.argmax(total.imag, axis=0)
    best = jnp.take_along_axis(total.imag, row[None], axis=0)[0]
    bits = jax.lax.bitcast_convert_type(best, jnp.int64)
    return jnp.sum(total.real, axis=0), best, (bits & _MASK) * layout.length + row


def _forced_start(m: Modes, wheel: Wheel, layout: Layout) -> tuple[Array, Array]:
    """Cosine and sine parts of the pairs' sinusoids at the start; nothing outside a gap."""
    j = np.array(layout.wheel)
    inside = (wheel.since < wheel.passage)[j]
    s, c = sincos((m.rate * wheel.since)[j])
    fa, fb = m.forced
    return jnp.where(inside, fa * s + fb * c, 0.0), jnp.where(inside, fa * c - fb * s, 0.0)


def over_blocks(gather: Callable, total, m: Modes, wheel: Wheel, layout: Layout):
    """total = gather(total, signals, block, counts) over the blocks of all windows.

    `total`, of one array or several, has a row for each sample of a block; `counts` says which
    samples are part of the run, None where all are.  A first pass that only fetches a window's
    first block has signals of zero.
    """
    follow, waves = follow_poles(m.roots, layout), waves_of(m.rate, layout)
    size = wheel.depth.shape[-1]

    def window(carry, number):
        free, forced, total = carry
        edges = window_edges(m, follow, layout, wheel, number)
        begin, before = (free, forced), jnp.full(size, -1.0)
        empty = jax.tree.map(
            lambda x: jnp.zeros(x.shape), jax.eval_shape(lambda: pick(before, edges, layout))
        )
        nothing = Operands(*jax.tree.map(jnp.zeros_like, begin), *empty)

        def block(carry, _):
            total, op, here = carry
            x = signals(op, follow, waves, layout)
            total = gather(total, x, here + number * layout.blocks, counts_of(here, number))
            onward = _onward(op, follow, waves, layout)
            free, forced = jax.tree.map(lambda a, b: jnp.where(here < 0, a, b), begin, onward)
            op = Operands(free, forced, *pick(here + 1, edges, layout))
            return (total, op, here + 1), None

        passes = layout.blocks + 1
        (total, op, _), _ = jax.lax.scan(block, (total, nothing, before), None, length=passes)
        return (op.free, op.forced, total), None

    def counts_of(here, number):
        if layout.samples % layout.length == 0 and layout.windows == 1:
            return None
        k = jnp.arange(layout.length, dtype=float)[:, None]
        place = (here + number * layout.blocks) * layout.length + k
        return (place < layout.samples) & (here >= 0)

    forced = _forced_start(m, wheel, layout)
    start = (free_states(m.initial, follow, layout), forced, total)
    return jax.lax.scan(window, start, jnp.arange(layout.windows, dtype=float))[0][2]


_MASK = 0xFFFF


def _tag(square, number):
    bits = jax.lax.bitcast_convert_type(square, jnp.int64)
    return jax.lax.bitcast_convert_type((bits & ~_MASK) | number.astype(jnp.int64), jnp.float64)
