"""Samples of the long run's outputs along each phase, block by block.

A block is `LENGTH` even samples of a phase up to the next edge of any of its signals at most.  Its
step follows the fastest pole that still bends an output there: fine after an edge, coarse where
only slow parts are left.  Where nothing up to the next edge can exceed what is known already, one
block goes there.
"""

import functools
import operator
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from ..._one_kernel import one_kernel
from ..arithmetic import (
    Pair,
    across,
    flushed,
    materialised,
    onward,
    plus,
    powers,
    product,
    sincos,
    stored,
    summed,
    turned,
)
from .curves import ModalCurves, free_size, moved_by, size_of, weights
from .phases import piece_at

LENGTH = 32  # samples a block
FEW = 4  # of them after each long step
OVERLAP = 2  # samples that the next block begins with again, so that each has one on either side
STEP = 0.4  # of a pole's 1/|lambda|: a sixteenth of an oscillation
COARSE = 0.8  # where directions are looked for, not times
BENDS = 0.1  # of the largest bend: what bends less makes no maximum of its own beside that one's
NOTHING = 1e-7  # of an output's size: not asked for
FEWEST, MOST = 62, 65536  # samples a piece


class GapPlace(NamedTuple):
    """Where the phases of a cycle are, and what their outputs show from there on."""

    time: Float[Array, "s c"]
    edge: Bool[Array, "s c"]  # whether a piece begins there
    piece: tuple[Array, ...]  # of each signal with edges
    end: tuple[Array, ...]  # s, of that piece
    free: tuple[Pair, ...]  # (r, q, s, c), of each signal with edges
    swing: tuple[Pair, ...]  # (r, w, s, c), of each signal


def _start(f: ModalCurves) -> GapPlace:
    """t = 0."""
    time, pieces, ends, free, swings = 0.0 * f.cycle.period, [], [], [], []
    for i, wave in enumerate(f.waves):
        here, into = piece_at(wave, time)
        s, c = stored(lambda rate, into: sincos(rate * into), wave.rate, into)
        a, b = (summed(here * x[i], 2) for x in (f.cosine, f.sine))
        swings.append(turned(a, b, c, s))
        if i < len(f.free):
            number = jnp.arange(len(here))[:, None, None]
            pieces.append(summed(here * number))
            ends.append(summed(here * (wave.begin + wave.duration)) - wave.place)
            z = product(f.kind, [summed(here * x, 2) for x in f.free[i]], moved_by(f, into))
            free.append(weights(f, z))
    return GapPlace(time, time == 0, tuple(pieces), tuple(ends), tuple(free), tuple(swings))


class Block(NamedTuple):
    """A block's samples are `step` apart; where nothing `counts`, it goes to the next edge."""

    begin: Float[Array, "s c"]
    step: Float[Array, "s c"]
    counts: Bool[Array, "s c"]
    first: Bool[Array, "s c"]  # whether it begins at an edge
    last: Bool[Array, "s c"]  # whether it goes to the next one


class SeenParts(NamedTuple):
    """What outputs, or combinations of them (n), show from a place on."""

    kind: Float[Array, "n q s c"]
    pole: Pair
    free: Pair  # (n, q, s, c), weights of pairs
    swing: tuple[Pair, ...]  # (n, w, s, c), of each signal

    def reach(self) -> Float[Array, "n s c"]:
        """What none of them exceeds up to the next edge."""
        total = summed(free_size(self.kind, self.free), 1)
        for a, b in self.swing:
            total = total + summed(jnp.sqrt(a * a + b * b), 1)
        return total


def _combined(d, x):
    """Combinations d (n, r, s, c) of outputs (r, ., s, c)."""
    return functools.reduce(operator.add, (d[:, o, None] * x[o] for o in range(d.shape[1])))


def _seen(f: ModalCurves, at: GapPlace, d) -> SeenParts:
    """The outputs at a place, or combinations d of them."""
    w = functools.reduce(plus, at.free, (jnp.zeros_like(f.show[0]), jnp.zeros_like(f.show[1])))
    if d is None:
        return SeenParts(f.kind, f.pole, w, at.swing)
    swing = tuple((_combined(d, a), _combined(d, b)) for a, b in at.swing)
    if len(f.kind) == 1:  # outputs have their pairs in common
        w = stored(lambda d, a, b: (_combined(d, a), _combined(d, b)), d, *w)
        return SeenParts(f.kind, f.pole, w, swing)
    first, second = (_beside(d[:, :, None] * x, 1) for x in w)
    kind, *pole = (_beside(x, 0)[None] for x in (f.kind, *f.pole))
    return SeenParts(kind, (pole[0], pole[1]), (first, second), swing)


