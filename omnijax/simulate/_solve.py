"""`simulate`: a rig and a drive in, a trajectory out."""

import dataclasses

import diffrax as dfx
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Float

from ..dynamics import TRANSLATIONS, Model, linear_system
from ..rig import Rig
from ._channels import trajectory
from ._drives import AbstractDrive, TorqueDrive
from ._integrate import SOLVERS, integrate
from ._trajectory import Trajectory

EXPLICIT_RATE = 300.0  # 1/s: above this fastest rate of the linear part the exponential method wins


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
    A = _matrix(model)
    if isinstance(A, Tracer):  # under a transformation the numbers are not known
        return "exponential"
    fastest = np.abs(np.linalg.eigvals(np.asarray(A))).max()
    return "exponential" if fastest > EXPLICIT_RATE else "dopri8"


@eqx.filter_jit
def _matrix(model: Model):
    return linear_system(model.translation).A


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
    traced = any(isinstance(x, Tracer) for x in jax.tree.leaves((rig, drive, ts, rtol)))
    length = len(ts)
    if not traced:  # another length of run shall not mean another program
        ts = jnp.asarray(np.pad(ts, (0, _padded(length) - length), mode="edge"))
    run = _run(built, drive, ts, jnp.asarray(rtol, float), name, max_steps, adjoint)
    return run if traced else _first(run, length)


def _padded(length: int) -> int:
    return max(64, 1 << (length - 1).bit_length())


def _first(run: Trajectory, length: int) -> Trajectory:
    """The first samples of a run."""
    channels = {name: getattr(run, name) for name in (*Trajectory.UNITS,)}
    cut = {name: jnp.asarray(np.asarray(x)[:length]) for name, x in channels.items()}
    return dataclasses.replace(run, **cut)


@eqx.filter_jit
def _run(model: Model, drive, ts, rtol, name, max_steps, adjoint) -> Trajectory:
    states, result, steps = integrate(model, drive, ts, name, rtol, max_steps, adjoint)
    return trajectory(model, drive, ts, states, _status(states, result), steps, name)


def _status(states, result) -> jax.Array:
    code = jnp.where(result == dfx.RESULTS.successful, 0, 3)
    code = jnp.where(result == dfx.RESULTS.max_steps_reached, 2, code)
    finite = jnp.all(jnp.array([jnp.all(jnp.isfinite(x)) for x in jax.tree.leaves(states)]))
    return jnp.where((code != 2) & ~finite, 1, code)


def _check(rig: Rig, drive: AbstractDrive) -> None:
    signal = drive.torque if isinstance(drive, TorqueDrive) else drive.speed  # pyright: ignore
    if signal.size != rig.size:
        raise ValueError(f"the drive has {signal.size} wheels, but the rig has {rig.size}.")
    if drive.force.size != 3:
        raise ValueError(f"`force` must have 3 components, but has {drive.force.size}.")
