"""How one design of a sweep is evaluated: steady state, exact propagation or full simulation."""

from typing import Any, NamedTuple

import diffrax as dfx
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from ..._errors import InputError
from ...rig import Rig
from ...simulation import (
    SpeedDrive,
    Trajectory,
    exact_obstacle,
    propagate,
    simulate,
    simulate_fixed,
)
from ...vibration import STEADY_METRICS, evaluate, metric_problem, steady_metrics
from .._drive import Drive
from .bulk import margin_status, no_bulk
from .store import FAILED

MARGINS = ("lift_off_margin", "slip_margin")
RTOL, MAX_STEPS = 1e-8, 200_000  # of full simulations


class Settings(NamedTuple):
    """What is fixed at compile time: path of evaluation, metrics and numerics."""

    path: str
    metrics: tuple[str, ...]
    model: str
    solver: str
    rtol: float | None
    max_steps: int | None
    gradient: bool


def check_metrics(names: tuple[str, ...]) -> None:
    """`InputError` for a name that is no metric."""
    problems = [problem for name in names if (problem := metric_problem(name))]
    if problems:
        raise InputError(problems)
    if not names:
        raise InputError("a sweep needs at least one metric, as in peak,rms.")
    if len(set(names)) < len(names):
        raise InputError("`metric` names a metric twice.")


def choose_path(
    rig: Rig,
    drive: Drive,
    constant: bool,
    duration: float | None,
    model: str,
    metrics: tuple[str, ...],
) -> tuple[str, str]:
    """(path, why): the cheapest exact way that this rig, drive and these metrics allow."""
    prescribed = isinstance(drive, SpeedDrive)
    reason = exact_obstacle(rig, model) if prescribed else "motor torques drive the wheels"
    if reason is None and not constant:
        reason = "the drive changes in time"
    if duration is not None:
        if reason is None:
            against = no_bulk(rig, drive, model, metrics)
            if against is None:
                return "bulk", "the contacts are linear and decoupled, the speeds are constant"
            return "propagation", f"the model is linear and the speeds are given; {against}"
        return "full", reason
    missing = [name for name in metrics if name not in STEADY_METRICS]
    if reason is None and missing:
        reason = f"the steady state does not give {', '.join(missing)}"
    if reason is not None:
        raise InputError(f"this sweep needs a `duration`: {reason}, so there is no steady state.")
    against = no_bulk(rig, drive, model, metrics, steady=True)
    if against is None:
        return "steady-bulk", "no duration is asked for; the contacts are linear and decoupled"
    return "steady", f"no duration is asked for; {against}"


def figures_of(
    settings: Settings,
    rig: Rig,
    drive: Any,
    ts: Float[Array, " t"] | None,
    substeps: Int[Array, ""] | None = None,
) -> tuple[Float[Array, " m"], Int[Array, ""]]:
    """Metrics and status of one design."""
    if settings.path == "steady":
        return _steady(settings, rig, drive)
    assert ts is not None  # every other path has a duration
    if settings.path == "propagation":
        run = propagate(rig, drive, ts, model=settings.model)
    elif settings.path == "fixed":
        assert substeps is not None
        run = simulate_fixed(rig, drive, ts, settings.model, substeps)
    else:
        adjoint = dfx.ForwardMode() if settings.gradient else None
        run = simulate(
            rig,
            drive,
            ts,
            model=settings.model,
            solver=settings.solver,
            rtol=settings.rtol or RTOL,
            max_steps=settings.max_steps or MAX_STEPS,
            adjoint=adjoint,
        )
    found = evaluate(run, rig, settings.metrics)
    values = jnp.stack([found[name] for name in settings.metrics])
    return _with_status(values, _margins(run))


def _steady(settings: Settings, rig: Rig, drive: SpeedDrive):
    speeds, angles = drive.speed.values[0], drive.initial_angle
    names = tuple(dict.fromkeys((*settings.metrics, *MARGINS)))
    found = steady_metrics(rig, speeds, names, model=settings.model, angles=angles)
    status = margin_status(*(found[name] for name in MARGINS))
    return _with_status(jnp.stack([found[name] for name in settings.metrics]), status)


def _margins(run: Trajectory) -> Int[Array, ""]:
    """The run's own status, else lift-off (a contact without load) or slip at a sample."""
    margin = margin_status(jnp.min(run.normal_force), jnp.min(run.slip_margin))
    return jnp.where(run.status == 0, margin, run.status)


def _with_status(values: Float[Array, " m"], status):
    """Figures of a failed design are NaN; figures that are not finite make a design failed."""
    bad = jnp.any(~jnp.isfinite(values))
    failed = jnp.any(status == jnp.asarray(FAILED))
    status = jnp.where(bad & ~failed, 1, status)
    return jnp.where(failed | bad, jnp.nan, values), status
