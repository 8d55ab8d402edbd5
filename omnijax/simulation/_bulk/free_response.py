"""How a block's free states move: x = A za + B zb, tables over its samples, its whole step.

A pair of poles that lies together is followed as one number; two real poles far apart are followed
one by one, and the faster of them is clipped where it dies within a block.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from .contact import Poles
from .design import CLIP, Layout
from .pole_pair import Pair, sincos, turning

SPLIT = 1.0  # D t^2 over a block from which two real poles are followed one by one


class Follow(NamedTuple):
    """How a free state moves: x = A za + B zb per sample, and the step over a whole block."""

    split: Array  # (2, a, c): two real poles followed one by one
    fast: Array  # (2, a, c): the second of them clipped
    root: Array  # (2, a, c): sqrt(D) where split
    table: tuple[Array, Array]  # (length, 2, a, c)
    block: tuple[Array, Array, Array, Array]  # (2, a, c): za' = 0 za + 1 zb, zb' = 2 za + 3 zb


def follow_poles(roots: Poles, layout: Layout) -> Follow:
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


def free_states(z: Pair, follow: Follow, layout: Layout) -> tuple[Array, Array]:
    """A free state in the form that the tables take."""
    row = np.array(layout.sets[: layout.directions])
    split, root = follow.split[:, row], follow.root[:, row]
    safe = jnp.where(split, 2 * root, 1.0)
    za = jnp.where(split, (z.u + z.v * root) / safe, z.u)
    zb = jnp.where(split, -(z.u - z.v * root) / safe, z.v)
    return za, jnp.where(follow.fast[:, row], 0.0, zb)


def waves_of(rate, layout: Layout):
    """cos and sin of nu k H for the samples of a block, (length, j, c), by turning."""
    s1, c1 = sincos(rate * layout.step)

    def on(row, _):
        c, s = row
        row = (c * c1 - s * s1, s * c1 + c * s1)
        return row, row

    start = (jnp.ones_like(rate), jnp.zeros_like(rate))
    return jax.lax.scan(on, start, None, length=layout.length)[1]
