"""Outputs of the long run along each phase: closed forms at any time, and samples block by block.

A block is `LENGTH` even samples of a phase up to the next edge of any of its signals at most.  Its
step follows the fastest pole that still counts there: fine after an edge, coarse where only slow
parts are left.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .arithmetic import flushed, materialised, product, sincos
from .moment import Pair, pair_exp
from .phases import Cycle, Wave, forced_parts, free_starts, given, wide
from .poles import Modes

LENGTH = 32  # samples a block
FEW = 4  # of them after each long step
STEP = 0.4  # of a pole's 1/|lambda|: a sixteenth of an oscillation
LOOSE = 6.0  # the same for a pole of which little is left
COUNTS, NOTHING = 1e-6, 1e-7  # of the largest value: above, a pole is followed; below, forgotten
FEWEST, MOST = 62, 65536  # samples a piece


class Rows(NamedTuple):
    """What some outputs show: of pairs, of each phase's rho and of its rate."""

    c0: Float[Array, "r p c"]
    c1: Float[Array, "r p c"]
    direct: Float[Array, "r s c"]
    slope: Float[Array, "r s c"]


class Curves(NamedTuple):
    """Some outputs of phases of like kinds."""

    kind: Float[Array, "p 1 c"]
    pole: Pair  # (p, 1, c)
    rows: Rows
    cycle: Cycle
    free: tuple[Pair, ...]  # of each signal with edges: (k, p, s, c) at the begin of its pieces
    cosine: tuple[Array, ...]  # of each signal: (r, w, k, s, c)
    sine: tuple[Array, ...]

    @property
    def waves(self) -> tuple[Wave, ...]:
        """All signals, those with edges first."""
        return *self.cycle.edged, *self.cycle.endless


def curves_of(m: Modes, cycle: Cycle, columns: np.ndarray, rows: Rows) -> Curves:
    """The outputs `rows` of the phases of a cycle."""
    b, m = given(m, columns), wide(m)
    c = rows.c0[:, None, None, :, None], rows.c1[:, None, None, :, None]
    free, cosines, sines = [], [], []
    for wave in (*cycle.edged, *cycle.endless):
        parts = forced_parts(m, wave)
        if len(wave.duration) > 1:
            y = product(m.kind, free_starts(m, wave, parts), b)
            free.append((flushed(y[0]), flushed(y[1])))
        across, along = (product(m.kind, x, b) for x in parts)
        D, R = rows.direct[:, None, None], rows.slope[:, None, None]
        nu = wave.rate[:, None]
        cosines.append(
            jnp.sum(c[0] * across[0] + c[1] * across[1], axis=3)
            + D * wave.cosine
            + R * nu * wave.sine
        )
        sines.append(
            jnp.sum(c[0] * along[0] + c[1] * along[1], axis=3)
            + D * wave.sine
            - R * nu * wave.cosine
        )
    return Curves(m.kind, (m.l0, m.l1), rows, cycle, tuple(free), tuple(cosines), tuple(sines))


def weights(f: Curves, z: Pair) -> Pair:
    """What the outputs show of states that move on from z (p, s, c): (r, p, s, c) each."""
    k, c0, c1 = f.kind > 0, f.rows.c0[:, :, None], f.rows.c1[:, :, None]
    return (
        c0 * z[0] + jnp.where(k, c1 * z[1], 0.0),
        c1 * jnp.where(k, z[0], z[1]) - jnp.where(k, c0 * z[1], 0.0),
    )


