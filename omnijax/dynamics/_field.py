"""The whole vector field: rotation, rolling and translation together (eqs. 39-44)."""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..laws import BodySignal, RollingSignal, RollingTorque, ShaftSignal
from ..rig import Rig, over_wheels, take_wheels
from ._kinematics import (
    Rolling,
    position_input,
    rolling,
    sphere_velocity,
    spin_axes,
    wheel_shape,
    wheel_speeds,
)
from ._rotation import (
    angular_acceleration,
    attitude_rate,
    drive_forces,
    inertia_at,
    rotation_matrix,
)
from ._signals import contact_signals, mount_signals
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


class Passage(NamedTuple):
    """What the wheels show on average over a step, in place of the values at one instant."""

    radius: Float[Array, " n"]  # m, rolling radius
    shape_rate: Float[Array, " n"]  # m/s


class Inputs(NamedTuple):
    """What the drive says at one instant."""

    torque: Float[Array, " n"]  # N m, commanded
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


def initial_memory(rig: Rig) -> tuple[Any, ...]:
    """Rest states of the contact and mount laws, one entry a placed law."""
    return tuple(
        jax.tree.map(lambda z, p=placed: jnp.broadcast_to(z, (len(p.wheels), *jnp.shape(z))), z0)
        for placed in (*rig.at("contact"), *rig.at("mount"))
        for z0 in [placed.law.initial()]
    )


def _with_memory(placed, signals, memory, size):
    """Total of laws that may have memory, and the rates of their memories."""
    total, rates = jnp.zeros(size), []
    for term, state in zip(placed, memory, strict=True):
        index = jnp.asarray(term.wheels)
        here = take_wheels(signals, term.wheels, size)
        total = total.at[index].add(jax.vmap(term.law)(here, state))
        rates.append(jax.vmap(term.law.rate)(here, state))
    return total, tuple(rates)


def port_forces(rig: Rig, translation, motion: Motion, shape_rate, memory):
    """Extra contact and mount tensions, normal forces, and the rates of the laws' memories.

    N_i = N0_i - K delta - C d(delta)/dt - laws; a law at `separation` limits N on both bodies.
    """
    contacts, mounts = rig.at("contact"), rig.at("mount")
    rate = motion.approach_rate - motion.mount_rate - shape_rate
    signals = contact_signals(rig, motion.deflection, rate)
    tension, contact_rates = _with_memory(contacts, signals, memory[: len(contacts)], rig.size)
    mount, mount_rates = _with_memory(
        mounts,
        mount_signals(rig, motion.mount, motion.mount_rate),
        memory[len(contacts) :],
        rig.size,
    )
    wheels = rig.wheels
    linear = translation.tension(motion) - wheels.contact.damping * shape_rate
    normal = wheels.closure.preload - linear - tension
    gained = over_wheels(rig.at("separation"), normal, rig.size)
    return tension - gained, mount, normal + gained, (*contact_rates, *mount_rates)


def _rolling_torques(rig: Rig, axes, normal_force, omega) -> tuple[jax.Array, jax.Array]:
    """Torque that opposes the sphere (3) and torques that oppose the shafts (n)."""
    signals = RollingSignal(
        axes @ omega,
        -rig.wheels.normal @ omega,
        jnp.maximum(normal_force, 0.0),
        rig.wheels.contact.friction,
    )
    zero = RollingTorque(0.0, 0.0, 0.0)  # pyright: ignore[reportArgumentType]
    torque = over_wheels(rig.at("rolling"), signals, rig.size, zero)
    return axes.T @ torque.roll - rig.wheels.normal.T @ torque.spin, torque.shaft


def _body_torque(rig: Rig, rotation, omega) -> Float[Array, "3"]:
    """Torque of gravity on an off-centre mass and of the laws at the sphere, N m."""
    signal = BodySignal(omega, rotation, rig.sphere.mass, rig.platform.gravity)
    weight = rig.sphere.mass * rig.platform.gravity
    torque = jnp.cross(rotation @ rig.sphere.centre_of_mass, weight)
    return sum((placed.law(signal) for placed in rig.at("sphere")), torque)


def _floor(rig: Rig, time) -> Float[Array, "3"]:
    return sum((placed.law(time) for placed in rig.at("platform")), jnp.zeros(3))


def _shape_and_rate(rig: Rig, angle, speed, attitude, omega):
    """rho and its rate along the motion, m and m/s."""
    return jax.jvp(
        lambda a, q: position_input(rig, a, q),
        (angle, attitude),
        (speed, attitude_rate(attitude, omega)),
    )


