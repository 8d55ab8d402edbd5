"""Many designs by one compiled program: batches of one shape, and derivatives forwards."""

from collections.abc import Callable, Iterator, Sequence
from typing import Any, Literal

import jax
import jax.numpy as jnp
import numpy as np

from ..simulation import WIDTH, side_by_side

Order = Literal["in turn", "side by side", "batch last"]


def batches(rows: Any, size: int) -> Iterator[tuple[int, Any, int]]:
    """(first, rows (size, ...), count) of each batch of `rows` (a tree of arrays, by row).

    The last row fills up the last batch, so that every batch takes the same compiled program;
    `count` rows of a batch are wanted.
    """
    total = len(jax.tree.leaves(rows)[0])
    for first in range(0, total, size):
        index = np.minimum(np.arange(first, first + size), total - 1)
        yield first, jax.tree.map(lambda x, i=index: x[i], rows), min(size, total - first)


def in_batches(function: Callable[[Any], Any], rows: Any, size: int) -> Any:
    """`function` of all rows, `size` at a time; its arrays (leading axis: row) joined, as NumPy."""
    parts = [
        jax.tree.map(
            lambda x, count=count: np.asarray(x)[:count], function(jax.tree.map(jnp.asarray, some))
        )
        for _, some, count in batches(rows, size)
    ]
    return jax.tree.map(lambda *xs: np.concatenate(xs), *parts)


def each(function: Callable[..., Any], rows: Sequence[Any], order: Order) -> Any:
    """`function(*row)` of every row of `rows` (trees of arrays, leading axis: row).

    What takes the same steps for every row goes `side by side`; with the `batch last`
    (`side_by_side`) where many small steps make up the time, and there are `WIDTH` rows.  A closed
    form looks for its maxima in loops that end when they are found: side by side, each row would
    wait for the slowest, and take both sides of every choice; so rows go `in turn`.
    """
    count = jax.tree.leaves(rows[0])[0].shape[0]
    if order == "batch last" and count >= WIDTH:
        return side_by_side(function)(*rows)
    if order != "in turn":
        return jax.vmap(function)(*rows)
    return jax.lax.map(lambda row: function(*row), tuple(rows))


def percent_per_percent(changes: np.ndarray, figures: np.ndarray) -> np.ndarray:
    """Relative sensitivities (..., m, p) of figures (..., m); 0 of a figure that is 0.

    `changes` (..., m, p) are parameter x d figure / d parameter, in the figures' units.
    """
    size = figures[..., None]
    return np.where(size == 0, 0.0, changes / np.where(size == 0, 1.0, size))


def value_and_jacobian(function: Callable[[Any], Any]) -> Callable[[Any], tuple[Any, Any]]:
    """x (d,) -> f (a tree of arrays) and df/dx, each array with d as a last axis; forward mode.

    All directions go through one vectorised program, beside the values.
    """

    def both(x):
        def push(tangent):
            return jax.jvp(function, (x,), (tangent,))

        values, columns = jax.vmap(push)(jnp.eye(len(x)))
        first = jax.tree.map(lambda v: v[0], values)
        return first, jax.tree.map(lambda c: jnp.moveaxis(c, 0, -1), columns)

    return both
