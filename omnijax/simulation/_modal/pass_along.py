"""Samples of the long run's outputs along each phase, block by block.

A block is `LENGTH` even samples of a phase up to the next edge of any of its signals at most.  Its
step follows the fastest pole that still bends an output there: fine after an edge, coarse where
only slow parts are left.  Where nothing up to the next edge can exceed what is known already, one
block goes there.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .arithmetic import Pair, materialised, pair_exp, powers, product, sincos, summed, turned
from .curves import ModalCurves, free_size, size_of, weights

LENGTH = 32  # samples a block
FEW = 4  # of them after each long step
STEP = 0.4  # of a pole's 1/|lambda|: a sixteenth of an oscillation
COARSE = 0.8  # where directions are looked for, not times
BENDS = 0.1  # of the largest bend: what bends less makes no maximum of its own beside that one's
NOTHING = 1e-7  # of an output's size: not asked for
FEWEST, MOST = 62, 65536  # samples a piece


class GapPlace(NamedTuple):
    """Where the phases of a cycle are between two edges."""

    time: Float[Array, "s c"]
    piece: tuple[Array, ...]  # of each signal with edges
    begun: tuple[Array, ...]  # s, when its piece began


def _start(f: ModalCurves) -> GapPlace:
    """t = 0."""
    pieces, begun = [], []
    for wave in f.cycle.edged:
        piece = jnp.sum(wave.place >= wave.begin[1:], axis=0)
        here = jnp.arange(len(wave.begin))[:, None, None] == piece
        pieces.append(piece.astype(float))
        begun.append(jnp.sum(jnp.where(here, wave.begin, 0.0), axis=0) - wave.place)
    return GapPlace(0.0 * f.cycle.period, tuple(pieces), tuple(begun))


class Block(NamedTuple):
    """Where a block begins, and what its samples are made of."""

    step: Float[Array, "s c"]
    w0: Float[Array, "r p s c"]
    w1: Float[Array, "r p s c"]
    f0: tuple[Array, ...]  # (r, w, s, c), of each signal
    f1: tuple[Array, ...]


def reach(f: ModalCurves, block: Block) -> Float[Array, "r s c"]:
    """What no output exceeds from a block's begin to the next edge."""
    total = summed(free_size(f, (block.w0, block.w1)), 1)
    for a, b in zip(block.f0, block.f1, strict=True):
        total = total + summed(jnp.sqrt(a * a + b * b), 1)
    return total


def _block(f: ModalCurves, at: GapPlace, size, idle, share) -> tuple[Block, GapPlace]:
    """The block that begins at a place, and where it ends; see `along`."""
    zero = 0.0 * f.pole[0] + 0.0 * at.time
    z, end, f0, f1 = (zero, zero), f.cycle.period, [], []
    ends, length = [], jnp.full_like(at.time, jnp.inf)
    for i, wave in enumerate(f.waves):
        if i < len(f.free):
            here = jnp.arange(len(wave.duration))[:, None, None] == at.piece[i]
            here = jnp.where(here, 1.0, 0.0)
            into = at.time - at.begun[i]
            start = [summed(here[:, None] * y) for y in f.free[i]]
            E = materialised(
                lambda a, b, kind=f.kind: jax.lax.complex(*pair_exp(kind + 0 * a, (a, b))),
                f.pole[0] * into, f.pole[1] * into,
            )  # fmt: skip
            now = product(f.kind, start, (E.real, E.imag))
            z = z[0] + now[0], z[1] + now[1]
            own = summed(here * wave.duration)
            length = jnp.minimum(length, jnp.where(own > 0, own, jnp.inf))
            ends.append(at.begun[i] + own)
            end = jnp.minimum(end, ends[-1])
        else:
            here, into = jnp.ones((1, *at.time.shape)), at.time
        s, c = sincos(wave.rate * into)
        a, b = (summed(here * x[i], 2) for x in (f.cosine, f.sine))
        first, second = turned(a, b, c, s)
        f0.append(first)
        f1.append(second)
    left = jnp.maximum(end - at.time, 0.0)
    length = jnp.where(jnp.isfinite(length), length, f.cycle.period)
    block = Block(left / (LENGTH - 1), *weights(f, z), tuple(f0), tuple(f1))
    step = jnp.maximum(share * _fine(f, block, size), length / MOST)
    step = jnp.minimum(jnp.minimum(step, length / FEWEST), block.step)
    none = idle(block)
    step = jnp.where(none, block.step, step)
    block = jax.tree.map(lambda x: jnp.where(none, 0.0, x), block)
    done = step * (LENGTH - 1) >= left * (1 - 1e-12)
    time = jnp.where(done, end, at.time + step * (LENGTH - 1))
    close = end + 1e-12 * f.cycle.period
    pieces, begun = [], []
    for i, wave in enumerate(f.cycle.edged):
        past = done & (ends[i] <= close) & (end < f.cycle.period)
        later = jnp.where(at.piece[i] + 1 >= len(wave.duration), 0.0, at.piece[i] + 1)
        pieces.append(jnp.where(past, later, at.piece[i]))
        begun.append(jnp.where(past, ends[i], at.begun[i]))
    return block._replace(step=step), GapPlace(time, tuple(pieces), tuple(begun))


