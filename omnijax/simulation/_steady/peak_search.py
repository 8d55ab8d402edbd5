"""Where periodic signals whose phases run independently are extreme, alone and together.

A mode answers an edge within its own time constant, which may be a millionth of the piece, and the
slow modes swing on to its end.  So the places looked at are even over each piece and, beside that,
sixteen an octave from a fraction of the fastest time constant on; Newton's method goes on from the
best.  For vectors, sup |sum_g x_g(phi_g)| = max over unit d of sum_g max_phi d . x_g(phi): the
search runs over directions and places.  Neither search nor refinement is differentiated: by the
envelope theorem the gradient is that of the formula at the places found.
"""

import functools
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from .._exact import Passages, Piece, advance, points
from .._signals import is_traced

FEWEST, MOST = 9, 13  # bits of the even places a piece
PER_OSCILLATION = 4
FINE = 4  # 2^FINE places an octave
NEWTON = 6
DIRECTIONS = 400  # to begin with
TOGETHER = 20  # directions looked at together: bounds the memory
CANDIDATES = 4  # directions gone on from
ASCENTS = 6  # from the sum found in a direction to the next direction, on the places
ROUNDS = 5  # and between the places


class Curves(NamedTuple):
    """Periodic solutions and the rows of one output over z (leading axes g, k)."""

    cycles: Passages
    starts: Float[Array, "g k N"]
    rows: Float[Array, "g k o N"]


class Extrema(NamedTuple):
    """One place per signal: the piece and v in it."""

    piece: Int[Array, " g"]
    v: Float[Array, " g"]


