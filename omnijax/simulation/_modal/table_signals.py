"""A measured table as a wheel passes it: cubics in time, one period from the start on.

The period begins where the wheel is at the start, in the middle of a piece: what is left of that
piece comes first, and what has been passed of it last.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...laws import Pieces, TableShape, padded, piece_at, shape_pieces
from ...rig import Rig
from .._exact import directed
from .._padding import room

DEGREE = 3


class TableSignals(NamedTuple):
    """The tables (w) of a design, pieces (k) of no duration at their ends."""

    duration: Float[Array, "w k *c"]  # s, of each piece
    rho: Float[Array, "w 4 k *c"]  # m, m/s, ...: rho and its derivatives by time as they begin


def with_room(shape: TableShape) -> TableShape:
    """The shape with pieces of no width at its end: rigs whose tables are of like length share
    their programs.

    Arrays may have a leading axis.
    """
    pieces = shape.knots.shape[-1] - 1
    more = room(pieces, 4) - pieces
    edge = [(0, 0)] * (shape.knots.ndim - 1)
    return eqx.tree_at(
        lambda x: (x.knots, x.coefficients),
        shape,
        (
            jnp.pad(shape.knots, [*edge, (0, more)], mode="edge"),
            jnp.pad(shape.coefficients, [*edge, (0, more), (0, 0)]),
        ),
    )


def table_signals(rig: Rig, wheels: Sequence[int], speeds, angles) -> TableSignals:
    """The profiles of some wheels at constant `speeds` (rad/s) from `angles` (rad)."""
    own = [_pieces(rig, i) for i in wheels]
    count = max(len(pieces.width) for pieces in own)
    each = [
        _passed(padded(pieces, count, DEGREE, 0), speeds[i], angles[i])
        for i, pieces in zip(wheels, own, strict=True)
    ]
    return TableSignals(*(jnp.stack(x) for x in zip(*each, strict=True)))


def _pieces(rig: Rig, i: int) -> Pieces:
    pieces = shape_pieces(rig.profiles[i], jax.tree.map(lambda x: x[i], rig.gaps))
    assert pieces is not None
    return pieces


def _passed(pieces: Pieces, speed, angle) -> tuple[Float[Array, " k"], Float[Array, "4 k"]]:
    """Durations of the pieces, and rho with its derivatives by time as they begin."""
    cycle = directed(pieces, speed, angle)
    duration = cycle.duration
    begin = _derivatives(cycle.pieces.polynomial) / _powers(jnp.where(duration > 0, duration, 1.0))
    number, v = piece_at(cycle.pieces, cycle.start)
    since = v * duration[number]
    order = jnp.mod(number + jnp.arange(len(duration) + 1), len(duration))
    duration, begin = duration[order], begin[:, order]
    begin = begin.at[:, 0].set(moved_on(begin[:, 0], since))
    return duration.at[0].add(-since).at[-1].set(since), begin


def _derivatives(polynomial: Float[Array, "k 4"]) -> Float[Array, "4 k"]:
    """Derivatives by v at v = 0 of polynomials in x = 2 v - 1."""
    at = np.array([
        [2.0**j * math.perm(p, j) * (-1.0) ** (p - j) if p >= j else 0.0 for p in range(DEGREE + 1)]
        for j in range(DEGREE + 1)
    ])  # fmt: skip
    return jnp.asarray(at) @ polynomial.T


def _powers(x: Float[Array, " k"]) -> Float[Array, "4 k"]:
    return jnp.stack([jnp.ones_like(x), x, x * x, x * x * x])


def moved_on(rho: Float[Array, "4 ..."], time: Float[Array, "..."]) -> Float[Array, "4 ..."]:
    """rho and its derivatives that much later on the same piece."""
    level, slope, bend, jerk = rho
    bent = bend + time * jerk
    return jnp.stack([
        level + time * (slope + time / 2 * (bend + time / 3 * jerk)),
        slope + time / 2 * (bend + bent),
        bent,
        jerk,
    ])  # fmt: skip