def values_at(f: Curves, time: Float[Array, "s c"], orders: int = 1) -> list[Array]:
    """The outputs (r, s, c) at a time and their first `orders - 1` derivatives."""
    found = [jnp.zeros((len(f.rows.c0), *time.shape)) for _ in range(orders)]
    for i, wave in enumerate(f.waves):
        local = jnp.mod(time + wave.place, wave.period)
        begin = wave.begin
        piece = jnp.sum(local >= begin[1:], axis=0)
        here = jnp.where(jnp.arange(len(begin))[:, None, None] == piece, 1.0, 0.0)
        into = local - jnp.sum(here * begin, axis=0)
        if len(begin) == 1:
            into = time
        s, c = sincos(wave.rate * into)
        a, b = (jnp.sum(here * x[i], axis=2) for x in (f.cosine, f.sine))
        swing = [a * c + b * s, (b * c - a * s) * wave.rate]
        swing.append(-swing[0] * wave.rate**2)
        for n in range(orders):
            found[n] = found[n] + jnp.sum(swing[n], axis=1)
        if i < len(f.free):
            start = [jnp.sum(here[:, None] * y, axis=0) for y in f.free[i]]
            z = product(f.kind, start, pair_exp(f.kind, (f.pole[0] * into, f.pole[1] * into)))
            for n in range(orders):
                seen = f.rows.c0[:, :, None] * z[0] + f.rows.c1[:, :, None] * z[1]
                found[n] = found[n] + jnp.sum(seen, axis=1)
                z = product(f.kind, z, f.pole)
    return found


class Place(NamedTuple):
    """Where the phases of a cycle are between two edges."""

    time: Float[Array, "s c"]
    piece: tuple[Array, ...]  # of each signal with edges
    begun: tuple[Array, ...]  # s, when its piece began


def _start(f: Curves) -> Place:
    """t = 0."""
    pieces, begun = [], []
    for wave in f.cycle.edged:
        piece = jnp.sum(wave.place >= wave.begin[1:], axis=0)
        here = jnp.arange(len(wave.begin))[:, None, None] == piece
        pieces.append(piece.astype(float))
        begun.append(jnp.sum(jnp.where(here, wave.begin, 0.0), axis=0) - wave.place)
    return Place(0.0 * f.cycle.period, tuple(pieces), tuple(begun))


class Block(NamedTuple):
    """Where a block begins, and what its samples are made of."""

    step: Float[Array, "s c"]
    w0: Float[Array, "r p s c"]
    w1: Float[Array, "r p s c"]
    f0: tuple[Array, ...]  # (r, w, s, c), of each signal
    f1: tuple[Array, ...]


def _block(f: Curves, at: Place, largest) -> tuple[Block, Place]:
    """The block that begins at a place, and where it ends; `largest` (s, c): value so far."""
    zero = 0.0 * f.pole[0] + 0.0 * at.time
    z, end, f0, f1 = (zero, zero), f.cycle.period, [], []
    ends, length = [], jnp.full_like(at.time, jnp.inf)
    for i, wave in enumerate(f.waves):
        if i < len(f.free):
            here = jnp.arange(len(wave.duration))[:, None, None] == at.piece[i]
            here = jnp.where(here, 1.0, 0.0)
            into = at.time - at.begun[i]
            start = [jnp.sum(here[:, None] * y, axis=0) for y in f.free[i]]
            E = materialised(
                lambda a, b, kind=f.kind: jax.lax.complex(*pair_exp(kind + 0 * a, (a, b))),
                f.pole[0] * into, f.pole[1] * into,
            )  # fmt: skip
            now = product(f.kind, start, (E.real, E.imag))
            z = z[0] + now[0], z[1] + now[1]
            own = jnp.sum(here * wave.duration, axis=0)
            length = jnp.minimum(length, jnp.where(own > 0, own, jnp.inf))
            ends.append(at.begun[i] + own)
            end = jnp.minimum(end, ends[-1])
        else:
            here, into = jnp.ones((1, *at.time.shape)), at.time
        s, c = sincos(wave.rate * into)
        a, b = (jnp.sum(here * x[i], axis=2) for x in (f.cosine, f.sine))
        f0.append(a * c + b * s)
        f1.append(b * c - a * s)
    left = jnp.maximum(end - at.time, 0.0)
    length = jnp.where(jnp.isfinite(length), length, f.cycle.period)
    w0, w1 = weights(f, z)
    step = jnp.maximum(_fine(f, w0, w1, largest), length / MOST)
    step = jnp.minimum(jnp.minimum(step, length / FEWEST), left / (LENGTH - 1))
    done = step * (LENGTH - 1) >= left * (1 - 1e-12)
    time = jnp.where(done, end, at.time + step * (LENGTH - 1))
    close = end + 1e-12 * f.cycle.period
    pieces, begun = [], []
    for i, wave in enumerate(f.cycle.edged):
        past = done & (ends[i] <= close) & (end < f.cycle.period)
        later = jnp.where(at.piece[i] + 1 >= len(wave.duration), 0.0, at.piece[i] + 1)
        pieces.append(jnp.where(past, later, at.piece[i]))
        begun.append(jnp.where(past, ends[i], at.begun[i]))
    return Block(step, w0, w1, tuple(f0), tuple(f1)), Place(time, tuple(pieces), tuple(begun))