class PeakPlaces(NamedTuple):
    """Places on every piece of each signal, and z there."""

    seen: Bool[Array, "g k"]  # whether the piece has a width
    v: Float[Array, "g k p"]
    step: Float[Array, "g k p"]  # to the next place
    z: Float[Array, "g k p N"]

    def outputs(self, rows: Float[Array, "g k o N"]) -> Float[Array, "g kp o"]:
        """Outputs at all places of a signal; not differentiated."""
        values = jnp.einsum("gkoN,gkpN->gkpo", jax.lax.stop_gradient(rows), self.z)
        return values.reshape(len(values), -1, values.shape[-1])

    def rivals(self, along: Float[Array, "g kp"], index: Int[Array, " g"], bits: int):
        """The highest maxima (g,) on the even places but for those at `index`."""
        count = self.v.shape[-1]
        even = along.reshape(*self.v.shape)[..., : 2**bits]
        beside = jnp.pad(even, ((0, 0), (0, 0), (1, 1)), constant_values=-jnp.inf)
        top = (even >= beside[..., :-2]) & (even >= beside[..., 2:])

        def one(even, top, v, i):
            own = (jnp.arange(len(v)) == i // count)[:, None]
            near = own & (jnp.abs(v[:, : 2**bits] - v.ravel()[i]) < 2 * 2.0**-bits)
            highest = jnp.argmax(jnp.where(top & ~near, even, -jnp.inf))
            return highest // 2**bits * count + highest % 2**bits

        return jax.vmap(one)(even, top, self.v, index)

    def along(self, values: Float[Array, "g kp o"], rows: Float[Array, "r o"]):
        """Combinations of outputs, (g, kp, r); -inf on pieces without width."""
        seen = jnp.repeat(self.seen, self.v.shape[-1], axis=1)[..., None]
        return jnp.where(seen, values @ jax.lax.stop_gradient(rows).T, -jnp.inf)


def bits_needed(passage) -> int:
    """Bits of the even places a piece whose A duration is up to `passage`; `FEWEST` while tracing.

    A piece may hold thousands of oscillations of a lightly damped mode, of nearly equal height.
    """
    if is_traced(passage):
        return FEWEST
    modes = np.linalg.eigvals(np.asarray(passage))
    swinging = np.abs(modes.imag[np.abs(modes.imag) > np.abs(modes.real)])
    count = PER_OSCILLATION * np.max(swinging, initial=0.0) / (2 * np.pi)
    return int(np.clip(np.ceil(np.log2(max(count, 1.0))), FEWEST, MOST))


def places(cycles: Passages, starts: Float[Array, "g k N"], bits: int) -> PeakPlaces:
    """Every place where an extreme may be near, 2^bits of them even over each piece."""
    cycles, starts = jax.lax.stop_gradient((cycles, starts))

    def one(piece, z):
        return _on_piece(piece, z, bits)

    return PeakPlaces(cycles.width > 0, *jax.vmap(jax.vmap(one))(cycles.pieces, starts))


def _on_piece(piece: Piece, z: Float[Array, " N"], bits: int):
    """(v, step, z) of the even places, of first steps, and of sixteen an octave from there.

    The octave that begins at 2^(j - scale) is passed through in steps of 2^(j - FINE - scale);
    what would be beyond the end is at the end.
    """
    count, unit = 2**FINE, 2.0 ** (-piece.scale.astype(float))
    even = jnp.arange(2**bits) * 2.0**-bits
    octave = jnp.arange(FINE, len(piece.levels))
    begin = jnp.where(octave < piece.scale, 2.0**octave * unit, 1.0)
    size = jnp.where(octave < piece.scale, 2.0 ** (octave - FINE) * unit, 0.0)
    steps = jnp.where((octave < piece.scale)[:, None, None], piece.levels[:-FINE], jnp.eye(len(z)))

    def on(now, _):
        return jnp.einsum("jab,jb->ja", steps, now), now

    graded = jax.lax.scan(on, piece.levels[FINE:] @ z, None, length=count)[1]
    first = jax.lax.scan(lambda now, _: (piece.levels[0] @ now, now), z, None, length=count)[1]
    early = jnp.arange(count) * unit
    inside = early <= 1.0
    v = [even, jnp.where(inside, early, 0.0), (begin + jnp.arange(count)[:, None] * size).ravel()]
    longest = jnp.where(size > 0, size, 2.0**-bits)
    step = [jnp.full(2**bits, 2.0**-bits), jnp.full(count, unit), jnp.tile(longest, count)]
    values = [points(piece, z, bits).T, jnp.where(inside[:, None], first, z)]
    values.append(graded.reshape(-1, len(z)))
    return jnp.concatenate(v), jnp.concatenate(step), jnp.concatenate(values)


def values_at(curves: Curves, spots: Extrema) -> Float[Array, "g o"]:
    """The output of each signal at its spot."""

    def one(pieces, starts, rows, k, v):
        piece, start, C = jax.tree.map(lambda x: x[k], (pieces, starts, rows))
        return C @ advance(piece, start, v)

    return jax.vmap(one)(curves.cycles.pieces, curves.starts, curves.rows, spots.piece, spots.v)


def climbed(curves: Curves, places: PeakPlaces, index: Int[Array, " g"], row) -> Extrema:
    """Spots near places `index` at which row . output of each signal is largest."""

    def one(pieces, starts, rows, at: PeakPlaces, i):
        k, p = i // at.v.shape[1], i % at.v.shape[1]
        piece, start, C = jax.tree.map(lambda x: x[k], (pieces, starts, rows))
        return Extrema(k, _climbed(piece, start, row @ C, at.v[k, p], at.z[k, p], at.step[k, p]))

    return jax.vmap(one)(curves.cycles.pieces, curves.starts, curves.rows, places, index)


def _climbed(piece: Piece, start, along, begin, z, step):
    """The place of the largest value that Newton's method meets within a step of `begin`."""
    F = piece.generator

    def newton(carry, _):
        v, z, best, height = carry
        slope, bend = along @ (F @ z), along @ (F @ (F @ z))
        move = jnp.where(bend < 0, -slope / jnp.where(bend < 0, bend, -1.0), step * jnp.sign(slope))
        move = jnp.clip(jnp.where(jnp.isfinite(move), move, 0.0), -step, step)
        v = jnp.clip(v + move, jnp.maximum(begin - step, 0.0), jnp.minimum(begin + step, 1.0))
        z = advance(piece, start, v)
        better = along @ z > height
        return (v, z, jnp.where(better, v, best), jnp.maximum(along @ z, height)), None

    first = (begin, z, begin, along @ z)
    return jax.lax.scan(newton, first, None, length=NEWTON)[0][2]


def highest(curves: Curves, places: PeakPlaces, values, row, bits: int):
    """Where row . output of each signal is largest, and the outputs there, (g, o).

    Two maxima that differ by less than their places' spacing change their order between them: the
    second one is looked at as well.  `values` are the outputs at all places, 2^bits of them even.
    """
    curves, row = jax.lax.stop_gradient((curves, row))
    along = places.along(values, row[None])[..., 0]
    index = jnp.argmax(along, axis=1)
    both = jnp.stack([index, places.rivals(along, index, bits)])
    spots = jax.vmap(lambda i: climbed(curves, places, i, row))(both)
    first, second = jax.vmap(lambda s: values_at(curves, s))(spots)
    better = first @ row >= second @ row
    spots = jax.tree.map(lambda x: jnp.where(better, x[0], x[1]), spots)
    return spots, jnp.where(better[:, None], first, second)


def largest(
    parts: tuple[Curves, ...], places: tuple[PeakPlaces, ...], rows: Float[Array, "r o"], bits: int
) -> Float[Array, " r"]:
    """The largest value of each combination `rows` of the outputs, the signals summed."""
    total = jnp.zeros(len(rows))
    for curves, at in zip(parts, places, strict=True):
        values = at.outputs(curves.rows)

        def one(row, curves=curves, at=at, values=values):
            spots, _ = highest(curves, at, values, row, bits)
            return jnp.sum(values_at(curves, spots) @ row)

        total = total + jax.vmap(one)(rows)
    return total


def supremum(
    parts: tuple[Curves, ...], places: tuple[PeakPlaces, ...], bits: int
) -> Float[Array, " o"]:
    """The longest sum of the signals' outputs, as a vector; 2^bits places a piece are even."""
    values = [at.outputs(curves.rows) for curves, at in zip(parts, places, strict=True)]

    def support(d):
        """Places (g, d) of each part, and what all signals reach together (d,)."""
        along = [at.along(x, d) for at, x in zip(places, values, strict=True)]
        reached = [jnp.sum(jnp.max(x, axis=1), axis=0) for x in along]
        return [jnp.argmax(x, axis=1) for x in along], functools.reduce(jnp.add, reached)

    directions = jnp.asarray(sphere(DIRECTIONS, values[0].shape[-1]))
    reach: Any = jax.lax.map(lambda d: support(d[None])[1][0], directions, batch_size=TOGETHER)
    best = directions[jnp.argsort(-reach)[:CANDIDATES]]

    def ascend(best, _):
        index = support(best)[0]
        each = zip(values, index, strict=True)
        chosen = [jnp.sum(jax.vmap(lambda v, i: v[i])(*part), axis=0) for part in each]
        return _unit(functools.reduce(jnp.add, chosen), best), None

    best = jax.lax.scan(ascend, best, None, length=ASCENTS)[0]

    def all_highest(row):
        each = zip(parts, places, values, strict=True)
        spots, outputs = zip(*(highest(*part, row, bits) for part in each), strict=True)
        return spots, functools.reduce(jnp.add, [jnp.sum(x, axis=0) for x in outputs])

    def turn(carry, _):
        rows = carry[0]
        spots, totals = jax.vmap(all_highest)(rows)
        return (_unit(totals, rows), spots, jnp.sum(totals**2, axis=1)), None

    none = [jnp.zeros((CANDIDATES, len(x))) for x in values]
    start = best, tuple(Extrema(x.astype(int), x) for x in none), jnp.zeros(CANDIDATES)
    _, spots, squares = jax.lax.scan(turn, start, None, length=ROUNDS)[0]
    top = jax.tree.map(lambda x: x[jnp.argmax(squares)], spots)
    each = zip(parts, top, strict=True)
    return functools.reduce(jnp.add, [jnp.sum(values_at(*part), axis=0) for part in each])


def _unit(vectors: Float[Array, "d o"], otherwise):
    """Directions of vectors; `otherwise` of those without length."""
    size = jnp.linalg.norm(vectors, axis=-1, keepdims=True)
    return jnp.where(size > 0, vectors / jnp.where(size > 0, size, 1.0), otherwise)


def sphere(count: int, size: int) -> np.ndarray:
    """Directions spread evenly over the unit sphere (Fibonacci), rows."""
    if size == 1:
        return np.array([[1.0], [-1.0]])
    k = np.arange(count) + 0.5
    z, turn = 1 - 2 * k / count, np.pi * (1 + 5**0.5) * k
    flat = np.sqrt(1 - z * z)
    return np.stack([flat * np.cos(turn), flat * np.sin(turn), z], axis=-1)
