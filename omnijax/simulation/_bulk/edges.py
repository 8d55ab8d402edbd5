"""Gap edges: what each adds to the states, carried back to its block's start."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from .design import EDGE, Layout, Wheel
from .free_response import Follow
from .modes import Modes
from .pole_pair import Pair, sincos, times, turning


class Edges(NamedTuple):
    """Gap edges of a window: the block and sample, and what each adds, at the block's start."""

    block: tuple[Array, ...]  # per wheel (edges, c)
    first: tuple[Array, ...]  # per wheel (edges, c): first sample after the edge
    free: tuple[tuple[Array, Array], ...]  # per pair: (edges, 2, c) twice
    forced: tuple[tuple[Array, Array], ...]  # per pair: (edges, c) twice
    spike: tuple[Array, ...]  # per pair: (edges, c), of a clipped pole on the first sample


def _kick(m: Modes, follow: Follow, layout: Layout, p: int, back, sign, first):
    """What an edge `back` s after its block's start adds there, for one pair."""
    a = layout.sets[layout.axis[p]]
    D = m.roots.D[:, a]
    split, fast, root = (x[:, a] for x in (follow.split, follow.fast, follow.root))
    u, J = m.roots.u[:, a], Pair(m.J.u[:, p], m.J.v[:, p])
    back, sign = back[:, None], sign[:, None]
    turn = turning(jnp.where(split, 0.0, D), -back)
    pair = times(J, turn, D)
    safe = jnp.where(split, 2 * root, 1.0)
    slow = jnp.exp(-(u + root) * back)
    after = (first[:, None] + 1) * layout.step - back
    quick = jnp.exp(jnp.where(fast, (u - root) * after, jnp.where(split, (root - u) * back, 0.0)))
    za = jnp.where(split, (J.u + J.v * root) / safe, pair.u) * slow
    last = -(J.u - J.v * root) / safe * quick
    zb = jnp.where(split, jnp.where(fast, 0.0, last), pair.v * slow)
    spike = jnp.sum(jnp.where(fast, last, 0.0), axis=1) if layout.stiff else 0.0 * sign[:, 0]
    return (-sign * za, -sign * zb), -sign[:, 0] * spike


def window_edges(m: Modes, follow: Follow, layout: Layout, wheels: Wheel, window) -> Edges:
    """All edges that lie in one window; those outside match none of its blocks."""
    whole = layout.step * layout.length
    fall = -1.0 if layout.half_turn else 1.0  # cosine of the sinusoid's phase at the gap's end
    block, first, free, forced, spike = [], [], [], [], []
    times_of, signs = [], []
    for j, count in enumerate(layout.edges):
        begin = window * (layout.blocks * whole)
        turns = (wheels.since[j] + begin) / wheels.period[j]
        base = jax.lax.stop_gradient(jnp.floor(turns - EDGE))
        gap = jnp.arange(count)[:, None] + base
        enter = gap * wheels.period[j] - wheels.since[j]
        leave = enter + wheels.passage[j]
        time = jnp.concatenate([enter, leave])
        number = jax.lax.stop_gradient(jnp.ceil(time / whole)) - 1
        back = jnp.where(number >= 0, time - number * whole, 0.0)
        after = jax.lax.stop_gradient(jnp.ceil(back / layout.step)) - 1
        inside = (number >= window * layout.blocks) & (number < (window + 1) * layout.blocks)
        block.append(jnp.where(inside, number - window * layout.blocks, -1.0))
        first.append(jnp.maximum(after, 0.0))
        times_of.append(jnp.clip(back, 0.0, whole))
        signs.append(jnp.concatenate([jnp.ones_like(enter), -fall * jnp.ones_like(leave)]))
    for p, j in enumerate(layout.wheel):
        none = jnp.zeros_like(times_of[j])
        kick, jump = (jnp.stack([none, none], axis=1),) * 2, none
        if layout.axis[p] < layout.directions:
            kick, jump = _kick(m, follow, layout, p, times_of[j], signs[j], first[j])
        s, c = sincos(-m.rate[j] * times_of[j])
        fa, fb = m.forced[0][p], m.forced[1][p]
        free.append(kick)
        forced.append((signs[j] * (fa * s + fb * c), signs[j] * (fa * c - fb * s)))
        spike.append(jump)
    return Edges(tuple(block), tuple(first), tuple(free), tuple(forced), tuple(spike))


def pick(number, edges: Edges, layout: Layout):
    """What the edges of block `number` (c,) add, slot by slot: at most one a slot is not zero."""
    found = [_pick_slot(number, edges, layout, slot) for slot in range(layout.slots)]
    return jax.tree.map(lambda *xs: jnp.stack(xs), *found)


def _pick_slot(number, edges: Edges, layout: Layout, slot: int):
    """Free kicks (2, p, c), changes of the forced states (p, c), spikes (p, c), samples (j, c)."""
    parts = [
        slice(slot * count, (slot + 1) * count) if layout.slots == 2 else slice(None)
        for count in layout.edges
    ]
    masks = [edges.block[j][part] == number for j, part in enumerate(parts)]

    def total(values, j: int):
        values, mask = values[parts[j]], masks[j]
        result = jnp.where(mask[0], values[0], 0.0)
        for e in range(1, len(mask)):
            result = result + jnp.where(mask[e], values[e], 0.0)
        return result

    pairs = list(enumerate(layout.wheel))
    kick = tuple(jnp.stack([total(edges.free[p][i], j) for p, j in pairs], 1) for i in (0, 1))
    shift = tuple(jnp.stack([total(edges.forced[p][i], j) for p, j in pairs]) for i in (0, 1))
    spike = jnp.stack([total(edges.spike[p], j) for p, j in pairs])
    first = [
        jnp.where(masks[j].any(axis=0), total(edges.first[j], j), np.inf)
        for j in range(len(layout.edges))
    ]
    return kick, shift, spike, jnp.stack(first)