def _beside(x, axis: int):
    """Pairs of all outputs along one axis."""
    return x.reshape(*x.shape[:axis], -1, *x.shape[axis + 2 :])


def _block(f: ModalCurves, at: GapPlace, fine, none) -> tuple[Block, Array, Array]:
    """The block that begins here, by what it moves on, and where the next edge is."""
    end, length = f.cycle.period, jnp.full_like(at.time, jnp.inf)
    for wave, piece, own_end in zip(f.cycle.edged, at.piece, at.end, strict=True):
        own = _at_piece(wave.duration, piece, 0)
        length = jnp.minimum(length, jnp.where(own > 0, own, jnp.inf))
        end = jnp.minimum(end, own_end)
    left = jnp.maximum(end - at.time, 0.0)
    length = jnp.where(jnp.isfinite(length), length, f.cycle.period)
    step = jnp.maximum(fine, length / MOST)
    step = jnp.minimum(jnp.minimum(step, length / FEWEST), left / (LENGTH - 1))
    done = none | (step * (LENGTH - 1) >= left * (1 - 1e-12))
    on = jnp.where(done, left, step * (LENGTH - OVERLAP))
    time = jnp.where(done, end, at.time + on)
    return Block(at.time, jnp.where(none, 0.0, step), ~none, at.edge, done), on, time


def _at_piece(x, piece, axis: int):
    """x at the piece that each is on."""
    rows = [jax.lax.index_in_dim(x, k, axis, keepdims=False) for k in range(x.shape[axis])]
    here = rows[0]
    for k, row in enumerate(rows[1:], 1):
        here = jnp.where(piece == k, row, here)
    return here


def _begins(f: ModalCurves) -> list[Pair]:
    """Weights (r, q, k, s, c) at the begin of every piece of each signal with edges."""

    def at_begins(kind, pole, show, y0, y1):
        wide = f._replace(kind=kind[:, :, None], pole=pole, show=tuple(x[:, :, None] for x in show))
        return weights(wide, (y0, y1))

    return [stored(at_begins, f.kind, f.pole, f.show, *y) for y in f.free]


def _onward(
    f: ModalCurves, begins: list[Pair], at: GapPlace, time, E: Pair, turn: list[Pair]
) -> GapPlace:
    """The place at that time, where pairs have moved by E and sinusoids by `turn`."""
    end = functools.reduce(jnp.minimum, at.end, f.cycle.period)
    close = end + 1e-12 * f.cycle.period
    pieces, ends, free, swings = [], [], [], []
    for i, wave in enumerate(f.waves):
        moved = turned(*at.swing[i], *turn[i])
        if i >= len(f.free):
            swings.append(moved)
            continue
        past = (time >= end) & (at.end[i] <= close) & (end < f.cycle.period)
        later = jnp.where(at.piece[i] + 1 >= len(wave.duration), 0.0, at.piece[i] + 1)
        begun = materialised(lambda past, later: jnp.where(past, later, -1.0), past, later)
        pieces.append(jnp.where(past, later, at.piece[i]))
        ends.append(at.end[i] + jnp.where(past, _at_piece(wave.duration, later, 0), 0.0))
        free.append(stored(_moved_on, begun, f.kind, at.free[i], E, begins[i]))
        swings.append(
            tuple(
                _where_begun(begun, x[i], y) for x, y in zip((f.cosine, f.sine), moved, strict=True)
            )
        )
    return GapPlace(time, time >= end, tuple(pieces), tuple(ends), tuple(free), tuple(swings))


def _moved_on(begun, kind, w: Pair, E: Pair, begins: Pair) -> Pair:
    """Weights when the pairs have moved by E, or those of the piece that has begun."""
    moved = onward(kind, w, E)
    first, second = (flushed(_where_begun(begun, x, y)) for x, y in zip(begins, moved, strict=True))
    return first, second


def _where_begun(begun, x, otherwise):
    """x (r, ., k, s, c) of the piece that has begun, if one has."""
    for k in range(x.shape[2]):
        otherwise = jnp.where(begun == k, x[:, :, k], otherwise)
    return otherwise


