"""Samples of many designs at once: RMS and peak of |dR| for contacts that do not couple.

Time is cut into blocks of `length` samples.  In a block each direction's response is

    x_k = sum_modes (z + [k >= k_e] kick) . T_k + (f + [k >= k_e] df) . (cos, sin)(nu k H)

with the free state z, the forced sinusoid f, and what a gap edge inside the block adds to both,
carried back to the block's start.  States go from block to block; tables T_k are common to all
blocks.  Everything that the inner kernel reads is a plain operand of a scan, batch last: then XLA
makes one vectorised loop of it and computes nothing twice.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ._contact import Contact, Poles, approach, poles, residues
from ._ring import Pair, inverse, scaled, sincos, times, turning
from ._rows import rows_of

CLIP = 500.0  # decay over a block above which a pole acts on the first sample after an edge only
EDGE = 1e-9  # gaps by which a window looks back, so that rounding loses none
SPLIT = 1.0  # D t^2 over a block from which two real poles are followed one by one


class Wheel(NamedTuple):
    """Passages of the gaps (leading axis: the wheel)."""

    depth: Float[Array, "j c"]  # m, with the sign of the profile in the direction of motion
    period: Float[Array, "j c"]  # s, from gap to gap
    passage: Float[Array, "j c"]  # s, through a gap
    since: Float[Array, "j c"]  # s, since the last gap began, at the start


class Layout(NamedTuple):
    """What is static: which wheel drives which direction, and how time is cut."""

    axis: tuple[int, ...]  # direction of each pair
    wheel: tuple[int, ...]  # wheel of each pair
    directions: int
    sets: tuple[int, ...]  # of each direction: its row of contact parameters
    half_turn: bool  # half-sine: the gap spans pi of its sinusoid instead of 2 pi
    step: float  # s, between samples
    length: int  # samples a block
    blocks: int  # blocks a window
    windows: int
    samples: int
    edges: tuple[int, ...]  # gaps of each wheel that a window can touch
    slots: int  # 1: at most one edge a block; 2: at most one of each kind
    stiff: bool  # whether a pole may be clipped


class Design(NamedTuple):
    """Contacts, wheels and couplings of a batch of designs."""

    contact: Contact  # (directions, c)
    wheel: Wheel
    own: Float[Array, "p c"]  # 1 where the pair is a contact and its own wheel
    coupling: Float[Array, "p c"]  # drive force along the direction per drho/dt, N s/m


class Modes(NamedTuple):
    """Closed form of the response, per mode and pair."""

    roots: Poles  # (2, a, c)
    J: Pair  # (2, p, c): free response that a gap's start takes away
    forced: tuple[Array, Array]  # (p, c): x = fa sin + fb cos in the gap
    rate: Array  # (j, c): nu, rad/s
    initial: Pair  # (2, a, c): free state at the start


def modes(design: Design, layout: Layout) -> Modes:
    """Poles, residues and the forced response; the run starts from static equilibrium or rest."""
    axis, wheel = np.array(layout.axis), np.array(layout.wheel)
    roots = poles(design.contact)
    row = np.array(layout.sets)[axis]
    contact = Contact(*(rows_of(x, row) for x in design.contact))
    lam = Poles(rows_of(roots.u, row), rows_of(roots.D, row))
    r = residues(lam, approach(contact, design.own, design.coupling))
    wheels = design.wheel
    moving = wheels.passage > 0
    span = np.pi if layout.half_turn else 2 * np.pi
    rate = jnp.where(moving, span / jnp.where(moving, wheels.passage, 1.0), 1.0)
    nu, depth = rows_of(rate, wheel), rows_of(jnp.where(moving, wheels.depth, 0.0), wheel)
    root = Pair(lam.u, jnp.ones_like(lam.u))
    square = times(root, root, lam.D)
    q = scaled(depth, times(r, inverse(Pair(square.u + nu**2, square.v), lam.D), lam.D))
    fa, fb = jnp.sum(times(q, root, lam.D).v, axis=0), nu * jnp.sum(q.v, axis=0)
    inside = rows_of(wheels.since < wheels.passage, wheel)
    s, c = sincos(nu * rows_of(wheels.since, wheel))
    particular = times(q, Pair(root.u * s + nu * c, root.v * s), lam.D)
    rho = jnp.where(inside, -depth * s, 0.0)
    still = scaled(-rho, times(r, inverse(root, lam.D), lam.D))  # lambda z + r rho = 0
    begin = Pair(*(a - jnp.where(inside, b, 0.0) for a, b in zip(still, particular, strict=True)))
    return Modes(roots, scaled(nu, q), (fa, fb), rate, onto_directions(begin, layout))


def onto_directions(pairs: Pair, layout: Layout) -> Pair:
    """Sum of the pairs of each direction."""
    if layout.axis == tuple(range(layout.directions)):
        return pairs
    axis = np.array(layout.axis)
    picks = [np.flatnonzero(axis == a) for a in range(layout.directions)]
    return Pair(*(jnp.stack([x[:, i].sum(axis=1) for i in picks], axis=1) for x in pairs))


class Follow(NamedTuple):
    """How a free state moves: x = A za + B zb per sample, and the step over a whole block."""

    split: Array  # (2, a, c): two real poles followed one by one
    fast: Array  # (2, a, c): the second of them clipped
    root: Array  # (2, a, c): sqrt(D) where split
    table: tuple[Array, Array]  # (length, 2, a, c)
    block: tuple[Array, Array, Array, Array]  # (2, a, c): za' = 0 za + 1 zb, zb' = 2 za + 3 zb


def _follow(roots: Poles, layout: Layout) -> Follow:
    h, whole = layout.step, layout.step * layout.length
    split = roots.D * whole**2 > SPLIT
    root = jnp.where(split, jnp.sqrt(jnp.where(split, roots.D, 1.0)), 0.0)
    fast = split & ((roots.u - root) * whole < -CLIP)
    slow = jnp.exp((roots.u + root) * h)
    turn = turning(jnp.where(split, 0.0, roots.D), h)
    E = Pair(slow * turn.u, slow * turn.v)
    quick = jnp.where(fast, 0.0, jnp.exp(jnp.where(split & ~fast, (roots.u - root) * h, 0.0)))
    step = (  # x = S za + C zb for a pair, one exponential each where split
        jnp.where(split, slow, E.u),
        jnp.where(split, 0.0, E.v),
        jnp.where(split, 0.0, roots.D * E.v),
        jnp.where(split, quick, E.u),
    )

    def on(row, _):
        A, B = row
        row = (A * step[0] + B * step[1], B * step[3] + A * step[2])
        return row, row

    start = (jnp.where(split, 1.0, 0.0), jnp.ones_like(root))
    start = (start[0], jnp.where(split, jnp.where(fast, 0.0, 1.0), 1.0))
    table = jax.lax.scan(on, start, None, length=layout.length)[1]
    block = step

    def power(M, N):
        """(za, zb) maps: za' = M0 za + M2 zb, zb' = M1 za + M3 zb, one after the other."""
        return (
            M[0] * N[0] + M[1] * N[2],
            M[0] * N[1] + M[1] * N[3],
            M[2] * N[0] + M[3] * N[2],
            M[2] * N[1] + M[3] * N[3],
        )

    total, rest, square = None, layout.length, block
    while rest:
        if rest & 1:
            total = square if total is None else power(total, square)
        rest >>= 1
        if rest:
            square = power(square, square)
    assert total is not None
    return Follow(split, fast, root, table, total)


def _free(z: Pair, follow: Follow, layout: Layout) -> tuple[Array, Array]:
    """A free state in the form that the tables take."""
    row = np.array(layout.sets)
    split, root = follow.split[:, row], follow.root[:, row]
    safe = jnp.where(split, 2 * root, 1.0)
    za = jnp.where(split, (z.u + z.v * root) / safe, z.u)
    zb = jnp.where(split, -(z.u - z.v * root) / safe, z.v)
    return za, jnp.where(follow.fast[:, row], 0.0, zb)


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


def _window_edges(m: Modes, follow: Follow, layout: Layout, wheels: Wheel, window) -> Edges:
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
        kick, jump = _kick(m, follow, layout, p, times_of[j], signs[j], first[j])
        s, c = sincos(-m.rate[j] * times_of[j])
        fa, fb = m.forced[0][p], m.forced[1][p]
        free.append(kick)
        forced.append((signs[j] * (fa * s + fb * c), signs[j] * (fa * c - fb * s)))
        spike.append(jump)
    return Edges(tuple(block), tuple(first), tuple(free), tuple(forced), tuple(spike))


class Operands(NamedTuple):
    """What the inner kernel reads of one block; slots s, pairs p, directions a."""

    free: tuple[Array, Array]  # (2, a, c)
    forced: tuple[Array, Array]  # (p, c): cosine and sine parts
    kick: tuple[Array, Array]  # (s, 2, p, c)
    shift: tuple[Array, Array]  # (s, p, c)
    spike: Array  # (s, p, c)
    first: Array  # (s, j, c)


def _pick(number, edges: Edges, layout: Layout):
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


def _square(op: Operands, follow: Follow, waves, layout: Layout, gram):
    """|dR|^2 at the samples of one block, (length, c)."""
    k = jnp.arange(layout.length, dtype=float)[:, None]
    x = [_free_part(op, follow, layout, a, k) for a in range(layout.directions)]
    for p, a in enumerate(layout.axis):
        x[a] = x[a] + _forced_part(op, waves, layout, p, k)
    if gram is None:
        return sum(v * v for v in x)
    total = 0.0
    for a in range(layout.directions):
        for b in range(a, layout.directions):
            total = total + (1.0 if a == b else 2.0) * gram[a, b] * x[a] * x[b]
    return total


def _onward(op: Operands, follow: Follow, waves, layout: Layout):
    """Free and forced states at the next block's start."""
    za, zb = op.free
    kicks = [jnp.sum(k, axis=0) for k in op.kick]
    ka, kb = onto_directions(Pair(*kicks), layout)
    za, zb = za + ka, zb + kb
    M = [x[:, np.array(layout.sets)] for x in follow.block]
    free = (M[0] * za + M[2] * zb, M[1] * za + M[3] * zb)
    j = np.array(layout.wheel)
    c, s = waves[0][-1][j], waves[1][-1][j]
    f0, f1 = (f + jnp.sum(d, axis=0) for f, d in zip(op.forced, op.shift, strict=True))
    return free, (f0 * c + f1 * s, f1 * c - f0 * s)


