"""Which torques act, and when: the commands of a drive behind the rig's laws at `command`."""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..dynamics import Inputs, command_times
from ..rig import Rig
from ._drives import TorqueDrive


def torque_inputs(rig: Rig, drive: TorqueDrive, t, start) -> Inputs:
    """What a torque drive says at time `t` (s) of a run that began at `start`."""
    since = t - start
    placed = rig.at("command")
    if placed:
        times = start + command_times(placed, since, rig.size)
        torque = jnp.diagonal(jax.vmap(drive.torque)(times))
    else:
        torque = drive.torque(t)
    return Inputs(torque, drive.force(t), since)


def command_knots(rig: Rig, drive: TorqueDrive, start) -> Float[Array, " k"]:
    """Times (s) at which knots of the commanded torques act."""
    knots = drive.torque.knots
    placed = rig.at("command")
    if not placed:
        return knots
    since = jnp.maximum(knots - start, 0.0)
    shift = jax.vmap(lambda t: command_times(placed, t, rig.size) - t)(since)
    return jnp.sort((knots[:, None] - shift).ravel())
