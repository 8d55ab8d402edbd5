"""Rows of designs in bulk, by the modal core."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from ..._status import Status
from ...rig import Rig
from ...simulation import Operating, SpeedDrive, modal_figures, modal_steady
from .drives import Drive, apply
from .evaluation import Evaluation, margin_status


def _operating(rig: Rig, drive: SpeedDrive, paths: tuple[str, ...], values) -> Operating:
    """Rig, speeds, force and start angles of the design with `values` at `paths`."""
    rig, moved = apply(rig, drive, paths, values)
    assert isinstance(moved, SpeedDrive)
    angles = jnp.zeros(rig.size) if moved.initial_angle is None else moved.initial_angle
    return Operating(rig, moved.speed.values[0], moved.force.values[0], angles)


def bulk(
    how: Evaluation, rig: Rig, drive: Drive, paths: tuple[str, ...], rows: np.ndarray,
    gradient: bool, total: int = 0,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:  # fmt: skip
    """Figures (b, m), gradients (b, m, d) or (b, m, 0) and status (b,) of runs or steady states.

    The modal core compiles its programs by itself, for `total` designs in all.
    """
    make, designs = eqx.Partial(_operating, rig, drive, paths), jnp.asarray(rows)
    if how.times is None:
        result = modal_steady(
            make, designs, how.metrics, model=how.model, gradient=gradient, total=total
        )
    else:
        duration = float(how.times[-1])
        result = modal_figures(
            make, designs, how.metrics, duration=duration, step=duration / (len(how.times) - 1),
            model=how.model, gradient=gradient, total=total,
        )  # fmt: skip
    bad = ~np.all(np.isfinite(result.values), axis=1)
    status = np.where(bad, Status.NON_FINITE, margin_status(result.normal, result.slip))
    if how.times is None:  # nothing settles where the sphere drifts off
        bad, status = bad | ~result.held, np.where(result.held, status, Status.UNHELD)
    values = np.where(bad[:, None], np.nan, result.values)
    slopes = np.zeros((*values.shape, 0)) if result.slopes is None else result.slopes
    return values, slopes, status