def _waves(rate, layout: Layout):
    """cos and sin of nu k H for the samples of a block, (length, j, c), by turning."""
    s1, c1 = sincos(rate * layout.step)

    def on(row, _):
        c, s = row
        row = (c * c1 - s * s1, s * c1 + c * s1)
        return row, row

    start = (jnp.ones_like(rate), jnp.zeros_like(rate))
    return jax.lax.scan(on, start, None, length=layout.length)[1]


def samples(design: Design, layout: Layout, gram=None, tag: bool = True):
    """Sum of |dR|^2 over the samples, the largest of them, and its number; (c,) each.

    The number of its block rides in the last 16 bits of the largest square.
    """
    return samples_of(modes(design, layout), design.wheel, layout, gram, tag)


def samples_of(m: Modes, wheel: Wheel, layout: Layout, gram=None, tag: bool = True):
    """`samples` of designs whose modes are known."""
    follow = _follow(m.roots, layout)
    waves = _waves(m.rate, layout)
    j = np.array(layout.wheel)
    inside = (wheel.since < wheel.passage)[j]
    s, c = sincos((m.rate * wheel.since)[j])
    fa, fb = m.forced
    forced = (
        jnp.where(inside, fa * s + fb * c, 0.0),
        jnp.where(inside, fa * c - fb * s, 0.0),
    )
    size = wheel.depth.shape[-1]
    total = jnp.zeros((layout.length, size), complex)

    def window(carry, number):
        free, forced, total = carry
        edges = _window_edges(m, follow, layout, wheel, number)
        begin, before = (free, forced), jnp.full(size, -1.0)
        empty = jax.tree.map(
            lambda x: jnp.zeros(x.shape), jax.eval_shape(lambda: _pick(before, edges, layout))
        )
        nothing = Operands(*jax.tree.map(jnp.zeros_like, begin), *empty)

        def block(carry, _):  # the first pass only fetches the window's first block
            total, op, here = carry
            square = _square(op, follow, waves, layout, gram)
            tagged = _tag(square, jnp.maximum(here, 0) + number * layout.blocks) if tag else square
            if layout.samples % layout.length or layout.windows > 1:
                k = jnp.arange(layout.length, dtype=float)[:, None]
                place = (here + number * layout.blocks) * layout.length + k
                counts = (place < layout.samples) & (here >= 0)
                square = jnp.where(counts, square, 0.0)
                tagged = jnp.where(counts, tagged, 0.0)
            total = jax.lax.complex(total.real + square, jnp.maximum(total.imag, tagged))
            onward = _onward(op, follow, waves, layout)
            free, forced = jax.tree.map(lambda a, b: jnp.where(here < 0, a, b), begin, onward)
            op = Operands(free, forced, *_pick(here + 1, edges, layout))
            return (total, op, here + 1), None

        passes = layout.blocks + 1
        (total, op, _), _ = jax.lax.scan(block, (total, nothing, before), None, length=passes)
        return (op.free, op.forced, total), None

    start = (_free(m.initial, follow, layout), forced, total)
    count = jnp.arange(layout.windows, dtype=float)
    total = jax.lax.scan(window, start, count)[0][2]
    row = jnp.argmax(total.imag, axis=0)
    best = jnp.take_along_axis(total.imag, row[None], axis=0)[0]
    bits = jax.lax.bitcast_convert_type(best, jnp.int64)
    return jnp.sum(total.real, axis=0), best, (bits & _MASK) * layout.length + row


_MASK = 0xFFFF


def _tag(square, number):
    bits = jax.lax.bitcast_convert_type(square, jnp.int64)
    return jax.lax.bitcast_convert_type((bits & ~_MASK) | number.astype(jnp.int64), jnp.float64)
