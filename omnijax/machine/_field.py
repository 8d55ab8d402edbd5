"""The rate of a machine's state with the memories of the laws at its places, as one vector."""

from collections.abc import Mapping
from typing import Any, ClassVar, Protocol

import jax.numpy as jnp
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, ArrayLike, Float

from ..dynamics import rest_memory
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
    along, _ = field_of_numbers(machine, placed)

    def split(z):
        return z[: len(z) - size], unravel(z[len(z) - size :])

    def rate(z, u):
        x, memory = z[: len(z) - size], z[len(z) - size :]
        *dx, rates = along((*x, memory), u)
        return jnp.concatenate([jnp.stack(dx), rates])

    return rate, lambda x: jnp.concatenate([jnp.asarray(x, float), rest]), split


def field_of_numbers(machine: Moving, placed: tuple[PlacedLaw, ...]):
    """(rate(z, u), join(x, memory)); z: the state's numbers one by one, the memories as a vector.

    XLA fuses operations on separate numbers.  A state in one vector would be joined and split at
    every step, which takes twice as long.
    """
    rest, unravel = ravel_pytree(resting(placed))

    def rate(z, u):
        *x, memory = z
        ports = Ports(placed, unravel(memory.astype(rest.dtype)))
        return join(machine.rate(jnp.stack(x), u, ports), tuple(ports.rates))

    def join(x, memory):
        memory = ravel_pytree(memory)[0]  # without any laws that remember of another type
        return (*(jnp.asarray(v, float) for v in x), jnp.asarray(memory, float))

    return rate, join


def settled_memory(
    machine: Moving, placed: tuple[PlacedLaw, ...], x: Float[Array, " n"], u: Mapping[str, Array]
) -> tuple[Any, ...]:
    """The laws' memories that do not change in the state `x` under the inputs `u`, as of `placed`.

    A motion that begins with these begins settled: a slow drive already delivers its command.
    """
    memory = resting(placed)
    if all(z is None for z in memory):
        return memory
    rate, _ = field_of_numbers(machine, placed)
    flat, unravel = ravel_pytree(memory)
    return unravel(rest_memory(lambda z: rate((*x, z), u)[-1], flat))
