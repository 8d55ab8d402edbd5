"""Every channel of a run from its states."""

from typing import Any

import jax
import jax.numpy as jnp

from .._status import Status
from ..dynamics import Inputs, Model, State, instant, motor_torque, prescribed_instant
from ._commands import torque_inputs
from ._drives import SpeedDrive
from ._trajectory import Trajectory


def trajectory(
    model: Model, drive, ts, states: State, status, steps, method, origin=None
) -> Trajectory:
    """Every channel of a run from its states; `origin` is the run's start where not ts[0], s.

    A run with `status` OK whose states or channels are not all finite ends as non-finite.
    """
    start = ts[0] if origin is None else origin

    def channels(t, state):
        return sample(model, drive, start, t, state)

    values: dict[str, Any] = jax.vmap(channels)(ts, states)
    leaves = jax.tree.leaves((states, values))
    finite = jnp.all(jnp.array([jnp.all(jnp.isfinite(x)) for x in leaves]))
    status = jnp.where((status == Status.OK) & ~finite, int(Status.NON_FINITE), status)
    return Trajectory(
        t=ts, **values, status=status, steps=steps, method=method, names=model.rig.names
    )


def sample(model: Model, drive, start, t, state: State) -> dict[str, jax.Array]:
    """Every channel at one instant.

    `_modal` writes the slip margin mu N - |f| out again, as of many runs it keeps only the least.
    """
    rig, force, since = model.rig, drive.force(t), t - start
    n = rig.size
    if isinstance(drive, SpeedDrive):
        state = state._replace(angle=drive.angle(t, start))
        inputs = Inputs(jnp.zeros(n), force, since)
        now, _, omega = prescribed_instant(
            model, state, inputs, drive.speed(t), drive.speed.rate(t)
        )
        command = motor_torque(rig, now, state.angle, omega, state.attitude)
    else:
        command, omega = drive.torque(t), state.angular_velocity
        now = instant(model, state, torque_inputs(rig, drive, t, start))
    elastic = rig.wheels.normal.T @ (now.motion.deflection + now.motion.mount)
    friction = rig.wheels.contact.friction
    return {
        "theta": state.angle,
        "omega": now.speed,
        "Omega": omega,
        "attitude": state.attitude / jnp.sqrt(state.attitude @ state.attitude),
        "dR": now.motion.displacement,
        "dR_rate": now.motion.velocity,
        "dR_elastic": elastic,
        "R_l": state.position,
        "V_l": state.drift + now.motion.platform,
        "a": now.acceleration,
        "a_sphere": now.sphere_acceleration,
        "shape": now.shape,
        "deflection": now.motion.deflection,
        "deflection_rate": now.deflection_rate,
        "mount_deflection": now.motion.mount,
        "mount_rate": now.motion.mount_rate,
        "normal_force": now.normal_force,
        "drive_force": now.drive_force,
        "slip_margin": friction * now.normal_force - jnp.abs(now.drive_force),
        "shaft_torque": now.shaft_torque,
        "torque": command,
        "force": force,
    }
