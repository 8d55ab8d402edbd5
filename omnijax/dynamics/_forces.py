"""What laws do at their ports, for one moment: tensions, torques, the command's time.

Whoever follows a machine calls these: a solver step by step, the diagnosis for all moments of a run
at once.  Laws come as `Acting` (see `omnijax.rig`), one tuple a port, so that a solver may name
their wheels by indices and a batch of rigs by masks.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float

from ..laws import (
    AbstractLaw,
    ActuatorSignal,
    BodySignal,
    ContactSignal,
    MountSignal,
    RollingSignal,
    RollingTorque,
    ShaftSignal,
    effective_radius,
    in_series,
)
from ..rig import Acting, Placed, Rig, acting, law_output, over_wheels, total_over_wheels

ELASTIC_PORTS = ("contact", "mount")  # whose laws may have memory, in the order of the memories
TORQUE_PORTS = ("actuator", "shaft")
TURNING_PORTS = (*TORQUE_PORTS, "rolling", "sphere")  # whose laws act on the rotation

Laws = Sequence[Acting]
Memory = tuple[Any, ...]


def initial_memory(rig: Rig, ports: Sequence[str] = ELASTIC_PORTS) -> Memory:
    """Rest states of the laws at `ports`, one entry a placed law."""
    return tuple(law.rest(rig.size) for port in ports for law in acting(rig.at(port), rig.size))


def contact_signals(rig: Rig, deflection, rate) -> ContactSignal:
    """Signals of the contacts from delta and its rate, one entry a wheel (last axis)."""
    contact, preload = rig.wheels.contact, rig.wheels.closure.preload
    curvature = jnp.asarray(effective_radius(rig.sphere.radius, rig.wheel_radius))
    return ContactSignal(deflection, rate, contact.stiffness, contact.damping, preload, curvature)


def mount_signals(rig: Rig, deflection, rate) -> MountSignal:
    """Signals of the mounts from Delta and its rate, one entry a wheel (last axis)."""
    mount = rig.wheels.mount
    return MountSignal(deflection, rate, mount.stiffness, mount.damping)


class ContactForces(NamedTuple):
    """What laws make of the contacts at one moment, one entry a wheel."""

    tension: Float[Array, " n"]  # N, beside K delta + C d(delta)/dt
    normal: Float[Array, " n"]  # N
    memory_rates: Memory


def contact_forces(
    contact: Laws, separation: Laws, signals: ContactSignal, memory: Memory
) -> ContactForces:
    """N_i = N0_i - K delta - C d(delta)/dt - laws; laws at `separation` limit N on both bodies."""
    size = len(signals.deflection)
    extra, rates = total_over_wheels(contact, signals, memory, size)
    linear = signals.stiffness * signals.deflection + signals.damping * signals.rate
    normal = signals.preload - linear - extra
    gained = total_over_wheels(separation, normal, (None,) * len(separation), size)[0]
    return ContactForces(extra - gained, normal + gained, rates)


def mount_tensions(mount: Laws, signals: MountSignal, memory: Memory):
    """Tensions (n) in N that laws add at the mounts, and the rates of their memories."""
    return total_over_wheels(mount, signals, memory, len(signals.deflection))


def command_times(placed: Sequence[Placed], time: Float[Array, ""], size: int):
    """Times (n) in s from the run's first sample whose commands act at `time`, never below 0."""
    times = jnp.broadcast_to(time, (size,))
    return jnp.maximum(times + over_wheels(placed, times, size), 0.0)


class RotationMoment(NamedTuple):
    """What laws that act on the rotation feel at one moment."""

    axes: Float[Array, "n 3"]  # driven axes of the sphere
    rotation: Float[Array, "3 3"]  # body frame -> inertial frame
    omega: Float[Array, "3"]  # rad/s, of the sphere
    angle: Float[Array, " n"]  # rad, theta
    speed: Float[Array, " n"]  # rad/s, of the wheels
    command: Float[Array, " n"]  # N m, whose turn it is (see `command_times`)
    delivered: Float[Array, " n"]  # N m, after the actuators so far
    normal_force: Float[Array, " n"]  # N


class Torques(NamedTuple):
    """Torques at one moment."""

    shaft: Float[Array, " n"]  # N m, on the wheels' shafts
    opposing: Float[Array, "3"]  # N m, against the sphere, inertial frame


def combined(weights: Float[Array, " k"], rows: Float[Array, "k m"]) -> Float[Array, " m"]:
    """sum_k weights_k rows_k, written out: so few terms cost less than a call of a library."""
    return sum((weights[k] * rows[k] for k in range(len(rows))), jnp.zeros(rows.shape[1]))


# What one law does at its port: (rig, law, moment, memory) -> (change, rate of the memory).


def actuated(rig: Rig, law: Acting, at: RotationMoment, memory: Any):
    """Change (n) in N m of the delivered torque by one actuator law."""
    signals = ActuatorSignal(at.delivered, at.angle, at.speed)
    return law.total(signals, memory, 0.0, rig.size)


