"""Drives: what the user imposes on the machine in time."""

from collections.abc import Sequence

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..rig import Rig
from ._signals import Signal, constant


class AbstractDrive(eqx.Module):
    """Motor torques or prescribed wheel speeds, and the force on the platform.

    `initial_angle` holds the wheels' angles at the start of the run (None: zero, where a gap
    begins at the contact).
    """

    force: eqx.AbstractVar[Signal]
    initial_angle: eqx.AbstractVar[Float[Array, " n"] | None]


class TorqueDrive(AbstractDrive):
    """Motor torques in N m, one a wheel, and the force on the platform in N.

    `initial_velocity` is Omega at the start in rad/s, for a run that begins already rolling.
    """

    torque: Signal
    force: Signal
    initial_angle: Float[Array, " n"] | None = None
    initial_velocity: Float[Array, "3"] | None = None


class SpeedDrive(AbstractDrive):
    """Prescribed wheel speeds in rad/s, one a wheel, and the force on the platform in N."""

    speed: Signal
    force: Signal
    initial_angle: Float[Array, " n"] | None = None

    def angle(self, time, start) -> Float[Array, " n"]:
        """Wheel angles in rad at `time` of a run that starts at time `start`."""
        zero = 0.0 if self.initial_angle is None else self.initial_angle
        return zero + self.speed.integral(time) - self.speed.integral(start)


def _signal(value: "Signal | Sequence[float]") -> Signal:
    return value if isinstance(value, Signal) else constant(value)


def torques(
    torque: "Signal | Sequence[float]",
    force: "Signal | Sequence[float]" = (0.0, 0.0, 0.0),
    initial_angle: Sequence[float] | None = None,
    initial_velocity: Sequence[float] | None = None,
) -> TorqueDrive:
    """Drive by motor torques (N m): numbers hold for the whole run, a `Signal` varies in time."""
    return TorqueDrive(
        torque=_signal(torque),
        force=_signal(force),
        initial_angle=_array(initial_angle),
        initial_velocity=_array(initial_velocity),
    )


def speeds(
    speed: "Signal | Sequence[float]",
    force: "Signal | Sequence[float]" = (0.0, 0.0, 0.0),
    initial_angle: Sequence[float] | None = None,
) -> SpeedDrive:
    """Drive by prescribed wheel speeds (rad/s)."""
    return SpeedDrive(
        speed=_signal(speed), force=_signal(force), initial_angle=_array(initial_angle)
    )


def _array(value):
    return None if value is None else jnp.asarray(value, float)


def check_drive(rig: Rig, drive: AbstractDrive) -> None:
    """`ValueError` where the drive does not fit the rig."""
    signal = drive.torque if isinstance(drive, TorqueDrive) else drive.speed  # pyright: ignore
    if signal.size != rig.size:
        raise ValueError(f"the drive has {signal.size} wheels, but the rig has {rig.size}.")
    if drive.force.size != 3:
        raise ValueError(f"`force` must have 3 components, but has {drive.force.size}.")
