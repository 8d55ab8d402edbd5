"""The whole vector field: rotation, rolling and translation together (eqs. 39-44)."""

import sys
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..rig import Rig, acting, law_output
from ._attitude import attitude_rate, rotation_matrix
from ._forces import (
    RotationMoment,
    TurningLaws,
    contact_forces,
    contact_signals,
    mount_signals,
    mount_tensions,
    torques,
)
from ._kinematics import (
    Rolling,
    position_input,
    rolling,
    rolling_under,
    sphere_velocity,
    spin_axes,
    wheel_shape,
    wheel_speeds,
)
from ._rotation import inertia_at, rotation_under
from ._small import least_squares
from ._translation import AbstractTranslation, ElasticState, Motion, PortInputs


class State(NamedTuple):
    """State of the whole machine."""

    elastic: ElasticState
    angle: Float[Array, " n"]  # rad, theta
    angular_velocity: Float[Array, "3"]  # rad/s, Omega, inertial frame
    attitude: Float[Array, "4"]  # quaternion (w, x, y, z), body -> inertial
    position: Float[Array, "3"]  # m, R_l
    drift: Float[Array, "3"]  # m/s, U, velocity of the centre of mass
    memory: tuple[Any, ...]  # states of contact and mount laws with memory
    torque_memory: tuple[Any, ...] = ()  # states of actuator and shaft laws; (): at rest


class StepAverage(NamedTuple):
    """What the wheels show on average over a step, in place of the values at one instant."""

    radius: Float[Array, " n"]  # m, rolling radius
    shape_rate: Float[Array, " n"]  # m/s
    shape: Float[Array, " n"] | None = None  # m, rho with the sphere's surface; None: the instant's


class Inputs(NamedTuple):
    """What the drive says at one instant."""

    torque: Float[Array, " n"]  # N m, commanded, and now to act
    force: Float[Array, "3"]  # N, P
    time: Float[Array, ""]  # s, from the run's first sample


class Instant(NamedTuple):
    """Everything the model knows at one instant."""

    speed: Float[Array, " n"]  # rad/s, omega
    shape: Float[Array, " n"]  # m, rho
    motion: Motion
    deflection_rate: Float[Array, " n"]  # m/s, with the shape's rate
    normal_force: Float[Array, " n"]  # N
    drive_force: Float[Array, " n"]  # N, f
    shaft_torque: Float[Array, " n"]  # N m, delivered less resistances
    angular_acceleration: Float[Array, "3"]  # rad/s^2
    inputs: PortInputs
    acceleration: Float[Array, "3"]  # m/s^2, platform
    sphere_acceleration: Float[Array, "3"]  # m/s^2, sphere centre


class Model(eqx.Module):
    """One rig with the readings taken: translation variant and the reading of (dr_w/dt) omega."""

    translation: AbstractTranslation
    keep_radius_rate: bool = eqx.field(static=True, default=False)

    @property
    def rig(self) -> Rig:
        """The machine."""
        return self.translation.rig


def port_forces(rig: Rig, motion: Motion, shape_rate, memory):
    """Extra contact and mount tensions, normal forces, and the rates of the laws' memories."""
    contact, separation, mount = (
        acting(rig.at(port), rig.size) for port in ("contact", "separation", "mount")
    )
    rate = motion.approach_rate - motion.mount_rate - shape_rate
    signals = contact_signals(rig, motion.deflection, rate)
    forces = contact_forces(contact, separation, signals, memory[: len(contact)])
    signals = mount_signals(rig, motion.mount, motion.mount_rate)
    tension, rates = mount_tensions(mount, signals, memory[len(contact) :])
    return forces.tension, tension, forces.normal, (*forces.memory_rates, *rates)


def floor(rig: Rig, time) -> Float[Array, "3"]:
    """Acceleration (3) in m/s^2 that the laws at the platform add, `time` s into the run."""
    laws = (placed.law for placed in rig.at("platform"))
    return sum((law_output(law, (3,), time) for law in laws), jnp.zeros(3))


_AHEAD = 8 * sys.float_info.epsilon  # of an angle and a radian: more than they are rounded by


def _onward(state: State, speed) -> State:
    """The state with each wheel's angle a rounding ahead on its way.

    A shape's slope jumps at the edges of a gap: at an edge it is that of the side the wheel turns
    to.
    """
    ahead = _AHEAD * jnp.sign(speed) * (1 + jnp.abs(state.angle))
    return state._replace(angle=state.angle + jax.lax.stop_gradient(ahead))


