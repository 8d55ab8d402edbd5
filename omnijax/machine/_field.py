"""The rate of a machine's state with the memories of the laws at its places, as one vector."""

from collections.abc import Mapping
from typing import Any, ClassVar, Protocol

import jax.numpy as jnp
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, ArrayLike, Float

from ._ports import PlacedLaw, Ports, resting


class Moving(Protocol):
    """What has an equation of motion with ports: every `AbstractMachine`."""

    inputs: ClassVar[Mapping[str, str]]  # with their units, the one that drives first

    def rate(self, x: Float[Array, " n"], u: Mapping[str, Array], ports: Ports) -> Any:
        """Time derivative of the state `x`."""
        ...

    def start(self, first: Mapping[str, tuple[ArrayLike, ArrayLike]]) -> Any:
        """A state at which the outputs have the values and rates `first`."""
        ...


def vector_field(machine: Moving, placed: tuple[PlacedLaw, ...]):
    """(rate(z, u) of the state with the laws' memories as one vector, join(x), split(z))."""
    rest, unravel = ravel_pytree(resting(placed))
    size = len(rest)

    def split(z):
        return z[: len(z) - size], unravel(z[len(z) - size :])

    def rate(z, u):
        x, memory = split(z)
        ports = Ports(placed, memory)
        dx = jnp.stack([jnp.asarray(v, float) for v in machine.rate(x, u, ports)])
        return jnp.concatenate([dx, ravel_pytree(tuple(ports.rates))[0]])

    return rate, lambda x: jnp.concatenate([jnp.asarray(x, float), rest]), split
