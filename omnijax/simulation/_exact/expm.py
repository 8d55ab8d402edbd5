"""Exponentials of one piece's generator, free of divisions by differences of eigenvalues.

On a piece that lasts `duration`, with v in [0, 1] along it, the state s and the terms w of the
forcing (powers of x = 2v - 1, cosines and sines) form one autonomous system

    dz/dv = F z,   z = (s, w),   F = [[duration A, duration column row], [0, G]]

so z(v) = exp(F v) z(0) holds the particular solution too: resonance, equal and defective
eigenvalues and pieces of no length need no special case.  exp is by scaling and squaring; the
ladder exp(F 2^(j - scale)) of the squarings reaches any v in a few products.  (`_solve/phi.py`
doubles phi functions of a step instead, at one fixed number of doublings and for no ladder.)
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from ...laws import Pieces
from .._signals import is_traced

LEVELS = 40  # of a ladder whose rates are not known ahead: up to 2^38 time constants
TERMS = 14  # of the exponential's series below norm 1/2
FEW = 8  # pieces


class Piece(NamedTuple):
    """One piece ready to be passed through."""

    generator: Float[Array, "N N"]  # F
    levels: Float[Array, "L N N"]  # exp(F 2^(j - scale)), j = 0, 1, ...; exp(F) from j = scale on
    scale: Int[Array, ""]
    row: Float[Array, " w"]  # rho = row w
    start: Float[Array, " w"]  # w at v = 0


def basis_row(pieces: Pieces) -> Float[Array, " w"]:
    """rho as a row over the terms (one piece)."""
    return jnp.concatenate([pieces.polynomial, pieces.cosine, pieces.sine])


def basis_start(pieces: Pieces) -> Float[Array, " w"]:
    """The terms at v = 0, x = -1 (one piece)."""
    powers = jnp.asarray((-1.0) ** np.arange(pieces.polynomial.shape[0]))
    waves = pieces.sine.shape[0]
    return jnp.concatenate([powers, jnp.ones(waves), jnp.zeros(waves)])


def basis_generator(pieces: Pieces) -> Float[Array, "w w"]:
    """G: d(x^k)/dv = 2k x^(k-1), d cos/dv = -f sin, d sin/dv = f cos (one piece)."""
    degree, waves = pieces.polynomial.shape[0] - 1, pieces.sine.shape[0]
    size = degree + 1 + 2 * waves
    powers = np.zeros((size, size))
    powers[np.arange(1, degree + 1), np.arange(degree)] = 2 * np.arange(1, degree + 1)
    G = jnp.asarray(powers)
    c = degree + 1 + np.arange(waves)
    return G.at[c, c + waves].add(-pieces.frequency).at[c + waves, c].add(pieces.frequency)


def generator(A, column, pieces: Pieces, duration) -> Float[Array, "N N"]:
    """F of one piece."""
    row, G = basis_row(pieces), basis_generator(pieces)
    top = jnp.concatenate([duration * A, duration * jnp.outer(column, row)], axis=1)
    zero = jnp.zeros((G.shape[0], A.shape[0]))
    return jnp.concatenate([top, jnp.concatenate([zero, G], axis=1)], axis=0)


def _norm(F, m: int):
    """A bound on the rates in F; its coupling block is linear and does not count."""
    first = jnp.max(jnp.sum(jnp.abs(F[:m, :m]), axis=0))
    return jnp.maximum(first, jnp.max(jnp.sum(jnp.abs(F[m:, m:]), axis=0), initial=0.0))


def series(X, z=None):
    """exp(X), or exp(X) z, by its series; for norms below 1/2."""
    if z is None:
        z = jnp.eye(X.shape[0])

    def horner(total, k):  # z + X/1 (z + X/2 (z + ...))
        return z + X @ total / k, None

    return jax.lax.scan(horner, z, jnp.arange(TERMS, 0.0, -1.0))[0]


def levels_needed(passage, least: int = 0) -> int:
    """Levels for pieces with A duration up to `passage`, a multiple of 8; `LEVELS` while tracing.

    They hold as many time constants as its largest column sum.
    """
    if is_traced(passage):
        return LEVELS
    passed = float(np.max(np.sum(np.abs(passage), axis=0), initial=0.0))
    need = max(np.ceil(np.log2(max(passed, 128.0))), least) + 4
    return int(min(-(-need // 8) * 8, LEVELS))  # few lengths: few programs to compile


def squarings(F, m: int, least: int, levels: int = LEVELS) -> tuple[Array, Array]:
    """Levels and scale; the scale is at least `least`, so that v = 2^-least is on the ladder."""
    norm = jax.lax.stop_gradient(_norm(F, m))
    safe = jnp.maximum(norm, 1e-300)
    scale = jnp.clip(jnp.ceil(jnp.log2(safe)) + 1, least, levels - 2).astype(int)
    first = series(F * 2.0 ** (-scale.astype(float)))

    def up(E, j):
        return jnp.where(j < scale, E @ E, E), E

    return jax.lax.scan(up, first, jnp.arange(levels))[1], scale


def make_piece(A, column, pieces: Pieces, duration, least: int, levels: int = LEVELS) -> Piece:
    """One piece of a signal that enters ds/dt = A s + column rho."""
    F = generator(A, column, pieces, duration)
    rungs, scale = squarings(F, A.shape[0], least, levels)
    return Piece(F, rungs, scale, basis_row(pieces), basis_start(pieces))


def whole(piece: Piece) -> Float[Array, "N N"]:
    """exp(F): through the whole piece."""
    return piece.levels[-1]


def advance(piece: Piece, z: Float[Array, " N"], v: Float[Array, ""]) -> Float[Array, " N"]:
    """z after the part v in [0, 1] of the piece; differentiable in v too."""
    unit = 2.0 ** piece.scale.astype(float)
    steps = _steps(v, unit)

    def climb(z, level):
        j, E = level
        return jnp.where((steps >> j) & 1, E @ z, z), None

    z = jax.lax.scan(climb, z, (jnp.arange(len(piece.levels)), piece.levels))[0]
    return series(piece.generator * (v - steps / unit), z)


def points(piece: Piece, z: Float[Array, " N"], bits: int) -> Float[Array, "N P"]:
    """z at v = 0, 2^-bits, ... (2^bits points); `bits` may be at most the ladder's `least`."""
    Z = z[:, None]
    for b in range(bits, 0, -1):
        E = piece.levels[piece.scale - b]
        Z = jnp.concatenate([Z, E @ Z], axis=1)
    return Z


