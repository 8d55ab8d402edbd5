"""Where a periodic solution is extreme: places on every piece, then Newton's method from the best.

A mode answers an edge within its own time constant, which may be a millionth of the piece, and the
slow modes swing on to its end.  So the places are even over each piece and, beside that, eight an
octave from a fraction of the fastest time constant on.  Neither search nor refinement is
differentiated: by the envelope theorem the gradient is that of the formula at the place found.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from ..simulate.exact._ladder import Piece, advance, points
from ..simulate.exact._passage import Passages
from ..simulate.exact._peaks import Curves

BITS = 7  # 2^BITS even places a piece
FINE = 4  # 2^FINE places an octave
NEWTON = 3


class Places(NamedTuple):
    """Places on every piece of each signal, and z there."""

    seen: Bool[Array, "g k"]  # whether the piece has a width
    v: Float[Array, "g k p"]
    step: Float[Array, "g k p"]  # to the next place
    z: Float[Array, "g k p N"]

    def outputs(self, rows: Float[Array, "g k o N"]) -> Float[Array, "g kp o"]:
        """Outputs at all places of a signal; not differentiated."""
        values = jnp.einsum("gkoN,gkpN->gkpo", jax.lax.stop_gradient(rows), self.z)
        return values.reshape(len(values), -1, values.shape[-1])

    def along(self, values: Float[Array, "g kp o"], rows: Float[Array, "r o"]):
        """Combinations of outputs, (g, kp, r); -inf on pieces without width."""
        seen = jnp.repeat(self.seen, self.v.shape[-1], axis=1)[..., None]
        return jnp.where(seen, values @ jax.lax.stop_gradient(rows).T, -jnp.inf)


def places(cycles: Passages, starts: Float[Array, "g k N"]) -> Places:
    """Every place where an extreme may be near."""
    cycles, starts = jax.lax.stop_gradient((cycles, starts))
    return Places(cycles.width > 0, *jax.vmap(jax.vmap(_on_piece))(cycles.pieces, starts))


def _on_piece(piece: Piece, z: Float[Array, " N"]):
    """(v, step, z) of the even places, of eight first steps, and of eight an octave from there.

    The octave that begins at 2^(j - scale) is passed through in steps of 2^(j - FINE - scale);
    what would be beyond the end is at the end.
    """
    count, unit = 2**FINE, 2.0 ** (-piece.scale.astype(float))
    even = jnp.arange(2**BITS) * 2.0**-BITS
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
    step = [jnp.full(2**BITS, 2.0**-BITS), jnp.full(count, unit), jnp.tile(size, count)]
    values = [points(piece, z, BITS).T, jnp.where(inside[:, None], first, z)]
    values.append(graded.reshape(-1, len(z)))
    return jnp.concatenate(v), jnp.concatenate(step), jnp.concatenate(values)


def refined(curves: Curves, found: Places, index: Int[Array, " g"], row) -> Float[Array, "g o"]:
    """Outputs of each signal near places `index`, where row . output is largest."""

    def one(pieces, starts, rows, at: Places, i):
        k, p = i // at.v.shape[1], i % at.v.shape[1]
        step = jnp.where(at.step[k, p] > 0, at.step[k, p], 2.0**-BITS)
        piece, start, C = jax.tree.map(lambda x: x[k], (pieces, starts, rows))
        v = _climbed(*jax.lax.stop_gradient((piece, start, row @ C, at.v[k, p], at.z[k, p])), step)
        return C @ advance(piece, start, v)

    return jax.vmap(one)(curves.cycles.pieces, curves.starts, curves.rows, found, index)


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
    return jax.lax.stop_gradient(jax.lax.scan(newton, first, None, length=NEWTON)[0][2])
