"""What was before a window: not measured, but late sensors still show it, late drives obey it.

Before its first sample a window's position ran on as at its start, with an acceleration of its own,
and its input was constant.  Both are free constants of a window, as its start is: `Before`.
"""

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from ....laws import SensorSignal
from ....machine import AbstractMachine, PlacedLaw, settled_memory
from ..._settings import SETTINGS

SECONDS = SETTINGS.free_before.seconds


class Before(NamedTuple):
    """A window's past: acceleration of the position, and change of the input at its start."""

    bend: Float[Array, ""]
    jump: Float[Array, ""]


def matters(laws: Sequence) -> tuple[bool, bool]:
    """Whether some `laws` show the position of before, and whether some obey the input of then."""
    return (
        any(getattr(law, "remembers", False) for law in laws),
        any(law.port == "command" or law.has_memory() for law in laws),
    )


def seen(
    placed: Sequence[PlacedLaw], time: Float[Array, " t"], position: Float[Array, " t"],
    step: float, before: Before,
) -> Float[Array, " t"]:  # fmt: skip
    """A window's position as the sensors show it."""
    past = step * jnp.arange(-math.ceil(SECONDS / step), 0)
    for one in placed:
        if one.port != "sensor":
            continue
        values, clock = position, time
        if one.law.remembers:  # pyright: ignore[reportAttributeAccessIssue], a sensor's law
            slope = (4 * values[1] - 3 * values[0] - values[2]) / (2 * step)
            earlier = values[0] + slope * past + before.bend / 2 * past**2
            values, clock = jnp.append(earlier, values), jnp.append(time[0] + past, time)
        change = one.law(SensorSignal(clock, values[:, None]), None)[-len(time) :, 0]
        position = position + one.gate * change
    return position


def memories_at(
    machine: AbstractMachine, placed: Sequence[PlacedLaw], start: Float[Array, " n"],
    inputs: Mapping[str, Array], before: Before,
) -> tuple:  # fmt: skip
    """The laws' memories at a window's start: settled under the input of before."""
    then = {k: x[0] for k, x in inputs.items()}
    then["input"] = then["input"] + before.jump
    return settled_memory(machine, tuple(placed), start, then)