def _shape_and_rate(rig: Rig, angle, speed, attitude, omega):
    """rho and its rate along the motion, m and m/s."""
    return jax.jvp(
        lambda a, q: position_input(rig, a, q),
        (angle, attitude),
        (speed, attitude_rate(attitude, omega)),
    )


class Turning(NamedTuple):
    """Drive forces and accelerations of the rotation at one instant."""

    drive: Float[Array, " n"]  # N, f
    acceleration: Float[Array, "3"]  # rad/s^2
    shaft_torque: Float[Array, " n"]  # N m
    memory_rates: tuple[Any, ...]


def _turning_under_torques(
    model: Model, state: State, inputs: Inputs, geometry: Rolling, speed, normal
):
    """The rotation under motor torques (eqs. 39, 40, 46)."""
    rig = model.rig
    rotation = rotation_matrix(state.attitude)
    at = RotationMoment(
        geometry.axes, rotation, state.angular_velocity, state.angle, speed,
        inputs.torque, inputs.torque, normal,
    )  # fmt: skip
    laws, memory = TurningLaws.of(rig), state.torque_memory
    _, caused, rates = torques(rig, laws, at, memory or laws.rest(rig.size))
    term = 0.0
    if model.keep_radius_rate:
        term = jax.jvp(lambda a: wheel_shape(rig, a), (state.angle,), (speed,))[1] * speed
    inertia = inertia_at(rig.sphere.inertia_matrix, rotation)
    turned = rotation_under(rig, geometry, inertia, caused, term)
    return Turning(*turned, caused.shaft, rates if memory else ())


def _turning_as_prescribed(
    model: Model, state: State, inputs: Inputs, geometry: Rolling, speed, normal, given
):
    """The rotation where speeds are prescribed: `given` = (dOmega/dt, domega/dt)."""
    rig, (acceleration, spin_up) = model.rig, given
    rotation = rotation_matrix(state.attitude)
    zero = jnp.zeros(rig.size)
    at = RotationMoment(
        geometry.axes, rotation, state.angular_velocity, state.angle, speed, zero, zero, normal
    )
    laws = TurningLaws.of(rig)._replace(actuator=(), shaft=())
    opposing = torques(rig, laws, at, ())[1].opposing
    inertia = inertia_at(rig.sphere.inertia_matrix, rotation)
    needed = (inertia @ acceleration + opposing) / rig.sphere.radius
    drive = least_squares(geometry.axes.T, needed)
    torque = rig.wheels.inertia * spin_up + geometry.radius * drive
    rest = jax.tree.map(jnp.zeros_like, state.torque_memory)
    return Turning(drive, acceleration, torque, rest)


def _instant(
    model: Model,
    state: State,
    inputs: Inputs,
    geometry: Rolling,
    speed,
    prescribed=None,
    passage: StepAverage | None = None,
) -> tuple[Instant, tuple[Any, ...], tuple[Any, ...]]:
    """Forces, accelerations, and the rates of the elastic and of the torques' memories.

    `prescribed` = (dOmega/dt, domega/dt) where speeds are given.
    """
    rig, translation, omega = model.rig, model.translation, state.angular_velocity
    state = _onward(state, speed)
    if passage is None:
        shape, shape_rate = _shape_and_rate(rig, state.angle, speed, state.attitude, omega)
    else:
        shape, shape_rate = passage.shape, passage.shape_rate
        if shape is None:
            shape = position_input(rig, state.angle, state.attitude)
    motion = translation.motion(state.elastic, shape)
    contact, mount, normal, rates = port_forces(rig, motion, shape_rate, state.memory)
    if prescribed is None:
        turning = _turning_under_torques(model, state, inputs, geometry, speed, normal)
    else:
        turning = _turning_as_prescribed(model, state, inputs, geometry, speed, normal, prescribed)
    ports = PortInputs(shape, contact, mount, turning.drive, inputs.force, floor(rig, inputs.time))
    closure = rig.wheels.closure.preload + rig.wheels.closure.stiffness * motion.approach
    sphere = rig.wheels.normal.T @ (normal - closure) + rig.wheels.drive.T @ turning.drive
    now = Instant(
        speed,
        shape,
        motion,
        motion.approach_rate - motion.mount_rate - shape_rate,
        normal,
        turning.drive,
        turning.shaft_torque,
        turning.acceleration,
        ports,
        translation.platform_acceleration(state.elastic, ports),
        sphere / rig.sphere.mass,
    )
    return now, rates, turning.memory_rates