def _fine(f: ModalCurves, seen: SeenParts, size) -> Float[Array, "s c"]:
    """1/|lambda| of the fastest pole that bends what is seen, of that size (n, s, c)."""

    def parts():
        """Of every pole of each combination: how much is seen of it, and |lambda|^2."""
        k, (first, second) = seen.kind > 0, (jnp.abs(x) for x in seen.free)
        square = jnp.where(k, seen.pole[0] ** 2 + seen.pole[1] ** 2, seen.pole[0] ** 2)
        yield jnp.where(k, first + second, first), square
        yield jnp.where(k, 0.0, second), jnp.where(k, 0.0, seen.pole[1] ** 2)

    bend = 0.0 * size
    for wave, (a, b) in zip(f.waves, seen.swing, strict=True):
        bend = bend + summed((jnp.abs(a) + jnp.abs(b)) * wave.rate**2, 1)
    for shown, own in parts():
        bend = jnp.maximum(bend, _largest(shown * own, 1))
    fastest = 0.0 * f.cycle.period
    for shown, own in parts():
        much = (shown * own > BENDS * bend[:, None]) & (shown > NOTHING * size[:, None])
        fastest = jnp.maximum(fastest, _largest(_largest(jnp.where(much, own, 0.0), 0), 0))
    return 1 / jnp.maximum(jnp.sqrt(fastest), 1e-30)


def _largest(x, axis: int):
    """Maximum over a short axis."""
    return across(jnp.maximum, jnp.moveaxis(x, axis, 0))


def _samples(f: ModalCurves, at: GapPlace, E: Pair, turn: list[Pair]) -> Float[Array, "k r s c"]:
    """The outputs at all samples of a block; pairs and sinusoids move by E and `turn` a step.

    Sample `FEW` i + j is i long steps after the block's begin moved on by j short ones.
    """

    def both(kind, E: Pair) -> tuple[Pair, Pair]:
        """Powers of E by short and by long steps."""
        short = powers(kind, E, FEW)
        last = short[0][-1], short[1][-1]
        late = stored(lambda kind, *x: product(kind, x[:2], x[2:]), kind, *last, *E)
        return short, powers(kind, late, LENGTH // FEW)

    def begins(kind, w0, w1, z0, z1, swings, early):
        """Weights after j short steps, (j, r, ...)."""
        swings = [
            turned(a, b, c[:, None], s[:, None])
            for (a, b), (c, s) in zip(swings, early, strict=True)
        ]
        return onward(kind, (w0, w1), (z0, z1)), swings

    def values(moved, swings, far, late):
        x = 0.0
        for p in range(far[0].shape[2]):
            for w, z in zip(moved, far, strict=True):
                x = x + w[None, :, :, p] * z[:, None, :, p]
        for (a, b), (c, s) in zip(swings, late, strict=True):
            for v in range(c.shape[1]):
                x = (
                    x
                    + a[None, :, :, v] * c[:, None, None, v]
                    + b[None, :, :, v] * s[:, None, None, v]
                )
        return x  # (i, j, r, s, c)

    kind = f.kind + 0 * E[0]
    (short, far), w = (
        both(kind, E),
        functools.reduce(plus, at.free, (0.0 * f.show[0], 0.0 * f.show[1])),
    )
    turns = [both(jnp.ones_like(c), (c, s)) for c, s in turn]
    early, late = [x[0] for x in turns], [x[1] for x in turns]
    moved, swings = materialised(begins, kind, *w, *short, list(at.swing), early)
    x = materialised(values, moved, swings, far, late)
    return x.reshape(LENGTH, *x.shape[2:])


def along(f: ModalCurves, gather, totals, idle, share: float = STEP, d=None):
    """totals = gather(totals, samples (k, r, s, c), block) over one period of every phase.

    `idle(totals, reach)` (s, c): whether nothing counts up to the next edge, where no output, or
    none of their combinations d (n, r, s, c), exceeds `reach`.
    """
    size, begins = size_of(f), _begins(f)
    size = jnp.maximum(size, NOTHING * jnp.max(size, axis=0))
    if d is not None:
        size = _combined(jnp.abs(d), size[:, None])[:, 0]
    size = jnp.broadcast_to(size, (len(size), *f.cycle.period.shape))

    def body(carry):
        totals, at = carry
        seen = _seen(f, at, d)
        none = materialised(lambda seen, totals: idle(totals, seen.reach()), seen, totals)
        none = none | (at.time >= f.cycle.period)
        fine = materialised(lambda size, seen: share * _fine(f, seen, size), size, seen)
        block, on, time = _block(f, at, fine, none)
        steps = jnp.stack([block.step, on])[:, None, None]
        E = moved_by(f, steps)
        turns = [stored(lambda a: sincos(a)[::-1], wave.rate * steps[:, 0]) for wave in f.waves]
        step, far = ([(c[i], s[i]) for c, s in (E, *turns)] for i in (0, 1))
        x = _samples(f, at, step[0], step[1:])
        return gather(totals, x, block), _onward(f, begins, at, time, far[0], far[1:])

    def forward(start):
        return jax.lax.while_loop(lambda c: jnp.any(c[1].time < f.cycle.period), body, start)[0]

    return one_kernel(forward, (totals, _start(f)))
