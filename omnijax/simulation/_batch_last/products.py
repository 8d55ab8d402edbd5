"""Sums, and sums of products, over axes of arrays whose last axis is the batch.

XLA hands sums to a library, which takes three times as long for some hundred designs and cannot
stand in one kernel.
"""

import functools
import math
from collections.abc import Callable, Sequence
from typing import Any

import jax.numpy as jnp
from jax import lax

from .._materialised import materialised
from .._one_kernel import is_asked
from .values import Call, Value

# terms of a sum up to which they are added one by one, and of a product of two matrices up to which
# every consumer may do so anew
WRITTEN_OUT, FUSED = 16, 8


def _summed(factors: Sequence[Any], axes: Sequence[int]) -> Any:
    """Sum over axes (rising) of the product of arrays, in a loop where its terms are many."""
    if not axes:
        return functools.reduce(jnp.multiply, factors)
    *others, axis = axes
    count = factors[0].shape[axis]

    def part(take: Callable, i) -> Any:
        return _summed([take(x, i, axis, keepdims=False) for x in factors], others)

    if math.prod(factors[0].shape[i] for i in axes) <= WRITTEN_OUT:
        return functools.reduce(jnp.add, [part(lax.index_in_dim, i) for i in range(count)])
    first = part(lax.index_in_dim, 0)
    return lax.fori_loop(1, count, lambda i, y: y + part(lax.dynamic_index_in_dim, i), first)


def reduce_sum(call: Call) -> list[Value]:
    """Sums over axes."""
    x, axes = call.inputs[0].array, sorted(call.params["axes"])
    own = x.size and is_asked()
    return [Value(_summed([x], axes), True)] if own else call.bound(x)


def dot_general(call: Call) -> list[Value]:
    """Products by element and their sum, over axes where the larger operand has them."""
    contracted, shared = call.params["dimension_numbers"]
    ranks = [len(a.aval.shape) for a in call.equation.invars]
    free = [
        [i for i in range(rank) if i not in (*summed, *kept)]
        for rank, summed, kept in zip(ranks, contracted, shared, strict=True)
    ]
    larger = int(ranks[1] > ranks[0])
    last = [*contracted[larger]] > free[larger]  # summed axes behind the free ones
    operands = []
    for side, value in enumerate(call.inputs):
        x = value.array if value.batched else jnp.asarray(value.array)[..., None]
        own = (*free[side], *contracted[side]) if last else (*contracted[side], *free[side])
        x = jnp.transpose(x, (*shared[side], *own, ranks[side]))
        before = len(shared[side]) + (0 if last else len(contracted[side]))
        before += len(free[0]) * (1 - side)
        operands.append(jnp.expand_dims(x, tuple(range(before, before + len(free[1 - side])))))
    left, right = operands
    first = len(shared[0]) + (len(free[0]) + len(free[1]) if last else 0)
    axes = tuple(range(first, first + len(contracted[0])))
    terms = math.prod(left.shape[i] for i in axes)
    if not terms or (terms > WRITTEN_OUT and not is_asked()):
        return [Value(jnp.sum(left * right, axes), True)]

    def added(x, y):
        return _summed((x, y), axes)

    if FUSED < terms <= WRITTEN_OUT:
        batch, other = (left, right) if call.inputs[0].batched else (right, left)
        return [Value(materialised(added, batch, other), True)]
    return [Value(added(left, right), True)]


SUMS = {"dot_general": dot_general, "reduce_sum": reduce_sum}