_INVERTED, _FLAT = 8, 0.1  # Newton's steps; below this slope the shaft hardly feels the command


def motor_torque(
    rig: Rig, now: "Instant", angle, omega, attitude: Float[Array, "4"]
) -> Float[Array, " n"]:
    """Commands (n) in N m under which the shafts feel what they do at an instant.

    The laws at actuators, shafts and contact patches, taken back for one moment by Newton's method;
    those with memory, and delays of the command, are left out.  Beyond a motor's limit it is what
    the motor lacks, added once a step.
    """
    every = TurningLaws.of(rig)
    laws = every._replace(
        actuator=_forgetful(rig, every.actuator), shaft=_forgetful(rig, every.shaft)
    )
    if not (laws.actuator or laws.shaft or laws.rolling):
        return now.shaft_torque
    axes, rotation = spin_axes(rig, angle), rotation_matrix(attitude)

    def on_shafts(command):
        at = RotationMoment(
            axes, rotation, omega, angle, now.speed, command, command, now.normal_force
        )
        return torques(rig, laws, at, laws.rest(rig.size))[1].shaft

    def closer(command, _):
        felt, slope = jax.jvp(on_shafts, (command,), (jnp.ones(rig.size),))
        slope = jnp.where(slope > _FLAT, slope, 1.0)
        return command + (now.shaft_torque - felt) / slope, None

    return jax.lax.scan(closer, now.shaft_torque, length=_INVERTED)[0]


def _forgetful(rig: Rig, laws):
    """The laws without memory."""
    return tuple(law for law in laws if not jax.tree.leaves(law.rest(rig.size)))


def instant(model: Model, state: State, inputs: Inputs) -> Instant:
    """What acts on the machine at one instant of a torque-driven run."""
    geometry = rolling_under(model.rig, state.angle, state.angular_velocity)
    speed = wheel_speeds(model.rig, geometry, state.angular_velocity)
    return _instant(model, state, inputs, geometry, speed)[0]


def torque_driven(
    model: Model, state: State, inputs: Inputs, passage: StepAverage | None = None
) -> State:
    """Time derivative of the state under motor torques.

    omega follows Omega by the velocity constraint, theta integrates that omega (spec section 4).
    """
    if passage is None:
        geometry = rolling_under(model.rig, state.angle, state.angular_velocity)
    else:
        geometry = Rolling(passage.radius, spin_axes(model.rig, state.angle))
    speed = wheel_speeds(model.rig, geometry, state.angular_velocity)
    now, *rates = _instant(model, state, inputs, geometry, speed, None, passage)
    return _assemble(model, state, now, rates, now.angular_acceleration)


def _assemble(model, state, now: Instant, rates, turning) -> State:
    return State(
        elastic=model.translation.rate(state.elastic, now.inputs),
        angle=now.speed,
        angular_velocity=turning,
        attitude=attitude_rate(state.attitude, state.angular_velocity),
        position=state.drift + now.motion.platform,
        drift=model.translation.drift_acceleration(now.inputs),
        memory=rates[0],
        torque_memory=rates[1],
    )


def prescribed_instant(model: Model, state: State, inputs: Inputs, speed, acceleration):
    """What acts on the machine when the wheel speeds are given; Omega follows from them."""
    rig, angle = model.rig, _onward(state, speed).angle
    geometry = rolling(rig, angle, speed)

    def turned(angle, w):
        return sphere_velocity(rig, rolling(rig, angle, w), w)

    omega, turning = jax.jvp(turned, (angle, speed), (speed, acceleration))
    state = state._replace(angular_velocity=omega)
    now, *rates = _instant(model, state, inputs, geometry, speed, (turning, acceleration))
    return now, rates, omega


def speed_driven(model: Model, state: State, inputs: Inputs, speed, acceleration) -> State:
    """Time derivative of the state under prescribed wheel speeds (rad/s) and accelerations.

    `state.angle` is the prescribed angle (its rate is zero here: the drive integrates it in closed
    form) and Omega follows from the speeds, so neither is integrated.
    """
    now, rates, omega = prescribed_instant(model, state, inputs, speed, acceleration)
    rate = _assemble(model, state._replace(angular_velocity=omega), now, rates, jnp.zeros(3))
    return rate._replace(angle=jnp.zeros_like(speed))
