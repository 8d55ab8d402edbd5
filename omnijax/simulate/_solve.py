"""`simulate`: a rig and a drive in, a trajectory out."""

from typing import Any

import diffrax as dfx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float

from ..dynamics import (
    TRANSLATIONS,
    Coupled,
    ElasticState,
    Inputs,
    Model,
    State,
    initial_memory,
    instant,
    linear_system,
    prescribed_instant,
    rolling,
    speed_driven,
    torque_driven,
    wheel_speeds,
)
from ..rig import Rig
from ._drives import AbstractDrive, SpeedDrive, TorqueDrive
from ._exponential import Exponential, LinearPart
from ._start import static_start
from ._steps import EdgeSteps, angle_to_edge, root_mean_square
from ._trajectory import Trajectory

EXPLICIT_RATE = 300.0  # 1/s: above this fastest rate of the linear part the exponential method wins
LONGEST_STEP = 0.1  # s, of the exponential method
SOLVERS: dict[str, Any] = {
    "exponential": Exponential,
    "tsit5": dfx.Tsit5,
    "dopri8": dfx.Dopri8,
    "kvaerno5": dfx.Kvaerno5,
}


def build_model(rig: Rig, model: str = "coupled", keep_radius_rate: bool = False) -> Model:
    """The rig's equations in one variant; `ValueError` for an unknown one."""
    if model not in TRANSLATIONS:
        raise ValueError(f"`model` must be one of {sorted(TRANSLATIONS)}, but is {model!r}.")
    return Model(TRANSLATIONS[model](rig), keep_radius_rate)


def choose_solver(model: Model, solver: str) -> str:
    """Name of the solver: `auto` takes the exponential one unless the linear part is slow."""
    if solver != "auto":
        if solver not in SOLVERS:
            raise ValueError(
                f"`solver` must be one of {sorted(SOLVERS)} or auto, but is {solver!r}."
            )
        return solver
    A = linear_system(model.translation).A
    if isinstance(A, Tracer):  # under a transformation the numbers are not known
        return "exponential"
    fastest = np.abs(np.linalg.eigvals(np.asarray(A))).max()
    return "exponential" if fastest > EXPLICIT_RATE else "dopri8"


def simulate(
    rig: Rig,
    drive: AbstractDrive,
    ts: Float[Array, " t"],
    *,
    model: str = "coupled",
    solver: str = "auto",
    rtol: float = 1e-8,
    max_steps: int = 200_000,
    keep_radius_rate: bool = False,
    adjoint: dfx.AbstractAdjoint | None = None,
) -> Trajectory:
    """Simulate `rig` under `drive`; samples at `ts` (s, increasing; the run starts at `ts[0]`).

    Starts at static equilibrium, q = identity.  `model` is `coupled` or `paper`, `solver` one of
    `SOLVERS` or `auto`, `rtol` the relative tolerance per step (absolute: the same in units of the
    gap's depth), `adjoint` diffrax's way to differentiate.  Never raises for a failed run: see
    `Trajectory.status`.
    """
    ts = jnp.asarray(ts, float)
    _check(rig, drive)
    built = build_model(rig, model, keep_radius_rate)
    name = choose_solver(built, solver)
    return _solve(built, drive, ts, name, rtol, max_steps, adjoint)


def _check(rig: Rig, drive: AbstractDrive) -> None:
    signal = drive.torque if isinstance(drive, TorqueDrive) else drive.speed  # pyright: ignore
    if signal.size != rig.size:
        raise ValueError(f"the drive has {signal.size} wheels, but the rig has {rig.size}.")
    if drive.force.size != 3:
        raise ValueError(f"`force` must have 3 components, but has {drive.force.size}.")


def initial_state(model: Model, drive: AbstractDrive) -> State:
    """State at the start of a run: static equilibrium, q = identity."""
    n = model.rig.size
    angle = jnp.zeros(n) if drive.initial_angle is None else drive.initial_angle
    attitude = jnp.array([1.0, 0.0, 0.0, 0.0])
    elastic, memory = static_start(model, angle, attitude)
    omega = jnp.zeros(3)
    if isinstance(drive, TorqueDrive) and drive.initial_velocity is not None:
        omega = drive.initial_velocity
    return State(elastic, angle, omega, attitude, jnp.zeros(3), jnp.zeros(3), memory)


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
    elastic = model.translation.rest()
    return State(
        elastic, jnp.zeros(n), jnp.zeros(3), jnp.zeros(4), jnp.zeros(3), jnp.zeros(3), memory
    )


def vector_field(t, state: State, args) -> State:
    """Right-hand side under a drive; `args` = (model, drive, start time)."""
    model, drive, start = args
    n = model.rig.size
    force, since = drive.force(t), t - start
    if isinstance(drive, SpeedDrive):
        state = state._replace(angle=drive.angle(t, start))
        inputs = Inputs(jnp.zeros(n), force, since)
        return speed_driven(model, state, inputs, drive.speed(t), drive.speed.rate(t))
    return torque_driven(model, state, Inputs(drive.torque(t), force, since))


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


