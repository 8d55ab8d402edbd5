"""The ports: where laws act, and the signal that each port hands to its laws.

A signal is what one wheel (or the sphere, or the platform) feels; `vmap` over wheels is outside.
"""

from typing import ClassVar, NamedTuple

from jaxtyping import Array, Float

from ._base import AbstractLaw


class ContactSignal(NamedTuple):
    """What one sphere-wheel contact feels.  Extension is positive."""

    deflection: Float[Array, ""]  # m, delta
    rate: Float[Array, ""]  # m/s, with the rate of the wheel's shape
    stiffness: Float[Array, ""]  # N/m, K of the linear law
    damping: Float[Array, ""]  # N s/m
    preload: Float[Array, ""]  # N, N0
    curvature_radius: Float[Array, ""]  # m, R' of eq. 17


class MountSignal(NamedTuple):
    """What one wheel-platform mount feels.  Extension is positive."""

    deflection: Float[Array, ""]  # m, Delta
    rate: Float[Array, ""]  # m/s
    stiffness: Float[Array, ""]  # N/m, k of the linear law
    damping: Float[Array, ""]  # N s/m


class ShaftSignal(NamedTuple):
    """What one wheel's shaft feels."""

    angle: Float[Array, ""]  # rad, theta
    speed: Float[Array, ""]  # rad/s, omega
    command: Float[Array, ""]  # N m, commanded motor torque
    load: Float[Array, ""] | float = 0.0  # N m, what the gear passes on: the delivered torque


class ActuatorSignal(NamedTuple):
    """What one wheel's actuator law feels."""

    torque: Float[Array, ""]  # N m, commanded, after the actuator laws before this one
    angle: Float[Array, ""]  # rad, theta
    speed: Float[Array, ""]  # rad/s, omega


class RollingSignal(NamedTuple):
    """What one contact patch feels as the sphere turns under it."""

    roll: Float[Array, ""]  # rad/s, spin_axis . Omega
    spin: Float[Array, ""]  # rad/s, contact direction . Omega
    normal_force: Float[Array, ""]  # N, never below 0
    friction: Float[Array, ""]  # dry friction coefficient


class RollingTorque(NamedTuple):
    """Torques that oppose the sphere about a wheel's two axes, and the one on its shaft."""

    roll: Float[Array, ""]  # N m, opposes the turn about spin_axis
    spin: Float[Array, ""]  # N m, opposes the turn about the contact's normal
    shaft: Float[Array, ""]  # N m, opposes the shaft


class BodySignal(NamedTuple):
    """What the sphere feels as a body."""

    angular_velocity: Float[Array, "3"]  # rad/s, inertial frame
    rotation: Float[Array, "3 3"]  # body frame -> inertial frame
    mass: Float[Array, ""]  # kg
    gravity: Float[Array, "3"]  # m/s^2


class SensorSignal(NamedTuple):
    """One output group before the sensor: rows are samples, columns its channels."""

    time: Float[Array, " t"]  # s, from the run's first sample
    values: Float[Array, "t c"]


class AbstractShape(AbstractLaw):
    """Wheel shape: (wheel angle rad, `Gap`) -> rho in m, the change of the wheel's radius."""

    port: ClassVar[str] = "shape"


class AbstractSurface(AbstractLaw):
    """Sphere surface: unit vector to the contact in the body frame -> m; position input only."""

    port: ClassVar[str] = "surface"


class AbstractContact(AbstractLaw):
    """Contact: `ContactSignal` -> additional tension in N beside K delta + C d(delta)/dt.

    A law is `linear` whose tension and rate of memory are sums of deflection, rate and memory, each
    times a factor that hangs on numbers of law and rig alone.  Closed forms take it.
    """

    port: ClassVar[str] = "contact"
    linear: ClassVar[bool] = False


class AbstractSeparation(AbstractLaw):
    """Contact limit: normal force in N -> the change of it in N."""

    port: ClassVar[str] = "separation"


class AbstractMount(AbstractLaw):
    """Mount: `MountSignal` -> additional tension in N beside k Delta + c d(Delta)/dt.

    `linear` says of a law what it says at the port `contact`.
    """

    port: ClassVar[str] = "mount"
    linear: ClassVar[bool] = False


class AbstractRadius(AbstractLaw):
    """Wheel size: wheel radius in m -> the change of it in m, wherever the radius enters."""

    port: ClassVar[str] = "radius"


class AbstractCommand(AbstractLaw):
    """Command: time in s from the run's first sample -> change of the time whose command acts."""

    port: ClassVar[str] = "command"


class AbstractActuator(AbstractLaw):
    """Actuator: `ActuatorSignal` -> change of the delivered torque in N m.

    Laws of this port act one after the other, each on what the former left.
    """

    port: ClassVar[str] = "actuator"


class AbstractShaft(AbstractLaw):
    """Wheel shaft: `ShaftSignal` -> additional torque on the shaft in N m."""

    port: ClassVar[str] = "shaft"


class AbstractRolling(AbstractLaw):
    """Contact patch: `RollingSignal` -> `RollingTorque` in N m."""

    port: ClassVar[str] = "rolling"


class AbstractBody(AbstractLaw):
    """Sphere: `BodySignal` -> torque on it, inertial frame, N m."""

    port: ClassVar[str] = "sphere"


class AbstractPlatform(AbstractLaw):
    """Platform: time in s from the run's first sample -> acceleration, inertial frame, m/s^2."""

    port: ClassVar[str] = "platform"


class AbstractKinematics(AbstractLaw):
    """Rolling kinematics: wheel speed in rad/s -> change of the factor R Omega / (r_w omega).

    Omega is that about the wheel's spin axis; a wheel that slips back has a negative change.
    """

    port: ClassVar[str] = "kinematics"


class AbstractSensor(AbstractLaw):
    """Sensor: `SensorSignal` -> change of the measured values, (samples, channels).

    One that `remembers` shows what was before; the change of a `momentary` one hangs on the values
    of its moment alone, neither on the time nor on other moments.
    """

    port: ClassVar[str] = "sensor"
    remembers: ClassVar[bool] = False
    momentary: ClassVar[bool] = False