def _fine(f: Curves, w0, w1, largest):
    """The step that follows every pole that counts."""
    first, second = jnp.max(jnp.abs(w0), axis=0), jnp.max(jnp.abs(w1), axis=0)  # (p, s, c)
    k = f.kind > 0
    size = jnp.where(k, jnp.sqrt(f.pole[0] ** 2 + f.pole[1] ** 2), jnp.abs(f.pole[0]))
    both = [(jnp.where(k, first + second, first), size)]
    both.append((jnp.where(k, 0.0, second), jnp.where(k, 0.0, jnp.abs(f.pole[1]))))
    rate = 0.0
    for shown, own in both:
        much, some = shown > COUNTS * largest, shown > NOTHING * largest
        rate = jnp.maximum(rate, jnp.where(much, own / STEP, jnp.where(some, own / LOOSE, 0.0)))
    return 1 / jnp.maximum(jnp.max(rate, axis=0), 1e-30)


def _powers(kind, E: Pair, count: int) -> Pair:
    """1, E, ..., E^(count - 1)."""
    found = [(jnp.ones_like(E[0]), jnp.where(kind > 0, 0.0, jnp.ones_like(E[0])))]
    for _ in range(count - 1):
        found.append(product(kind, found[-1], E))
    first, second = (jnp.stack([x[i] for x in found]) for i in (0, 1))
    return flushed(first), flushed(second)


def _samples(f: Curves, block: Block) -> Float[Array, "k r s c"]:
    """The outputs at all samples of a block.

    Sample `FEW` i + j is i long steps after the block's begin moved on by j short ones.
    """

    def exponentials(a, b, kind):
        return jax.lax.complex(*pair_exp(kind, (a, b)))

    def turned(angle):
        return jax.lax.complex(*sincos(angle)[::-1])

    def swings(E, count: int) -> Pair:
        """Cosines and sines of 0, 1, ... angles."""
        return _powers(jnp.ones_like(E.real), (E.real, E.imag), count)

    h, k, long = block.step, f.kind + 0 * block.step, LENGTH // FEW
    parts = []
    for i, step in enumerate((h, FEW * h)):
        E = materialised(exponentials, f.pole[0] * step, f.pole[1] * step, k)
        turns = [materialised(turned, wave.rate * step) for wave in f.waves]
        count = (FEW, long)[i]
        parts.append((_powers(k, (E.real, E.imag), count), [swings(x, count) for x in turns]))
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


def along(f: Curves, gather, totals, largest):
    """totals = gather(totals, samples (k, r, s, c), begin, step) over one period of every phase.

    `largest(totals)` (s, c): the largest value so far, which says what counts.
    """

    def body(carry):
        totals, place = carry
        block, after = _block(f, place, largest(totals))
        return gather(totals, _samples(f, block), place.time, block.step), after

    start = totals, _start(f)
    return jax.lax.while_loop(lambda c: jnp.any(c[1].time < f.cycle.period), body, start)[0]