def _instant(
    model: Model,
    state: State,
    inputs: Inputs,
    geometry: Rolling,
    speed,
    prescribed=None,
    passage: Passage | None = None,
) -> tuple[Instant, tuple[Any, ...]]:
    """Forces and accelerations; `prescribed` = (dOmega/dt, domega/dt) where speeds are given."""
    rig, translation, omega = model.rig, model.translation, state.angular_velocity
    if passage is None:
        shape, shape_rate = _shape_and_rate(rig, state.angle, speed, state.attitude, omega)
    else:
        shape, shape_rate = position_input(rig, state.angle, state.attitude), passage.shape_rate
    motion = translation.motion(state.elastic, shape)
    contact, mount, normal, memory_rates = port_forces(
        rig, translation, motion, shape_rate, state.memory
    )
    rotation = rotation_matrix(state.attitude)
    inertia = inertia_at(rig.sphere.inertia_matrix, rotation)
    resistance, shaft_resistance = _rolling_torques(rig, geometry.axes, normal, omega)
    opposing = jnp.cross(omega, inertia.matrix @ omega) + resistance
    opposing = opposing - _body_torque(rig, rotation, omega)
    wheels, radius = rig.wheels, rig.sphere.radius
    if prescribed is None:
        signals = ShaftSignal(state.angle, speed, inputs.torque)
        torque = inputs.torque + over_wheels(rig.at("shaft"), signals, rig.size) - shaft_resistance
        term = 0.0
        if model.keep_radius_rate:
            term = jax.jvp(lambda a: wheel_shape(rig, a), (state.angle,), (speed,))[1] * speed
        drive = drive_forces(
            geometry.axes,
            geometry.radius,
            radius,
            wheels.inertia,
            inertia.inverse,
            torque,
            opposing,
            term,
        )
        turning = angular_acceleration(geometry.axes, radius, inertia.inverse, drive, opposing)
    else:
        turning, spin_up = prescribed
        needed = (inertia.matrix @ turning + opposing) / radius
        drive = least_squares(geometry.axes.T, needed)
        torque = wheels.inertia * spin_up + geometry.radius * drive
    ports = PortInputs(shape, contact, mount, drive, inputs.force, _floor(rig, inputs.time))
    acceleration = translation.platform_acceleration(state.elastic, ports)
    closure = wheels.closure.preload + wheels.closure.stiffness * motion.approach
    sphere = wheels.normal.T @ (normal - closure) + wheels.drive.T @ drive
    instant = Instant(
        speed,
        shape,
        motion,
        motion.approach_rate - motion.mount_rate - shape_rate,
        normal,
        drive,
        torque,
        turning,
        ports,
        acceleration,
        sphere / rig.sphere.mass,
    )
    return instant, memory_rates


def instant(model: Model, state: State, inputs: Inputs) -> Instant:
    """What acts on the machine at one instant of a torque-driven run."""
    geometry, speed = _speed(model.rig, state)
    return _instant(model, state, inputs, geometry, speed)[0]


def _speed(rig: Rig, state: State) -> tuple[Rolling, jax.Array]:
    geometry = rolling(rig, state.angle)
    return geometry, wheel_speeds(rig, geometry, state.angular_velocity)


def torque_driven(
    model: Model, state: State, inputs: Inputs, passage: Passage | None = None
) -> State:
    """Time derivative of the state under motor torques.

    omega follows Omega by the velocity constraint, theta integrates that omega (spec section 4).
    """
    if passage is None:
        geometry = rolling(model.rig, state.angle)
    else:
        geometry = Rolling(passage.radius, spin_axes(model.rig, state.angle))
    speed = wheel_speeds(model.rig, geometry, state.angular_velocity)
    now, memory_rates = _instant(model, state, inputs, geometry, speed, None, passage)
    return _assemble(model, state, now, memory_rates, now.angular_acceleration)


def _assemble(model, state, now: Instant, memory_rates, turning) -> State:
    return State(
        elastic=model.translation.rate(state.elastic, now.inputs),
        angle=now.speed,
        angular_velocity=turning,
        attitude=attitude_rate(state.attitude, state.angular_velocity),
        position=state.drift + now.motion.platform,
        drift=model.translation.drift_acceleration(now.inputs),
        memory=memory_rates,
    )


def prescribed_instant(model: Model, state: State, inputs: Inputs, speed, acceleration):
    """What acts on the machine when the wheel speeds are given; Omega follows from them."""
    rig = model.rig
    geometry = rolling(rig, state.angle, speed)

    def turned(angle, w):
        return sphere_velocity(rig, rolling(rig, angle, w), w)

    omega, turning = jax.jvp(turned, (state.angle, speed), (speed, acceleration))
    state = state._replace(angular_velocity=omega)
    now, memory_rates = _instant(model, state, inputs, geometry, speed, (turning, acceleration))
    return now, memory_rates, omega


def speed_driven(model: Model, state: State, inputs: Inputs, speed, acceleration) -> State:
    """Time derivative of the state under prescribed wheel speeds (rad/s) and accelerations.

    `state.angle` is the prescribed angle (its rate is zero here: the drive integrates it in closed
    form) and Omega follows from the speeds, so neither is integrated.
    """
    now, memory_rates, omega = prescribed_instant(model, state, inputs, speed, acceleration)
    rate = _assemble(model, state._replace(angular_velocity=omega), now, memory_rates, jnp.zeros(3))
    return rate._replace(angle=jnp.zeros_like(speed))
