"""Rows of designs by the bulk kernels: RMS and peak of many runs, or steady states."""

from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..._status import Status
from ...rig import Rig
from ...simulation import (
    SpeedDrive,
    SteadyPlan,
    bulk_checked,
    bulk_gradients,
    plan_bulk,
    plan_steady,
    steady_figures,
    steady_gradients,
    steady_margins,
)
from .drives import Drive, apply
from .evaluation import Evaluation, margin_status


def _row(rig: Rig, drive: SpeedDrive, paths: tuple[str, ...], values):
    """Rig, speeds and start angles of the design with `values` at `paths`."""
    rig, moved = apply(rig, drive, paths, values)
    assert isinstance(moved, SpeedDrive)
    angles = jnp.zeros(rig.size) if moved.initial_angle is None else moved.initial_angle
    return rig, moved.speed.values[0], angles


def plan_rows(how: Evaluation, rig: Rig, drive: Drive, paths, trial: np.ndarray) -> Any:
    """How the kernel cuts time so that every design of a study fits.

    What the cut depends on is monotone in each parameter, so the corners of the ranges among the
    `trial` designs (t, d) bound it; designs inside say what couples.
    """
    make = eqx.Partial(_row, rig, drive, paths)
    if how.times is None:
        return plan_steady(make, trial, how.model)
    duration = float(how.times[-1])
    return plan_bulk(make, trial, duration, duration / (len(how.times) - 1), how.model)


def bulk_rows(
    how: Evaluation, rig: Rig, drive: Drive, paths, rows: Float[Array, "b d"], plan, gradient: bool
) -> tuple[Array, Array, Array]:
    """Figures (b, m), gradients (b, m, d) or (b, m, 0) and status (b,) of the designs in `rows`."""
    make, steady = eqx.Partial(_row, rig, drive, paths), isinstance(plan, SteadyPlan)
    if steady:
        rms_peak, margins = steady_figures(make, rows, plan), steady_margins(make, rows, plan)
    else:
        *rms_peak, normal, slip = bulk_checked(make, rows, plan)
        margins = normal, slip
    figures: dict[str, Array] = dict(zip(("rms", "peak"), rms_peak, strict=True))
    slopes = jnp.zeros((len(rows), len(how.metrics), 0))
    if gradient:
        figures, by_metric = (
            steady_gradients(make, rows, plan)
            if steady
            else bulk_gradients(make, rows, plan, how.metrics)
        )
        slopes = jnp.stack([by_metric[name] for name in how.metrics], axis=1)
    chosen = jnp.stack([figures[name] for name in how.metrics], axis=1)
    bad = ~jnp.all(jnp.isfinite(chosen), axis=1)
    status = jnp.where(bad, Status.NON_FINITE, margin_status(*margins))
    return jnp.where(bad[:, None], jnp.nan, chosen), slopes, status
