"""Between a run and what is measured of it: recorded inputs in, the sensors' readings out."""

from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np

from .._batch import check_single
from ..dynamics import sensor_readings
from ..recording import Recording, at_first_sample
from ..rig import Rig, as_rig
from ._between import SENSOR_POINTS
from ._drives import TorqueDrive
from ._run import AbstractRun
from ._signals import table

GROUPS = ("dR", "theta", "Omega", "a")  # what a recording holds of a run
SURE = 6.0  # sigma of the sphere's velocity at the first sample, above which it rolls already
ROLLING = 1e-3  # rad/s, that it has to be at least


def drive_from_recording(recording: Recording) -> TorqueDrive:
    """The recording's torques and force, linear between samples, and where its run starts.

    The wheels start at the angles of the first row (zero where theta was not measured).  If the
    first samples say that the sphere turns already, their smooth course gives its velocity.
    Times are the recording's own: `.since(recording.time[0])` is the drive of a study, whose runs
    begin at 0.

    Torques (t, n) in N m, force (t, 3) in N, angles (n,) in rad, Omega (3,) in rad/s.  Raises
    nothing: a recording that was read has torques.
    """
    time = recording.time.tolist()
    return TorqueDrive(
        torque=table(time, recording.torque),
        force=table(time, recording.force),
        initial_angle=jnp.asarray(_first(recording.group("theta"))),
        initial_velocity=_initial_velocity(recording),
    )


def _first(values: np.ndarray) -> np.ndarray:
    """The first usable value of each column; zero where there is none."""
    good = np.isfinite(values)
    first = values[np.argmax(good, axis=0), np.arange(values.shape[1])]
    return np.where(good.any(axis=0), first, 0.0)


def _initial_velocity(recording: Recording):
    """Omega (3,) in rad/s at the first sample; `None` where that is rest, or unknown."""
    velocity, sigma = at_first_sample(recording.time, recording.group("Omega"))
    rolls = np.isfinite(velocity).all() and np.any(
        np.abs(velocity) > np.maximum(SURE * sigma, ROLLING)
    )
    return jnp.asarray(velocity) if rolls else None


def measured(trajectory: AbstractRun, rig: Rig | str | Path) -> dict[str, Any]:
    """What the rig's sensors make of a run: dR, theta, Omega and a, (samples, channels).

    `rig` may be a rig file or the name of a bundled rig.
    The laws at the sensors act one after the other, in the order of the rig, on their group or
    channel; without any the run's own values come back.  Differentiable.  One that remembers has
    seen the run between its samples where this was simulated for a rig with such sensors
    (`trajectory.between`), else the samples alone.

    SI: m, rad, rad/s, m/s^2.

    Raises `ValueError` for a batch of runs or rigs.

    Source: the sensors of `docs/formats.md`, recordings.
    """
    check_single(trajectory.status.shape)
    rig = as_rig(rig)
    seen = trajectory if trajectory.between is None else trajectory.between
    points = 1 if trajectory.between is None else SENSOR_POINTS
    time = seen.t - seen.t[0]
    return {g: sensor_readings(rig, g, time, getattr(seen, g))[::points] for g in GROUPS}
