"""Rows of designs in bulk: runs by the modal core, steady states by their kernel."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..._status import Status
from ...rig import Rig
from ...simulation import (
    Operating,
    SpeedDrive,
    SteadyPlan,
    modal_figures,
    plan_steady,
    steady_figures,
    steady_gradients,
    steady_margins,
)
from .drives import Drive, apply
from .evaluation import Evaluation, margin_status


def _operating(rig: Rig, drive: SpeedDrive, paths: tuple[str, ...], values) -> Operating:
    """Rig, speeds, force and start angles of the design with `values` at `paths`."""
    rig, moved = apply(rig, drive, paths, values)
    assert isinstance(moved, SpeedDrive)
    angles = jnp.zeros(rig.size) if moved.initial_angle is None else moved.initial_angle
    return Operating(rig, moved.speed.values[0], moved.force.values[0], angles)


def _unpushed(rig: Rig, drive: SpeedDrive, paths: tuple[str, ...], values):
    """Rig, speeds and start angles; the kernel of steady states takes no force."""
    point = _operating(rig, drive, paths, values)
    return point.rig, point.speeds, point.angles


def bulk_runs(
    how: Evaluation, rig: Rig, drive: Drive, paths: tuple[str, ...], rows: np.ndarray,
    gradient: bool,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:  # fmt: skip
    """Figures (b, m), gradients (b, m, d) or (b, m, 0) and status (b,) of runs.

    The modal core compiles its programs by itself.
    """
    duration = float(how.times[-1])
    figures = modal_figures(
        eqx.Partial(_operating, rig, drive, paths), jnp.asarray(rows), how.metrics,
        duration=duration, step=duration / (len(how.times) - 1), model=how.model, gradient=gradient,
    )  # fmt: skip
    bad = ~np.all(np.isfinite(figures.values), axis=1)
    status = np.where(bad, Status.NON_FINITE, margin_status(figures.normal, figures.slip))
    values = np.where(bad[:, None], np.nan, figures.values)
    slopes = np.zeros((*values.shape, 0)) if figures.slopes is None else figures.slopes
    return values, slopes, status


def plan_rows(how: Evaluation, rig: Rig, drive: Drive, paths, trial: np.ndarray) -> SteadyPlan:
    """How the kernel of steady states cuts time so that every design of a study fits.

    What the cut depends on is monotone in each parameter, so the corners of the ranges among the
    `trial` designs (t, d) bound it; designs inside say what couples.
    """
    return plan_steady(eqx.Partial(_unpushed, rig, drive, paths), trial, how.model)


def bulk_steady(
    how: Evaluation, rig: Rig, drive: Drive, paths, rows: Float[Array, "b d"], plan, gradient: bool
) -> tuple[Array, Array, Array]:
    """Figures (b, m), gradients (b, m, d) or (b, m, 0) and status (b,) of steady states."""
    make = eqx.Partial(_unpushed, rig, drive, paths)
    margins = steady_margins(make, rows, plan)
    slopes = jnp.zeros((len(rows), len(how.metrics), 0))
    if gradient:
        figures, by_metric = steady_gradients(make, rows, plan)
        slopes = jnp.stack([by_metric[name] for name in how.metrics], axis=1)
    else:
        rms, peak = steady_figures(make, rows, plan)
        figures = {"rms": rms, "peak": peak}
    chosen = jnp.stack([figures[name] for name in how.metrics], axis=1)
    bad = ~jnp.all(jnp.isfinite(chosen), axis=1)
    status = jnp.where(bad, Status.NON_FINITE, margin_status(*margins))
    return jnp.where(bad[:, None], jnp.nan, chosen), slopes, status
