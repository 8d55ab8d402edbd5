"""Products of arrays whose last axis is the batch, written out."""

import functools

import jax.numpy as jnp
from jax import lax

from .._materialised import materialised
from .values import Call, Value

# terms of a product of two matrices up to which they are added one by one (XLA hands sums of more
# to a library, which takes three times as long for some hundred designs), and up to which every
# consumer may do so anew
WRITTEN_OUT, FUSED = 16, 8


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
    terms = left.shape[first]
    if not (len(axes) == 1 and all(free) and terms <= WRITTEN_OUT):
        return [Value(jnp.sum(left * right, axes), True)]

    def added(x, y):
        take = functools.partial(lax.index_in_dim, axis=first, keepdims=False)
        return functools.reduce(jnp.add, [take(x, k) * take(y, k) for k in range(terms)])

    if terms <= FUSED:
        return [Value(added(left, right), True)]
    batch, other = (left, right) if call.inputs[0].batched else (right, left)
    return [Value(materialised(added, batch, other), True)]
