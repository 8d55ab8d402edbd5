"""The solver's vector: the state in natural units, its start, and its rate under a drive."""

import jax
import jax.numpy as jnp
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float

from ...dynamics import (
    TORQUE_PORTS,
    TRANSLATIONS,
    Coupled,
    ElasticState,
    Inputs,
    Model,
    State,
    check_model,
    initial_memory,
    rest_memory,
    speed_driven,
    torque_driven,
)
from ...rig import Rig
from .._commands import torque_inputs
from .._drives import AbstractDrive, SpeedDrive, TorqueDrive
from .static_start import static_start


def build_model(rig: Rig, model: str = "coupled", keep_radius_rate: bool = False) -> Model:
    """The rig's equations in one variant; `InputError` for an unknown one."""
    check_model(model)
    return Model(TRANSLATIONS[model](rig), keep_radius_rate)


def initial_state(model: Model, drive: AbstractDrive, time) -> State:
    """State at the start (s) of a run: static equilibrium, q = identity, laws' memories at rest."""
    n = model.rig.size
    angle = jnp.zeros(n) if drive.initial_angle is None else drive.initial_angle
    attitude = jnp.array([1.0, 0.0, 0.0, 0.0])
    elastic, memory = static_start(model, angle, attitude)
    omega = jnp.zeros(3)
    if isinstance(drive, TorqueDrive) and drive.initial_velocity is not None:
        omega = drive.initial_velocity
    torque_memory = initial_memory(model.rig, TORQUE_PORTS)
    start = State(
        elastic, angle, omega, attitude, jnp.zeros(3), jnp.zeros(3), memory, torque_memory
    )
    if isinstance(drive, TorqueDrive):  # the drives have settled on the first torque
        inputs = Inputs(drive.torque(time), drive.force(time), jnp.zeros(()))

        def rate(z):
            return torque_driven(model, start._replace(torque_memory=z), inputs).torque_memory

        start = start._replace(torque_memory=rest_memory(rate, torque_memory))
    return start


def state_scale(model: Model) -> State:
    """Natural size of each state, so that one tolerance serves all of them."""
    rig = model.rig
    depth = jnp.maximum(jnp.mean(rig.gaps.depth), 1e-6)
    momentum = depth * jnp.sqrt(jnp.mean(rig.wheels.contact.stiffness) * rig.sphere.mass)
    wheel = depth * jnp.sqrt(jnp.mean(rig.wheels.contact.stiffness) * jnp.mean(rig.wheels.mass))
    rest = initial_state_like(model)
    elastic = rest.elastic._replace(
        approach=depth + rest.elastic.approach,
        mount=depth + rest.elastic.mount,
        momentum=momentum + rest.elastic.momentum,
        wheel_momentum=wheel + rest.elastic.wheel_momentum,
    )
    scale = jax.tree.map(jnp.ones_like, rest)
    memory = jax.tree.map(lambda x: depth + jnp.zeros_like(x), rest.memory)
    scale = scale._replace(elastic=elastic, memory=memory, angular_velocity=0.1 * jnp.ones(3))
    return jax.lax.stop_gradient(scale)


def initial_state_like(model: Model) -> State:
    """A state of zeros with the right shapes."""
    n = model.rig.size
    memory = jax.tree.map(jnp.zeros_like, initial_memory(model.rig))
    torque_memory = jax.tree.map(jnp.zeros_like, initial_memory(model.rig, TORQUE_PORTS))
    elastic, zero = model.translation.rest(), jnp.zeros(3)
    return State(elastic, jnp.zeros(n), zero, jnp.zeros(4), zero, zero, memory, torque_memory)


def vector_field(t, state: State, args) -> State:
    """Right-hand side under a drive; `args` = (model, drive, start time)."""
    model, drive, start = args
    n = model.rig.size
    force, since = drive.force(t), t - start
    if isinstance(drive, SpeedDrive):
        state = state._replace(angle=drive.angle(t, start))
        inputs = Inputs(jnp.zeros(n), force, since)
        return speed_driven(model, state, inputs, drive.speed(t), drive.speed.rate(t))
    return torque_driven(model, state, torque_inputs(model.rig, drive, t, start))


def _offset(model: Model, elastic: ElasticState) -> Float[Array, "3"]:
    """R_l less the centre of mass's path: -(M_s dR + sum m_i Delta_i r_i)/M_T, m.

    The solver's vector holds that path in place of R_l, since its rate is the drift alone: no
    vibration enters it.
    """
    rig = model.rig
    if not isinstance(model.translation, Coupled):
        return jnp.zeros(3)
    moved = rig.sphere.mass * elastic.approach
    return -(moved + rig.wheels.normal.T @ (rig.wheels.mass * elastic.mount)) / rig.total_mass


def pack(model: Model, state: State, scale: Float[Array, " m"] | float) -> Float[Array, " m"]:
    """The solver's vector in units of `scale`: the elastic state first."""
    path = state.position - _offset(model, state.elastic)
    return ravel_pytree(state._replace(position=path))[0] / scale


def unpack(model: Model, scaled: Float[Array, " m"], scale: Float[Array, " m"] | float) -> State:
    """The state that the solver's vector stands for."""
    state = ravel_pytree(initial_state_like(model))[1](scaled * scale)
    return state._replace(position=state.position + _offset(model, state.elastic))


def scaled_field(t, scaled, args):
    model, drive, start, scale = args
    state = unpack(model, scaled, scale)
    rate = vector_field(t, state, (model, drive, start))
    return ravel_pytree(rate._replace(position=state.drift))[0] / scale
