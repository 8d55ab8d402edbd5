"""What sensors make of a run: their laws one after the other, in the order of the rig."""

from collections.abc import Callable
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from ..laws import AbstractLaw, AbstractSensor, SensorDelay, SensorSignal
from ..rig import Placed, Rig, channels, law_output


def _reading(law: AbstractLaw, signal: SensorSignal) -> Float[Any, "t c"]:
    return law_output(law, signal.values.shape, signal)


def _acting(rig: Rig, group: str) -> list[Placed]:
    """The laws at an output group and its channels, in the order in which they are worked out.

    That of the rig, but a delay comes before momentary laws, which is the same and sees no corner
    between two points that a limit or a lost sign makes.
    """
    out: list[Placed] = []
    for placed in rig.at("sensor"):
        if placed.group != group:
            continue
        at = len(out)
        while type(placed.law) is SensorDelay and at and _momentary(out[at - 1].law):
            at -= 1
        out.insert(at, placed)
    return out


def _momentary(law: AbstractLaw) -> bool:
    return isinstance(law, AbstractSensor) and law.momentary


def sensor_readings(
    rig: Rig,
    group: str,
    time: Float[Any, " t"],
    values: Float[Any, "t c"],
    apply: Callable[..., Float[Any, "t c"]] = _reading,
) -> Float[Any, "t c"]:
    """What the sensors of an output group show of its `values`, in the group's unit.

    Laws act in the order of the rig, each on what the former left of its group or channel; `time`
    counts from the run's first sample (s).  `apply` calls a law on a `SensorSignal`.
    """
    names = list(channels(rig.size))
    for placed in _acting(rig, group):
        place = placed.place
        if place == group:
            values = values + apply(placed.law, SensorSignal(time, values))
            continue
        first = min(names.index(name) for name in names if name.rsplit("_", 1)[0] == group)
        k = names.index(place) - first
        own = values[:, k : k + 1]
        own = own + apply(placed.law, SensorSignal(time, own))
        known = isinstance(values, np.ndarray) and isinstance(own, np.ndarray)
        xp = np if known else jnp  # no dispatch where nothing is traced
        values = xp.concatenate([values[:, :k], own, values[:, k + 1 :]], axis=1)
    return values