def shaft_torques(rig: Rig, law: Acting, at: RotationMoment, memory: Any):
    """`Torques` of one law at the shafts."""
    signals = ShaftSignal(at.angle, at.speed, at.command, at.delivered)
    torque, rate = law.total(signals, memory, 0.0, rig.size)
    return Torques(torque, jnp.zeros(3)), rate


def rolling_torques(rig: Rig, law: Acting, at: RotationMoment, memory: None = None):
    """`Torques` of one law at the contact patches: it opposes shafts and sphere."""
    normal = rig.wheels.normal
    signals = RollingSignal(
        combined(at.omega, at.axes.T),
        combined(at.omega, -normal.T),
        jnp.maximum(at.normal_force, 0.0),
        rig.wheels.contact.friction,
    )
    zero = RollingTorque(0.0, 0.0, 0.0)  # pyright: ignore[reportArgumentType]
    torque, _ = law.total(signals, None, zero, rig.size)
    opposing = combined(torque.roll, at.axes) - combined(torque.spin, normal)
    return Torques(-torque.shaft, opposing), None


def body_torques(rig: Rig, law: AbstractLaw, at: RotationMoment, memory: None = None):
    """`Torques` of one law at the sphere."""
    signal = BodySignal(at.omega, at.rotation, rig.sphere.mass, rig.platform.gravity)
    return Torques(jnp.zeros(rig.size), -law_output(law, (3,), signal)), None


def free_torques(rig: Rig, law: None, at: RotationMoment, memory: None = None):
    """`Torques` without laws: the delivered ones, Omega x I Omega and gravity off the centre."""
    spin = combined(combined(at.omega, at.rotation), rig.sphere.inertia_matrix.T)
    gyroscopic = jnp.cross(at.omega, combined(spin, at.rotation.T))
    lever = combined(rig.sphere.centre_of_mass, at.rotation.T)
    weight = rig.sphere.mass * rig.platform.gravity
    return Torques(at.delivered, gyroscopic - jnp.cross(lever, weight)), None


class TurningLaws(NamedTuple):
    """The laws that act on the rotation."""

    actuator: Laws
    shaft: Laws
    rolling: Laws
    body: tuple[AbstractLaw, ...]

    @classmethod
    def of(cls, rig: Rig, masked: bool = False) -> "TurningLaws":
        """Those of a rig."""
        return cls(
            actuator=acting(rig.at("actuator"), rig.size, masked),
            shaft=acting(rig.at("shaft"), rig.size, masked),
            rolling=acting(rig.at("rolling"), rig.size, masked),
            body=tuple(placed.law for placed in rig.at("sphere")),
        )

    def rest(self, size: int) -> Memory:
        """Rest states of their memories."""
        return tuple(law.rest(size) for law in (*self.actuator, *self.shaft))


def _at_one_moment(function: Callable[..., Any], *arguments: Any) -> Any:
    return function(*arguments)


def torques(
    rig: Rig,
    laws: TurningLaws,
    at: RotationMoment,
    memory: Memory,
    apply: Callable[..., Any] = _at_one_moment,
) -> tuple[RotationMoment, Torques, Memory]:
    """The moment with what is delivered, torques with all laws, and the memories' rates.

    The actuators' laws act one after the other on the command; everything else adds.  `apply`
    calls a port's function of one law: here for one moment, elsewhere for many.
    """
    count, parts = len(laws.actuator), []

    def change(actuator, delivered):
        law, state = actuator
        return apply(actuated, rig, law, at._replace(delivered=delivered), state)

    actuators = zip(laws.actuator, memory[:count], strict=True)
    delivered, rates = in_series(at.command, actuators, change)
    at, rates = at._replace(delivered=delivered), list(rates)
    for law, state in zip(laws.shaft, memory[count:], strict=True):
        torque, rate = apply(shaft_torques, rig, law, at, state)
        parts.append(torque)
        rates.append(rate)
    parts.append(apply(free_torques, rig, None, at, None)[0])
    parts += [apply(rolling_torques, rig, law, at, None)[0] for law in laws.rolling]
    parts += [apply(body_torques, rig, law, at, None)[0] for law in laws.body]
    return at, jax.tree.map(lambda *x: sum(x), *parts), tuple(rates)


def rest_memory(rate: Any, memory: Any) -> Any:
    """The memory at which `rate(memory)` is zero: one Newton step, exact for linear memories.

    What has a rate that no memory changes (friction that creeps with the turning, at rest) stays.
    """
    flat, unravel = ravel_pytree(memory)
    if not flat.size:
        return memory

    def gap(z):
        return ravel_pytree(rate(unravel(z)))[0]

    slope, left = jax.jacfwd(gap)(flat), gap(flat)
    stays = jnp.all(slope == 0, axis=1)
    slope = jnp.where(stays[:, None], jnp.eye(flat.size), slope)
    return unravel(flat - jnp.linalg.solve(slope, jnp.where(stays, 0.0, left)))
