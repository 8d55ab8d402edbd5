"""Runs by diffrax: in one go, or in pieces that go on from each other's end."""

from collections.abc import Iterator

import diffrax as dfx
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Float

from ..._errors import InputError
from ..._status import Status
from ...dynamics import Model, State, linear_system
from ...rig import Rig
from .._channels import trajectory
from .._drives import AbstractDrive, check_drive
from .._padding import STEPPED_PIECE, RunPiece, padded, room, samples_of
from .._trajectory import Trajectory
from .defaults import MAX_STEPS, RTOL
from .integrate import SOLVERS, integrate
from .state_vector import build_model, initial_state

EXPLICIT_RATE = 300.0  # 1/s: above this fastest rate of the linear part the exponential method wins


def choose_solver(model: Model, solver: str) -> str:
    """Name of the solver: `auto` takes the exponential one unless the linear part is slow.

    Raises `InputError` for an unknown one.
    """
    if solver != "auto":
        if solver not in SOLVERS:
            allowed = f"{sorted(SOLVERS)}, auto or exact"
            raise InputError(f"`solver` must be one of {allowed}, but is {solver!r}.")
        return solver
    A = _matrix(model)
    if isinstance(A, Tracer):  # under a transformation the numbers are not known
        return "exponential"
    fastest = np.abs(np.linalg.eigvals(np.asarray(A))).max()
    return "exponential" if fastest > EXPLICIT_RATE else "dopri8"


@eqx.filter_jit
def _matrix(model: Model):
    return linear_system(model.translation).A


def solve(
    built: Model,
    drive: AbstractDrive,
    ts: Float[Array, " t"],
    solver: str,
    rtol: float,
    max_steps: int,
    adjoint: dfx.AbstractAdjoint | None,
) -> Trajectory:
    """The whole run; `Trajectory.status` says how it ended."""
    name = choose_solver(built, solver)
    traced = any(isinstance(x, Tracer) for x in jax.tree.leaves((built, drive, ts, rtol)))
    length = len(ts)
    if not traced:  # another length of run shall not mean another program
        ts = padded(ts, room(length))
    run, _ = _run(built, drive, ts, jnp.asarray(rtol, float), name, max_steps, adjoint, None, ts[0])
    return run if traced else samples_of(run, 0, length)


def solve_in_pieces(
    rig: Rig,
    drive: AbstractDrive,
    ts: Float[np.ndarray, " t"],
    *,
    model: str = "coupled",
    solver: str = "auto",
    rtol: float = RTOL,
    max_steps: int = MAX_STEPS,
    samples: int = STEPPED_PIECE,
    begun: State | None = None,
    origin: float | None = None,
) -> Iterator[RunPiece]:
    """The run of `simulate` in pieces of `samples`, each handed out as soon as it is there.

    The pieces' samples together are `ts`.  A run that goes on begins with the state `begun` at
    ts[0], which is not sampled again, and has the start time `origin`.  Ends after a piece that
    failed.
    """
    check_drive(rig, drive)
    built = build_model(rig, model)
    name, times = choose_solver(built, solver), np.asarray(ts, float)
    start = jnp.asarray(times[0] if origin is None else origin)
    done = 0 if begun is None else 1
    begun = eqx.filter_jit(initial_state)(built, drive, times[0]) if begun is None else begun
    while done < len(times):
        last = min(done + samples, len(times))
        part = times[max(done - 1, 0) : last]
        grid = padded(part, room(samples + 1))
        numbers = jnp.asarray(rtol, float)
        run, end = _run(built, drive, grid, numbers, name, max_steps, None, begun, start)
        run = samples_of(run, 0 if done == 0 else 1, len(part))
        yield RunPiece(run, end)
        if not run.ok:
            return
        begun, done = end, last


@eqx.filter_jit
def _run(model: Model, drive, ts, rtol, name, max_steps, adjoint, begun, origin):
    """The run and its last state."""
    states, result, steps = integrate(
        model, drive, ts, name, rtol, max_steps, adjoint, begun, origin
    )
    status = _status(states, result)
    last = jax.tree.map(lambda x: x[-1], states)
    return trajectory(model, drive, ts, states, status, steps, name, origin), last


def _status(states, result) -> jax.Array:
    ok, stopped = result == dfx.RESULTS.successful, result == dfx.RESULTS.max_steps_reached
    code = jnp.where(ok, int(Status.OK), int(Status.FAILED))
    finite = jnp.all(jnp.array([jnp.all(jnp.isfinite(x)) for x in jax.tree.leaves(states)]))
    code = jnp.where(finite, code, int(Status.NON_FINITE))
    return jnp.where(stopped, int(Status.STEP_LIMIT), code)