def second_moments(piece: Piece, z: Float[Array, " N"]) -> Float[Array, "N N"]:
    """Integral of z z^T over v in [0, 1]: by its series on the first step, then by doubling."""
    h = 2.0 ** (-piece.scale.astype(float))

    def term(x, k):
        return piece.generator @ x * (h / k), x

    Z = jax.lax.scan(term, z, jnp.arange(1.0, TERMS + 2.0))[1].T
    k = np.arange(TERMS + 1)
    S = h * Z @ jnp.asarray(1.0 / (k[:, None] + k[None, :] + 1)) @ Z.T

    def double(S, level):
        j, E = level
        return jnp.where(j < piece.scale, S + E @ S @ E.T, S), None

    return jax.lax.scan(double, S, (jnp.arange(len(piece.levels)), piece.levels))[0]


def _steps(v, unit) -> Array:
    """Whole steps of 1/unit up to a place v, which rounding may put a hair outside of [0, 1]."""
    return jax.lax.stop_gradient(jnp.clip(jnp.floor(v * unit), 0.0, unit)).astype(int)


def advance_all(F, levels, scale, top, z: Float[Array, "t N"], v: Float[Array, " t"]):
    """exp(F v) z for many places v in [0, 1] with one generator; `top` as in `_climb`."""
    unit = 2.0 ** scale.astype(float)
    steps = _steps(v, unit)
    z = _climb(lambda E, z: z @ E.T, levels, top, steps, z)
    rest = (v - steps / unit)[:, None]

    def horner(total, k):
        return z + rest * (total @ F.T) / k, None

    return jax.lax.scan(horner, z, jnp.arange(TERMS, 0.0, -1.0))[0]


def advance_pieces(pieces: Piece, top, Z: Float[Array, "k N P"], index, v) -> Float[Array, "t N"]:
    """z at places v of pieces `index` from grids Z of 2^bits points a piece (see `points`).

    `top` is above the scale of every piece; unbatched, so that rungs beyond it cost nothing.
    """
    count = Z.shape[-1]
    bits = count.bit_length() - 1
    node = jnp.clip(jax.lax.stop_gradient(jnp.floor(v * count)), 0, count - 1).astype(int)
    z, rest = Z[index, :, node], v - node / count
    unit = 2.0 ** pieces.scale[index].astype(float)
    steps = _steps(rest, unit)
    levels = jnp.swapaxes(pieces.levels, 0, 1)[: pieces.levels.shape[1] - bits]
    z = _climb(lambda E, z: _each(E, index, z), levels, top - bits, steps, z)
    last = (rest - steps / unit)[:, None]

    def horner(total, k):
        return z + last * _each(pieces.generator, index, total) / k, None

    return jax.lax.scan(horner, z, jnp.arange(TERMS, 0.0, -1.0))[0]


def _climb(move, levels, top, steps: Int[Array, " t"], z: Float[Array, "t N"]):
    """z moved by the levels whose bits `steps` has; no step has a bit at `top` or beyond."""

    def climb(z, level):
        j, E = level

        def moved(z):
            return jnp.where(((steps >> j) & 1)[:, None] == 1, move(E, z), z)

        return jax.lax.cond(j < top, moved, lambda z: z, z), None

    return jax.lax.scan(climb, z, (jnp.arange(len(levels)), levels))[0]


def _each(E: Float[Array, "k N N"], index, z: Float[Array, "t N"]) -> Float[Array, "t N"]:
    """E[index] z row by row; a few products with all of z beat gathering a matrix for each row."""
    if len(E) > FEW:
        return jnp.einsum("tab,tb->ta", E[index], z)
    parts = [jnp.where((index == k)[:, None], z @ E[k].T, 0.0) for k in range(len(E))]
    return sum(parts[1:], parts[0])
