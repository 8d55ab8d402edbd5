"""Sweeps by the bulk kernels: RMS and peak of many runs, or steady states, at constant speeds."""

import itertools

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...rig import Rig
from ...simulation import (
    SpeedDrive,
    SteadyPlan,
    bulk_checked,
    bulk_gradients,
    bulk_obstacle,
    plan_bulk,
    plan_steady,
    steady_bulk_obstacle,
    steady_figures,
    steady_gradients,
    steady_margins,
)
from .._drive import Drive
from .._points import LatinHypercube, PointSet
from .._target import apply

METRICS = ("peak", "rms")  # what the kernels give
LIFT_OFF, SLIP = 4, 5
CORNERS, INSIDE = 256, 64  # designs that the kernel's plan is made from


def no_bulk(rig: Rig, drive: Drive, model: str, metrics, steady: bool = False) -> str | None:
    """Why the bulk kernel does not serve these designs, in words; None where it does."""
    if not isinstance(drive, SpeedDrive) or np.any(np.asarray(drive.force.values)):
        return "the bulk kernel takes given speeds and no force"
    others = [name for name in metrics if name not in METRICS]
    if others:
        return f"the bulk kernel does not give {', '.join(others)}"
    return (steady_bulk_obstacle if steady else bulk_obstacle)(rig, model)


def _row(rig: Rig, drive: SpeedDrive, paths: tuple[str, ...], values):
    """Rig, speeds and start angles of the design with `values` at `paths`."""
    rig, moved = apply(rig, drive, paths, values)
    assert isinstance(moved, SpeedDrive)
    angles = jnp.zeros(rig.size) if moved.initial_angle is None else moved.initial_angle
    return rig, moved.speed.values[0], angles


def plan_of(points: PointSet, rig: Rig, drive: Drive, paths, duration, rate, model):
    """How the kernel cuts time so that every design of `points` fits; no duration: steady states.

    What the cut depends on is monotone in each parameter, so the ranges' corners bound it; designs
    inside say what couples.
    """
    ends = [sorted({axis.low, axis.high}) for axis in points.axes]
    corners = list(itertools.islice(itertools.product(*ends), CORNERS))
    inside = LatinHypercube(tuple(points.axes), INSIDE, 0).at(np.arange(INSIDE))
    rows = np.concatenate([np.array(corners), inside])
    make = eqx.Partial(_row, rig, drive, paths)
    if duration is None:
        return plan_steady(make, rows, model)
    return plan_bulk(make, rows, duration, 1 / rate, model)


def bulk_batch(
    rig: Rig,
    drive: Drive,
    paths,
    metrics: tuple[str, ...],
    values: Float[Array, "b d"],
    plan,
    slope,
):
    """Figures (b, m), gradients (b, m, d) or (b, m, 0) and status (b,) of a batch."""
    make, steady = eqx.Partial(_row, rig, drive, paths), isinstance(plan, SteadyPlan)
    if steady:
        figures, margins = steady_figures(make, values, plan), steady_margins(make, values, plan)
    else:
        *figures, normal, slip = bulk_checked(make, values, plan)
        margins = normal, slip
    rms, peak = figures
    found: dict[str, Array] = {"rms": rms, "peak": peak}
    gradients = jnp.zeros((len(values), len(metrics), 0))
    if slope:
        found, slopes = (
            steady_gradients(make, values, plan)
            if steady
            else bulk_gradients(make, values, plan, metrics)
        )
        gradients = jnp.stack([slopes[name] for name in metrics], axis=1)
    chosen = jnp.stack([found[name] for name in metrics], axis=1)
    bad = ~jnp.all(jnp.isfinite(chosen), axis=1)
    status = jnp.where(bad, 1, margin_status(*margins))
    return jnp.where(bad[:, None], jnp.nan, chosen), gradients, status


def margin_status(normal_force, slip_margin):
    """Lift-off where a contact is without load, else slip, from the least of both."""
    return jnp.where(normal_force <= 0, LIFT_OFF, jnp.where(slip_margin < 0, SLIP, 0))
