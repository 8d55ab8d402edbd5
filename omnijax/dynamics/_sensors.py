"""What sensors make of a run: their laws one after the other, in the order of the rig."""

from collections.abc import Callable
from typing import Any

import jax.numpy as jnp
from jaxtyping import Float

from ..laws import AbstractLaw, SensorSignal
from ..rig import GROUPS, Rig, channels


def _reading(law: AbstractLaw, signal: SensorSignal) -> Float[Any, "t c"]:
    return law(signal)


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
    for placed in rig.at("sensor"):
        place = placed.place
        if (place if place in GROUPS else place.rsplit("_", 1)[0]) != group:
            continue
        if place == group:
            values = values + apply(placed.law, SensorSignal(time, values))
            continue
        first = min(names.index(name) for name in names if name.rsplit("_", 1)[0] == group)
        k = names.index(place) - first
        own = values[:, k : k + 1]
        own = own + apply(placed.law, SensorSignal(time, own))
        values = jnp.concatenate([values[:, :k], own, values[:, k + 1 :]], axis=1)
    return values
