"""Long-run suprema of a sum of periodic signals whose phases run independently.

For vectors, sup |sum_g x_g(phi_g)| = max over unit d of sum_g max_phi d . x_g(phi): the search runs
over directions and grid points, then Newton's method over the places.  Search and refinement are
not differentiated: by the envelope theorem the gradient is that of the formula at the places found.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from ._cycles import is_traced
from ._ladder import Piece, advance, points
from ._passage import Passages

DIRECTIONS = 400
FEWEST, MOST = 9, 12  # bits of a search's points a piece
PER_OSCILLATION = 2
TOGETHER = 20  # directions looked at together: bounds the memory
NEWTON = 6


class Places(NamedTuple):
    """One place per signal: the piece and v in it."""

    piece: Int[Array, " g"]
    v: Float[Array, " g"]


class Curves(NamedTuple):
    """Periodic solutions and the rows of one output over z (leading axes g, k)."""

    cycles: Passages
    starts: Float[Array, "g k N"]
    rows: Float[Array, "g k o N"]


def bits_needed(passage) -> int:
    """Bits of the points a piece whose A duration is up to `passage`; `FEWEST` while tracing.

    A piece may hold thousands of oscillations of a lightly damped mode, of nearly equal height.
    """
    if is_traced(passage):
        return FEWEST
    modes = np.linalg.eigvals(np.asarray(passage))
    swinging = np.abs(modes.imag[np.abs(modes.imag) > np.abs(modes.real)])
    points = PER_OSCILLATION * np.max(swinging, initial=0.0) / (2 * np.pi)
    return int(np.clip(np.ceil(np.log2(max(points, 1.0))), FEWEST, MOST))


def grid(curves: Curves, bits: int) -> Float[Array, "g p o"]:
    """The output on 2^bits points of every piece."""
    Z = jax.vmap(jax.vmap(lambda piece, z: points(piece, z, bits)))(
        curves.cycles.pieces, curves.starts
    )
    values = jnp.einsum("gkoN,gkNp->gkpo", curves.rows, Z)
    return values.reshape(values.shape[0], -1, values.shape[-1])


def present(curves: Curves, bits: int) -> Array:
    """Which grid points lie on a piece that has a width."""
    return jnp.repeat(curves.cycles.width > 0, 2**bits, axis=1)


def _at(curves: Curves, places: Places):
    """Per signal: the piece, z at the place, and the output's rows there."""

    def one(pieces: Piece, starts, rows, k, v):
        piece = jax.tree.map(lambda x: x[k], pieces)
        return advance(piece, starts[k], v), rows[k], piece.generator

    return jax.vmap(one)(curves.cycles.pieces, curves.starts, curves.rows, places.piece, places.v)


def values_at(curves: Curves, places: Places) -> Float[Array, "g o"]:
    """The output of each signal at its place."""
    z, rows, _ = _at(curves, places)
    return jnp.einsum("goN,gN->go", rows, z)


def _derivatives(curves: Curves, places: Places):
    """The output and its first two derivatives in v."""
    z, rows, F = _at(curves, places)
    first = jnp.einsum("gab,gb->ga", F, z)
    second = jnp.einsum("gab,gb->ga", F, first)
    return tuple(jnp.einsum("goN,gN->go", rows, x) for x in (z, first, second))


def _places(index, bits: int, shift: float = 0.0) -> Places:
    return Places(index >> bits, (index % 2**bits + shift) / 2**bits)


def _refined(curves: Curves, start: Places, bits: int, objective) -> tuple[Places, Array]:
    """Newton's method per signal for the largest objective' output; never worse than the start.

    `objective(x)` gives the weights w (g, o) and whether the square of the sum counts.
    """
    step = 2.0**-bits

    def improve(carry, _):
        places, best = carry
        x, first, second = _derivatives(curves, places)
        weight, coupled = objective(x)
        slope = jnp.sum(weight * first, axis=-1)
        bend = jnp.diag(jnp.sum(weight * second, axis=-1)) + coupled * first @ first.T
        bend = bend - 1e-12 * jnp.max(jnp.abs(bend)) * jnp.eye(len(slope))
        newton = -jnp.linalg.solve(bend + 1e-300 * jnp.eye(len(slope)), slope)
        own = jnp.where(jnp.diag(bend) < 0, -slope / jnp.minimum(jnp.diag(bend), -1e-300), 0.0)
        moves = jnp.stack([newton, own])
        moves = jnp.clip(jnp.where(jnp.isfinite(moves), moves, 0.0), -step, step)
        trials = jnp.clip(places.v + moves, 0.0, 1.0)
        values = jax.vmap(lambda v: _size(values_at(curves, Places(places.piece, v)), objective))(
            trials
        )
        chosen = jnp.argmax(values)
        better = values[chosen] > best
        v = jnp.where(better, trials[chosen], places.v)
        return (Places(places.piece, v), jnp.where(better, values[chosen], best)), None

    first = _size(values_at(curves, start), objective)
    return jax.lax.scan(improve, (start, first), None, length=NEWTON)[0]