def _fine(f: ModalCurves, block: Block, size):
    """1/|lambda| of the fastest pole that bends an output of that size."""
    k, bend, parts = f.kind > 0, jnp.zeros((1, 1, 1)), []
    for wave, a, b in zip(f.waves, block.f0, block.f1, strict=True):
        bend = bend + summed((jnp.abs(a) + jnp.abs(b)) * wave.rate**2, 1)
    first, second = jnp.abs(block.w0), jnp.abs(block.w1)  # (r, p, s, c)
    square = jnp.where(k, f.pole[0] ** 2 + f.pole[1] ** 2, f.pole[0] ** 2)
    parts.append((jnp.where(k, first + second, first), square))
    parts.append((jnp.where(k, 0.0, second), jnp.where(k, 0.0, f.pole[1] ** 2)))
    for shown, own in parts:
        bend = jnp.maximum(bend, jnp.max(shown * own, axis=1))
    fastest = 0.0
    for shown, own in parts:
        much = (shown * own > BENDS * bend[:, None]) & (shown > NOTHING * size[:, None])
        fastest = jnp.maximum(fastest, jnp.max(jnp.where(much, own, 0.0), axis=(0, 1)))
    return 1 / jnp.maximum(jnp.sqrt(fastest), 1e-30)


def _samples(f: ModalCurves, block: Block) -> Float[Array, "k r s c"]:
    """The outputs at all samples of a block.

    Sample `FEW` i + j is i long steps after the block's begin moved on by j short ones.
    """

    def exponentials(a, b, kind):
        return jax.lax.complex(*pair_exp(kind, (a, b)))

    def turned(angle):
        return jax.lax.complex(*sincos(angle)[::-1])

    def swings(E, count: int) -> Pair:
        """Cosines and sines of 0, 1, ... angles."""
        return powers(jnp.ones_like(E.real), (E.real, E.imag), count)

    h, k, long = block.step, f.kind + 0 * block.step, LENGTH // FEW
    parts = []
    for i, step in enumerate((h, FEW * h)):
        E = materialised(exponentials, f.pole[0] * step, f.pole[1] * step, k)
        turns = [materialised(turned, wave.rate * step) for wave in f.waves]
        count = (FEW, long)[i]
        parts.append((powers(k, (E.real, E.imag), count), [swings(x, count) for x in turns]))
    (short, early), (far, late) = parts

    def begins(w0, w1, f0, f1):
        """Weights after j short steps, (j, r, ...)."""
        z, paired = short, k > 0
        moved = (
            w0 * z[0][:, None] + jnp.where(paired, w1 * z[1][:, None], 0.0),
            jnp.where(paired, w1 * z[0][:, None] - w0 * z[1][:, None], w1 * z[1][:, None]),
        )
        waves = [
            (a * c[:, None] + b * s[:, None], b * c[:, None] - a * s[:, None])
            for a, b, (c, s) in zip(f0, f1, early, strict=True)
        ]
        return moved, waves

    def values(moved, waves, far, late):
        w0, w1 = (x[:, :, None] for x in moved)  # (j, r, 1, p, s, c)
        x = 0.0
        for p in range(w0.shape[3]):
            x = x + w0[:, :, :, p] * far[0][:, p] + w1[:, :, :, p] * far[1][:, p]
        for (a, b), (c, s) in zip(waves, late, strict=True):
            for v in range(c.shape[1]):
                x = x + a[:, :, None, v] * c[:, v] + b[:, :, None, v] * s[:, v]
        return x

    moved, waves = materialised(begins, block.w0, block.w1, block.f0, block.f1)
    x = materialised(values, moved, waves, far, late)  # (j, r, i, ...)
    return jnp.moveaxis(x, (2, 0), (0, 1)).reshape(LENGTH, x.shape[1], *x.shape[3:])


def along(f: ModalCurves, gather, totals, idle, share: float = STEP):
    """totals = gather(totals, samples (k, r, s, c), begin, step) over one period of every phase.

    `idle(totals, block)` (s, c): whether nothing counts from a block's begin to the next edge;
    all samples are zero there.
    """
    size = size_of(f)
    size = jnp.maximum(size, NOTHING * jnp.max(size, axis=0))

    def body(carry):
        totals, place = carry
        block, after = _block(f, place, size, lambda block: idle(totals, block), share)
        return gather(totals, _samples(f, block), place.time, block.step), after

    start = totals, _start(f)
    return jax.lax.while_loop(lambda c: jnp.any(c[1].time < f.cycle.period), body, start)[0]
