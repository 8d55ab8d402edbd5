"""Rows of designs in bulk, by the modal core."""

from collections.abc import Callable

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..._status import Status
from ...rig import Rig
from ...simulation import Operating, SpeedDrive, modal_figures
from ...vibration import long_run_metrics, run_metrics
from .drives import Drive
from .evaluation import Evaluation, margin_status

Machine = Callable[[Float[Array, " d"]], tuple[Rig, Drive]]  # of a row of numbers


def _operating(machine: Machine, row) -> Operating:
    """Rig, speeds, force and start angles of the design of a row."""
    rig, drive = machine(row)
    assert isinstance(drive, SpeedDrive)
    angles = jnp.zeros(rig.size) if drive.initial_angle is None else drive.initial_angle
    return Operating(rig, drive.speed.values[0], drive.force.values[0], angles)


def evaluate_in_bulk(
    how: Evaluation, machine: Machine, rows: np.ndarray, gradient: bool, total: int = 0
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Figures (b, m), gradients (b, m, d) or (b, m, 0) and status (b,) of runs or steady states.

    The modal core compiles its programs by itself, for `total` designs in all.
    """
    make = eqx.Partial(_operating, machine)
    if how.times is None:
        result = long_run_metrics(
            make, rows, how.metrics, model=how.model, gradient=gradient, total=total
        )
    else:
        duration = float(how.times[-1])
        result = (modal_figures if how.gathered else run_metrics)(
            make, rows, how.metrics, duration=duration, step=duration / (len(how.times) - 1),
            model=how.model, gradient=gradient, total=total,
        )  # fmt: skip
    bad = ~np.isfinite(result.values)
    margin = margin_status(result.normal, result.slip)
    status = np.where(bad.any(axis=1), Status.NON_FINITE, margin)
    if how.times is None:  # nothing settles where the sphere drifts off
        bad, status = bad | ~result.held[:, None], np.where(result.held, status, Status.UNHELD)
    values = np.where(bad, np.nan, result.values)
    slopes = np.zeros((*values.shape, 0)) if result.slopes is None else result.slopes
    return values, slopes, status
