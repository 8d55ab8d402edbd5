"""A run between its samples, where it may ring faster than these tell, for slow sensors."""

import dataclasses
from collections.abc import Sequence
from typing import TypeVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..laws import AbstractSensor
from ..rig import Rig
from ._run import AbstractRun, Between

Run = TypeVar("Run", bound=AbstractRun)
SENSOR_POINTS = 8  # a sample, of a run that sensors remember


def points_of(rig: Rig) -> int:
    """How many points a sample a run needs for the rig's sensors: 1 where none remembers."""
    laws = [p.law for p in rig.at("sensor")]
    slow = any(isinstance(law, AbstractSensor) and law.remembers for law in laws)
    return SENSOR_POINTS if slow else 1


def finer_times(ts, points: int) -> Float[Array, " p"]:
    """Sample times (t,) in s with `points` even points a sample; every sample as it is."""
    if points == 1 or np.shape(ts)[0] < 2:
        return ts
    ts = jnp.asarray(ts)
    between = [ts[:-1] + k / points * jnp.diff(ts) for k in range(points)]
    return jnp.append(jnp.stack(between, axis=1).ravel(), ts[-1])


def at_samples(run: Run, points: int) -> Run:
    """A run at `points` points a sample as one at its samples, which knows what was between."""
    if points == 1:
        return run
    between = Between(run.t, run.dR, run.theta, run.Omega, run.a)
    channels = {name: getattr(run, name)[::points] for name in run.UNITS}
    return dataclasses.replace(run, **channels, between=between)


def without_sensors(rig: Rig) -> Rig:
    """The rig as it moves: no law of a sensor changes a run."""
    kept: Sequence = tuple(p for p in rig.effects if p.law.port != "sensor")
    if len(kept) == len(rig.effects):
        return rig
    return eqx.tree_at(lambda r: r.effects, rig, kept, is_leaf=lambda x: x is rig.effects)
