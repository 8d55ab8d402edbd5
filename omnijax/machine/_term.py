"""A machine's vector field as a term of diffrax, for solvers, events and adjoints of one's own."""

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float

from .._errors import InputError, did_you_mean
from ._field import Moving, vector_field
from ._log import Log
from ._ports import PlacedLaw, command_delay

if TYPE_CHECKING:
    import diffrax as dfx

Given = Callable[[Array], Array] | ArrayLike  # an input: of the time in s, or a constant


def term(
    machine: Moving, inputs: Log | Mapping[str, Given], placed: tuple[PlacedLaw, ...] = ()
) -> "dfx.ODETerm":
    """`diffrax.ODETerm` of dz/dt, z (n,) the machine's state and then the memories of its laws.

    `inputs` by name in SI units: functions of the time in s, or numbers that hold; further inputs
    of an axis are 1 where they are not given.  Of a `Log` they are linear between its samples.
    Begin at `start_vector`.  Delays of the command are in it; laws of sensors are not: they change
    what is measured, not the motion.  Raises `InputError` for inputs that the machine has not.
    """
    from diffrax import ODETerm  # slow to import

    given = _of_log(inputs) if isinstance(inputs, Log) else dict(inputs)
    known, first = machine.inputs, next(iter(machine.inputs))
    for name in given:
        if name not in known:
            hint = did_you_mean(name, known)
            raise InputError(
                f"`inputs.{name}` is no input of the machine.{hint} Inputs: {', '.join(known)}."
            )
    if first not in given:
        raise InputError(f"`inputs.{first}` ({known[first]}) is missing.")
    rate, _, _ = vector_field(machine, placed)

    def at(name: str, time):
        x = given.get(name, 1.0)
        return jnp.asarray(x(time) if callable(x) else x, float)

    def field(time, z, args):
        late = time - command_delay(placed, jnp.asarray(time, float))
        return rate(z, {k: at(k, late if k == "input" else time) for k in known})

    return ODETerm(field)


def start_vector(
    machine: Moving,
    first: Mapping[str, tuple[ArrayLike, ArrayLike]],
    placed: tuple[PlacedLaw, ...] = (),
) -> Float[Array, " n"]:
    """The term's state at which the outputs have the values and rates `first`, laws at rest."""
    _, join, _ = vector_field(machine, placed)
    return join(jnp.stack([jnp.asarray(v, float) for v in machine.start(first)]))


def _of_log(log: Log) -> dict[str, Given]:
    def along(values) -> Given:
        time, x = jnp.asarray(log.time), jnp.asarray(values)
        return lambda t: jnp.interp(t, time, x)

    return {k: along(x) for k, x in log.inputs.items()}
