"""One run integrated by diffrax: its solver, its steps, its result."""

from typing import Any

import diffrax as dfx
import jax
import jax.numpy as jnp
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float

from ...dynamics import Model, State, linear_system, rolling_under, wheel_speeds
from .._commands import command_knots
from .._drives import SpeedDrive, TorqueDrive
from .exponential import Exponential, LinearPart
from .state_vector import initial_state, pack, scaled_field, state_scale, unpack
from .steps import EdgeSteps, angle_to_edge, root_mean_square

LONGEST_STEP = 0.1  # s, of the exponential method
SOLVERS: dict[str, Any] = {
    "exponential": Exponential,
    "tsit5": dfx.Tsit5,
    "dopri8": dfx.Dopri8,
    "kvaerno5": dfx.Kvaerno5,
}


def _remainder(t, scaled, args):
    """The vector field without the linear part of the elastic model, a constant matrix."""
    *args, A = args
    m = A.shape[0]
    return scaled_field(t, scaled, args).at[:m].add(-A @ scaled[:m])


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
        omega = state.angular_velocity
        speed = wheel_speeds(rig, rolling_under(rig, angle, omega), omega)
    return jax.vmap(angle_to_edge)(rig.gaps, angle, speed), speed


def integrate(
    model: Model, drive, ts, name, rtol, max_steps, adjoint, begun: State | None = None, origin=None
):
    """States at `ts`, diffrax's result and the number of steps; `ts` may end in repeated times.

    A run that goes on has `begun`, its state at ts[0], and `origin`, the time when it started.
    """
    scale = ravel_pytree(state_scale(model))[0]
    origin = ts[0] if origin is None else origin
    start = pack(model, initial_state(model, drive, ts[0]) if begun is None else begun, scale)
    args: tuple[Any, ...] = (model, drive, origin, scale)
    torques = isinstance(drive, TorqueDrive)
    knots = command_knots(model.rig, drive, origin) if torques else drive.speed.knots
    terms: Any = dfx.ODETerm(scaled_field)
    stops, grid = jnp.concatenate([knots, drive.force.knots]), {}
    if name == "exponential":
        stops = jnp.concatenate([stops, ts])
        spacing = (ts[-1] - ts[0]) / jnp.maximum(jnp.sum(ts[1:] > ts[:-1]), 1)
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
    return states, solution.result, solution.stats["num_steps"]
