"""One operation of a traced function, its arrays with the batch as their last axis."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax import lax
from jax.extend.core import ClosedJaxpr, Jaxpr, Literal, jaxpr_as_fun


class Value(NamedTuple):
    """An array of the batch, or one for all designs alike."""

    array: Any
    batched: bool

    def whole(self, size: int) -> Any:
        """The array, the batch of `size` designs its last axis."""
        if self.batched:
            return self.array
        array = jnp.asarray(self.array)
        return lax.broadcast_in_dim(array, (*array.shape, size), range(array.ndim))

    def as_batched(self, batched: bool, size: int) -> Any:
        """The array, `whole` where it shall be one of the batch."""
        return self.whole(size) if batched else self.array


class Call(NamedTuple):
    """One operation: what it is, on what, for how many designs."""

    function: Jaxpr  # it stands in
    equation: Any
    inputs: list[Value]
    size: int
    evaluated: Callable[[ClosedJaxpr, Sequence[Value], int], list[Value]]  # of a function inside

    @property
    def params(self) -> dict[str, Any]:
        """The operation's parameters."""
        return self.equation.params

    def bound(self, *arrays: Any, **params: Any) -> list[Value]:
        """The operation's outputs on arrays of the batch, some parameters others."""
        primitive = self.equation.primitive
        outputs = primitive.bind(*arrays, **(self.params | params))
        outputs = outputs if primitive.multiple_results else [outputs]
        return [Value(x, True) for x in outputs]

    def alone(self, *arrays: Any) -> list[Any]:
        """The operation's outputs for one design, whatever functions it holds."""
        equation, atoms = self.equation, self.equation.invars
        named = {a: x for a, x in zip(atoms, arrays, strict=True) if not isinstance(a, Literal)}
        jaxpr = self.function.replace(
            constvars=[], invars=list(named), outvars=equation.outvars, eqns=[equation],
            effects=equation.effects,
        )  # fmt: skip
        return jaxpr_as_fun(ClosedJaxpr(jaxpr, []))(*named.values())

    def by_vmap(self) -> list[Value]:
        """The outputs by `jax.vmap`."""
        axes = [-1 if value.batched else None for value in self.inputs]
        outputs = jax.vmap(self.alone, axes, -1)(*(value.array for value in self.inputs))
        return [Value(x, True) for x in outputs]

    def wholes(self) -> list[Any]:
        """All inputs as arrays of the batch."""
        return [value.whole(self.size) for value in self.inputs]


Rule = Callable[[Call], list[Value] | None]  # None: `jax.vmap` shall do it
