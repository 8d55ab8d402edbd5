"""Long-run supremum of |dR| where the wheels' phases run independently: where each wheel has to be.

Without coupling dR = sum_i x_i(phi_i) r_i with every x_i anywhere between its extremes, and a
convex function is largest in a corner of that box.  With coupling every wheel moves along a curve
in space, dR = sum_j x_j(phi_j): the corners of the wheels' own extremes give a direction, the
search along it places, their sum the next direction, and so on.
"""

import itertools
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from .._exact import rows_of
from .._steady import sphere
from .periodic import Motion, Pairing, at, value
from .periodic_peak import Spots, by_wheel, chosen, refine, search, weighted

WEAK = 1e-3  # share of the motion across, below which the first corner is the right one
STRONG = 0.03  # and above which corners alone may all lead elsewhere
DIRECTIONS = 16  # followed beside the corners there
SWEEPS = 2  # searches along one direction after the other, from each start
ROUNDS = 6  # directions after the last search


class Places(NamedTuple):
    """Times s from each wheel's period's start: largest and smallest x, or one of the supremum."""

    time: Array  # (2, j, c) or (1, j, c)


def is_coupled(layout: Pairing) -> bool:
    """Whether a wheel moves more than its own direction."""
    return layout.axis != layout.wheel


def places(m: Motion, layout: Pairing, blocks: int, starts: int = 1) -> Places:
    """Where the wheels are at the supremum (not differentiated), from the best `starts` corners."""
    m = jax.lax.stop_gradient(m)
    if is_coupled(layout):
        return Places(_along(m, layout, blocks, starts)[None])
    return Places(refine(m, layout, search(m, layout, blocks), (1.0, -1.0)))


def _vectors(m: Motion, layout: Pairing, time):
    """x_j at the wheels' times (j, c) as vectors, (a, j, c)."""
    x = value(at(m, layout, rows_of(time, layout.wheel)))
    rows = [[jnp.zeros_like(time[0])] * layout.wheels for _ in range(layout.directions)]
    for p, (a, j) in enumerate(zip(layout.axis, layout.wheel, strict=True)):
        rows[a][j] = x[p]
    return jnp.stack([jnp.stack(row) for row in rows])


def _unit(total):
    size = jnp.sqrt(jnp.sum(total**2, axis=0))
    return total / jnp.where(size > 0, size, 1.0)


def _corners(vectors, count: int):
    """The longest of the sums that take each wheel's first or second vector, (s, a, c).

    More than there are: followed by directions all around.
    """
    first, second = vectors
    sums = [
        sum((first, second)[side][:, j] for j, side in enumerate(sides))
        for sides in itertools.product((0, 1), repeat=first.shape[1])
    ]
    sums = jnp.stack(sums)
    totals = _longest(sums, min(count, len(sums)))
    if count <= len(sums):
        return totals
    more = jnp.asarray(sphere(count - len(sums), 3))[..., None]
    return jnp.concatenate([totals, jnp.broadcast_to(more, (len(more), *totals.shape[1:]))])


def starts_needed(across: float, wheels: int) -> int:
    """Directions to follow where `across` is the share of the motion across its own direction."""
    if across < WEAK:
        return 1
    return 2**wheels + (DIRECTIONS if across > STRONG else 0)


def _longest(sums, count: int):
    """The `count` longest of vectors (s, a, c)."""
    order = jnp.argsort(-jnp.sum(sums**2, axis=1), axis=0)[:count]
    return jnp.take_along_axis(sums, order[:, None], axis=0)


def _along(m: Motion, layout: Pairing, blocks: int, starts: int):
    """Times (j, c) of the supremum of wheels whose motions are curves in space."""
    axis, wheel = np.array(layout.axis), np.array(layout.wheel)
    own = np.array([np.flatnonzero((axis == j) & (wheel == j))[0] for j in range(layout.wheels)])
    alone = layout._replace(axis=tuple(axis[own]), wheel=tuple(wheel[own]))
    extremes = search(chosen(m, own), alone, blocks).time
    totals = _corners(jnp.stack([_vectors(m, layout, t) for t in extremes]), starts)

    def follow(total):
        for _ in range(1 if starts == 1 else SWEEPS):
            found = search(weighted(m, _unit(total)[axis]), layout, blocks)
            total = jnp.sum(_vectors(m, layout, found.time[0]), axis=1)

        def turn(carry, _):
            time, total = carry
            start = Spots(time[None], found.step[:1])
            time = refine(weighted(m, _unit(total)[axis]), layout, start, (1.0,), 2)[0]
            return (time, jnp.sum(_vectors(m, layout, time), axis=1)), None

        return jax.lax.scan(turn, (found.time[0], total), None, length=ROUNDS)[0]

    times, totals = jax.lax.map(follow, totals)
    best = jnp.argmax(jnp.sum(totals**2, axis=1), axis=0)
    return jnp.take_along_axis(times, best[None, None], axis=0)[0]


def supremum(m: Motion, layout: Pairing, spots: Places, gram=None):
    """|dR|^2 at the supremum, (c,); differentiable."""
    if is_coupled(layout):
        total = jnp.sum(_vectors(m, layout, spots.time[0]), axis=1)
        return jnp.sum(total**2, axis=0)
    high, low = (value(at(m, layout, rows_of(t, layout.wheel))) for t in spots.time)
    high, low = by_wheel(high, layout), by_wheel(low, layout)
    if gram is None:
        return jnp.sum(jnp.where(high > -low, high, low) ** 2, axis=0)
    sums = [
        jnp.stack([(high, low)[side][j] for j, side in enumerate(sides)])
        for sides in itertools.product((0, 1), repeat=layout.wheels)
    ]
    return jnp.max(jnp.stack([jnp.einsum("ic,ij,jc->c", x, gram, x) for x in sums]), axis=0)
