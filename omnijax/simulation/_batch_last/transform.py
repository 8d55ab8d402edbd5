"""`vmap_last`: `jax.vmap` whose arrays keep the batch as their last axis, all the way through.

What one machine computes are vectors of three and matrices of three by three.  `jax.vmap` puts the
batch first, so that a processor's vector instructions meet rows of three; and it makes library
calls of products of small matrices.  With the batch last every operation is one long loop over
designs, and products of small matrices are written out.  The function is traced for one machine
and its operations are then carried out on whole batches, as `jax.vmap` does it by other rules.

Derivatives are taken inside (`vmap_last(jax.jacfwd(f))`).  What has no rule here goes by
`jax.vmap` for that one operation.
"""

import functools
from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
from jax.extend.core import ClosedJaxpr, Literal

from .loops import CALLS, LOOPS
from .products import SUMS
from .rules import RULES
from .values import Call, Rule, Value

LANES = 96  # of a batch worked out together
WIDTH = 8  # numbers that a processor works on at once
ALL: dict[str, Rule] = {**RULES, **LOOPS, **CALLS, **SUMS}


def vmap_last(function: Callable[..., Any]) -> Callable[..., Any]:
    """`jax.vmap(function, -1, -1)`, arrays inside having the batch as their last axis."""

    @functools.wraps(function)
    def mapped(*arguments: Any) -> Any:
        leaves, tree = jax.tree.flatten(arguments)
        arrays = [jnp.asarray(x) for x in leaves]
        size = arrays[0].shape[-1]
        one = [jax.ShapeDtypeStruct(x.shape[:-1], x.dtype) for x in arrays]

        def flat(*leaves):
            return function(*jax.tree.unflatten(tree, leaves))

        closed, out = jax.make_jaxpr(flat, return_shape=True)(*one)
        results = _evaluated(closed, [Value(x, True) for x in arrays], size)
        return jax.tree.unflatten(jax.tree.structure(out), [v.whole(size) for v in results])

    return mapped


def side_by_side(function: Callable[..., Any]) -> Callable[..., Any]:
    """`jax.vmap(function)`, the batch in front of its arrays, worked out with the batch last.

    In parts, as `in_parts` says.
    """
    last = vmap_last(function)

    def moved(tree, start, end):
        return jax.tree.map(lambda x: jnp.moveaxis(jnp.asarray(x), start, end), tree)

    return in_parts(lambda *arguments: moved(last(*moved(arguments, 0, -1)), -1, 0))


def in_parts(mapped: Callable[..., Any]) -> Callable[..., Any]:
    """A mapped function of arrays (b, ...), no more than `LANES` at a time.

    What one step of so many needs stays in a processor's caches.  Parts are alike, a multiple of
    `WIDTH` each; the last row fills up the last one.
    """

    @functools.wraps(mapped)
    def parted(*arguments: Any) -> Any:
        count = jax.tree.leaves(arguments)[0].shape[0]
        if count <= LANES:
            return mapped(*arguments)
        parts = -(-count // LANES)
        lanes = -(-count // (parts * WIDTH)) * WIDTH
        rows = jnp.minimum(jnp.arange(parts * lanes), count - 1).reshape(parts, lanes)
        cut = jax.tree.map(lambda x: jnp.asarray(x)[rows], arguments)
        joined = jax.lax.map(lambda some: mapped(*some), cut)
        return jax.tree.map(lambda x: x.reshape(-1, *x.shape[2:])[:count], joined)

    return parted


def _evaluated(closed: ClosedJaxpr, arguments: Sequence[Value], size: int) -> list[Value]:
    """Outputs of a traced function on `arguments`."""
    jaxpr = closed.jaxpr
    known = dict(zip(jaxpr.constvars, (Value(x, False) for x in closed.consts), strict=True))
    known |= dict(zip(jaxpr.invars, arguments, strict=True))

    def read(atom):
        return Value(atom.val, False) if isinstance(atom, Literal) else known[atom]

    for equation in jaxpr.eqns:
        inputs = [read(atom) for atom in equation.invars]
        call = Call(jaxpr, equation, inputs, size, _evaluated)
        known |= dict(zip(equation.outvars, _outputs(call), strict=True))
    return [read(atom) for atom in jaxpr.outvars]


def _outputs(call: Call) -> list[Value]:
    name = call.equation.primitive.name
    if any(value.batched for value in call.inputs):
        rule = ALL.get(name)
        outputs = None if rule is None else rule(call)
        return call.by_vmap() if outputs is None else outputs
    if name in CALLS:
        return CALLS[name](call)
    if name in SUMS:  # they stand in one kernel too
        one = [Value(jnp.asarray(value.array)[..., None], True) for value in call.inputs]
        sums = SUMS[name](call._replace(inputs=one, size=1))
        return [Value(x.array[..., 0], False) for x in sums]
    return [Value(x, False) for x in call.alone(*(v.array for v in call.inputs))]
