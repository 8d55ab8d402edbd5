"""Laws at the places of a machine, and what collects their sums and their memories' rates."""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from ..laws import AbstractLaw, ActuatorSignal, delayed, in_series
from ..rig import law_memory, law_output, law_rate


class PlacedLaw(eqx.Module):
    """One law at one place; `gate` 0 switches it off.

    `on` says whether any of the points that run side by side has the law; if none, it is skipped.
    """

    law: AbstractLaw
    place: str = eqx.field(static=True)
    gate: Float[Array, ""] = 1.0  # pyright: ignore[reportAssignmentType]
    on: Bool[Array, ""] | None = None

    @property
    def port(self) -> str:
        """Where the law acts."""
        return self.law.port

    def where_on(self, made: Callable[[], Any], otherwise: Any) -> Any:
        """`made()` if any of the points that run side by side has the law, else `otherwise`."""
        if self.on is None:
            return made()
        return jax.lax.cond(self.on, made, lambda: otherwise)

    def added(self, signal: NamedTuple, memory: Any) -> tuple[Any, Any]:
        """What the law adds at its place, and the rate of its memory, None without one."""

        def made():
            rate = None if memory is None else law_rate(self.law, signal, memory)
            return jnp.asarray(self.gate * law_output(self.law, (), signal, memory), float), rate

        return self.where_on(made, (jnp.zeros(()), jax.tree.map(jnp.zeros_like, memory)))


class Ports:
    """The laws of a machine at one moment: `ports("shaft", "axis", signal)` is their sum.

    `rates` are the time derivatives of the laws' memories, filled as the ports are asked.
    """

    def __init__(self, placed: tuple[PlacedLaw, ...], memory: tuple[Any, ...]):
        self.placed, self.memory = placed, memory
        self.rates = [None if z is None else jnp.zeros_like(z) for z in memory]

    def __call__(self, port: str, place: str, signal: NamedTuple) -> Any:
        total = jnp.zeros(())
        for k, (one, z) in enumerate(zip(self.placed, self.memory, strict=True)):
            if one.port == port and one.place == place:
                added, self.rates[k] = one.added(signal, z)
                total = total + added
        return total

    def delivered(self, place: str, torque: Any, angle: Any, speed: Any) -> Any:
        """A commanded torque as the actuator's laws deliver it, one after the other."""
        mine = [k for k, p in enumerate(self.placed) if (p.port, p.place) == ("actuator", place)]

        def change(k, torque):
            return self.placed[k].added(ActuatorSignal(torque, angle, speed), self.memory[k])

        torque, rates = in_series(torque, mine, change)
        for k, rate in zip(mine, rates, strict=True):
            self.rates[k] = rate
        return torque


def command_delay(placed: tuple[PlacedLaw, ...], time: Float[Array, ""]) -> Any:
    """By how many s the command that acts at `time` (s from the run's first sample) is late."""
    return sum((-p.gate * p.law(time, None) for p in placed if p.port == "command"), 0.0)


def delayed_inputs(
    placed: tuple[PlacedLaw, ...],
    time: Float[Array, " t"],
    inputs: Mapping[str, Array],
    jump: Any = 0.0,
) -> dict[str, Array]:
    """Inputs (t,) as delays of the command let them act at each moment.

    `time` counts from the run's first sample; before `time[0]` the first input plus a `jump` acts.
    """
    if not any(p.port == "command" for p in placed):
        return dict(inputs)
    late = jax.vmap(lambda t: jnp.asarray(command_delay(placed, t), float))(time)
    acts = delayed(time, inputs["input"][:, None], late)[:, 0]
    return dict(inputs) | {"input": acts + jnp.where(time - late < time[0], jump, 0.0)}


def resting(placed: tuple[PlacedLaw, ...]) -> tuple[Any, ...]:
    """The laws' memories at rest."""
    return tuple(law_memory(one.law) for one in placed)
