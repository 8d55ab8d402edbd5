"""A run between its samples, where it may ring faster than these tell, for slow sensors."""

import dataclasses
from typing import TypeVar

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..laws import AbstractSensor
from ..rig import Rig
from ._run import AbstractRun, Between

Run = TypeVar("Run", bound=AbstractRun)
SENSOR_POINTS = 8  # a sample, of a run that sensors remember


def to_be_seen(rig: Rig, ts) -> tuple[Rig, Float[Array, " p"], int]:
    """What to simulate so that the rig's sensors see the run: `at_samples` makes it one of `ts`.

    The rig without sensors, whose laws change no run but would a program; the sample times (t,) in
    s, with even points between them where a sensor remembers; the points a sample.
    """
    laws = [p.law for p in rig.at("sensor")]
    slow = any(isinstance(law, AbstractSensor) and law.remembers for law in laws)
    points = SENSOR_POINTS if slow else 1
    return without_sensors(rig), _finer(ts, points), points


def _finer(ts, points: int) -> Float[Array, " p"]:
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
    kept = [p for p in rig.effects if p.law.port != "sensor"]
    return rig if len(kept) == len(rig.effects) else rig.with_effects(kept)