def pack(model: Model, state: State, scale: Float[Array, " m"]) -> Float[Array, " m"]:
    """The solver's vector, in natural units: the elastic state first."""
    path = state.position - _offset(model, state.elastic)
    return ravel_pytree(state._replace(position=path))[0] / scale


def unpack(model: Model, scaled: Float[Array, " m"], scale: Float[Array, " m"]) -> State:
    """The state that the solver's vector stands for."""
    state = ravel_pytree(initial_state_like(model))[1](scaled * scale)
    return state._replace(position=state.position + _offset(model, state.elastic))


def _scaled_field(t, scaled, args):
    model, drive, start, scale = args
    state = unpack(model, scaled, scale)
    rate = vector_field(t, state, (model, drive, start))
    return ravel_pytree(rate._replace(position=state.drift))[0] / scale


def _remainder(t, scaled, args):
    """The vector field without the linear part of the elastic model, a constant matrix."""
    *args, A = args
    m = A.shape[0]
    return _scaled_field(t, scaled, args).at[:m].add(-A @ scaled[:m])


def _scaled_matrix(model: Model, scale) -> Float[Array, "m m"]:
    A = linear_system(model.translation).A
    elastic = scale[: A.shape[0]]
    return A * elastic / elastic[:, None]


def _edges(t, scaled, args):
    model, drive, start, scale, *_ = args
    rig = model.rig
    if isinstance(drive, SpeedDrive):
        angle, speed = drive.angle(t, start), drive.speed(t)
    else:
        state = unpack(model, scaled, scale)
        angle = state.angle
        speed = wheel_speeds(rig, rolling(rig, angle), state.angular_velocity)
    return jax.vmap(angle_to_edge)(rig.gaps, angle, speed), speed


def _solve(model: Model, drive, ts, name, rtol, max_steps, adjoint) -> Trajectory:
    scale = ravel_pytree(state_scale(model))[0]
    start = pack(model, initial_state(model, drive), scale)
    args: tuple[Any, ...] = (model, drive, ts[0], scale)
    signal = drive.torque if isinstance(drive, TorqueDrive) else drive.speed
    terms: Any = dfx.ODETerm(_scaled_field)
    stops, grid = jnp.concatenate([signal.knots, drive.force.knots]), {}
    if name == "exponential":
        stops = jnp.concatenate([stops, ts])
        spacing = (ts[-1] - ts[0]) / max(len(ts) - 1, 1)
        halvings = jnp.floor(jnp.log2(LONGEST_STEP / jnp.where(spacing > 0, spacing, 1.0)))
        linear = LinearPart.of(_scaled_matrix(model, scale), spacing * 2.0**halvings)
        terms, args = dfx.MultiTerm(linear, dfx.ODETerm(_remainder)), (*args, linear.A)
        grid = {"coarsest": linear.coarsest, "finest": linear.finest}
    solution = dfx.diffeqsolve(
        terms,
        SOLVERS[name](),
        ts[0],
        ts[-1],
        None,
        start,
        args,
        saveat=dfx.SaveAt(ts=ts),
        stepsize_controller=EdgeSteps(
            rtol, rtol, root_mean_square, _edges, jnp.sort(stops), **grid
        ),
        adjoint=dfx.RecursiveCheckpointAdjoint() if adjoint is None else adjoint,
        max_steps=max_steps,
        throw=False,
    )
    states = jax.vmap(lambda y: unpack(model, y, scale))(solution.ys)
    return trajectory(
        model, drive, ts, states, _status(solution), solution.stats["num_steps"], name
    )


def _status(solution) -> jax.Array:
    code = jnp.where(solution.result == dfx.RESULTS.successful, 0, 3)
    code = jnp.where(solution.result == dfx.RESULTS.max_steps_reached, 2, code)
    finite = jnp.all(jnp.isfinite(solution.ys))
    return jnp.where((code != 2) & ~finite, 1, code)


def trajectory(model: Model, drive, ts, states: State, status, steps, method) -> Trajectory:
    """Every channel of a run from its states."""

    def channels(t, state):
        return sample(model, drive, ts[0], t, state)

    values = jax.vmap(channels)(ts, states)
    return Trajectory(
        t=ts, **values, status=status, steps=steps, method=method, names=model.rig.names
    )


def sample(model: Model, drive, start, t, state: State) -> dict[str, jax.Array]:
    """Every channel at one instant."""
    rig, force, since = model.rig, drive.force(t), t - start
    n = rig.size
    if isinstance(drive, SpeedDrive):
        state = state._replace(angle=drive.angle(t, start))
        inputs = Inputs(jnp.zeros(n), force, since)
        now, _, omega = prescribed_instant(
            model, state, inputs, drive.speed(t), drive.speed.rate(t)
        )
        command = now.shaft_torque
    else:
        command, omega = drive.torque(t), state.angular_velocity
        now = instant(model, state, Inputs(command, force, since))
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