def _size(x, objective):
    weight, coupled = objective(x)
    total = jnp.sum(x, axis=0)
    return total @ total if coupled else jnp.sum(weight * x)


def _largest_square(x):
    """|sum x|^2: the weights are twice the sum, and places couple through it."""
    return jnp.broadcast_to(2 * jnp.sum(x, axis=0), x.shape), 2.0


def supremum_places(curves: Curves, bits: int) -> Places:
    """Places that give sup |sum_g x_g|."""
    curves = jax.lax.stop_gradient(curves)
    values = grid(curves, bits)
    seen = present(curves, bits)[..., None]
    directions = jnp.asarray(_sphere(DIRECTIONS, values.shape[-1]))

    def support(d):
        along = jnp.where(seen, jnp.einsum("gpo,do->gpd", values, d), -jnp.inf)
        return jnp.argmax(along, axis=1).T, jnp.sum(jnp.max(along, axis=1), axis=0)

    heights = jax.lax.map(lambda d: support(d[None])[1][0], directions, batch_size=TOGETHER)
    best = directions[jnp.argsort(-heights)[:8]]

    def ascend(best, _):  # the sum found in a direction is the next direction
        index = support(best)[0]
        total = jnp.sum(jax.vmap(lambda i: _take(values, i))(index), axis=1)
        size = jnp.linalg.norm(total, axis=-1, keepdims=True)
        return jnp.where(size > 0, total / jnp.where(size > 0, size, 1.0), best), None

    best = jax.lax.scan(ascend, best, None, length=8)[0]
    index, height = support(best)
    index = index[jnp.argmax(height)]
    return _best_of(curves, index, bits, _largest_square)


def _take(values, index):
    return jnp.take_along_axis(values, index[:, None, None], axis=1)[:, 0]


def _best_of(curves: Curves, index, bits, objective) -> Places:
    """Refined from the grid point and from just before it, as a piece may end higher."""
    seen = present(curves, bits)
    before = jax.vmap(_previous)(index, seen)
    last = _places(before, bits, shift=1.0 - 1e-3)
    starts = [_places(index, bits)]
    starts.append(Places(last.piece, jnp.where(index % 2**bits == 0, last.v, starts[0].v)))
    both = jax.tree.map(lambda *xs: jnp.stack(xs), *starts)
    places, heights = jax.vmap(lambda start: _refined(curves, start, bits, objective))(both)
    return jax.tree.map(lambda x: x[jnp.argmax(heights)], places)


def _previous(index, seen):
    """The grid point before `index` on a piece that has a width, around the period."""
    size = len(seen)
    back = (index - 1 - jnp.arange(size)) % size
    return back[jnp.argmax(seen[back])]


def component_places(curves: Curves, row: Float[Array, " o"], bits: int) -> Places:
    """Places that give the largest sum_g row . x_g, each signal by itself."""
    curves = jax.lax.stop_gradient(curves)
    along = jnp.where(present(curves, bits), grid(curves, bits) @ row, -jnp.inf)

    def objective(x):
        return jnp.broadcast_to(row, x.shape), 0.0

    return _best_of(curves, jnp.argmax(along, axis=1), bits, objective)


def _sphere(count: int, size: int) -> np.ndarray:
    """Directions spread evenly over the unit sphere (Fibonacci), rows."""
    if size == 1:
        return np.array([[1.0], [-1.0]])
    k = np.arange(count) + 0.5
    z, turn = 1 - 2 * k / count, np.pi * (1 + 5**0.5) * k
    flat = np.sqrt(1 - z * z)
    return np.stack([flat * np.cos(turn), flat * np.sin(turn), z], axis=-1)
