"""Designs as rows of numbers, a batch at a time, spread over the local devices."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import AxisType, PartitionSpec

from ..._compiling import Effort
from ..._errors import InputError
from ..._programs import kept
from ...rig import Rig
from .._batches import each, in_batches
from .bulk import evaluate_in_bulk
from .drives import Drive, apply, with_few_knots
from .evaluation import Evaluation
from .methods import BULK

MANY = 1000  # designs in fixed steps from which the best code repays its compiler's second


class Rows:
    """Figures, gradients and status of the designs with a row's numbers at `paths`.

    One compiled program serves all batches of a shape; the numbers of rig and drive, the samples'
    times and the substeps are its operands.  `total` designs are asked for in all, where more than
    are known here.
    """

    def __init__(
        self, how: Evaluation, rig: Rig, drive: Drive, paths: tuple[str, ...],
        gradient: bool = False, devices: int = 1, total: int = 0,
    ):  # fmt: skip
        if devices > jax.local_device_count():
            raise InputError(
                f"`devices` must lie in [1, {jax.local_device_count()}], but is {devices}."
            )
        self.paths, self.gradient, self.devices, self.total = paths, gradient, devices, total
        self._arrays, self._static = eqx.partition((rig, with_few_knots(drive)), eqx.is_array)
        times = None if how.times is None else jnp.asarray(how.times)
        self._operands = times, jnp.asarray(how.substeps)
        self.how, self._whole = how._replace(times=None, substeps=None), how

    def all(self, rows: np.ndarray, size: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Figures, gradients and status of all `rows`, `size` of them at a time."""
        if self.how.method in BULK:  # cuts the rows into batches by itself, on one device
            rig, drive = eqx.combine(self._arrays, self._static)
            machine = eqx.Partial(apply, rig, drive, self.paths)
            return evaluate_in_bulk(self._whole, machine, rows, self.gradient, self.total)
        return in_batches(self, rows, size)

    def __call__(self, rows: np.ndarray) -> tuple[Any, Any, Any]:
        """Figures (b, m), gradients (b, m, d) (or (b, m, 0)) and status (b,) of `rows` (b, d)."""
        many = self.how.method == "fixed" and max(self.total, len(rows)) >= MANY
        return _evaluate_kept(
            self._arrays, self._operands, jnp.asarray(rows), self._static, self.how, self.paths,
            self.gradient, self.devices, effort=Effort.MOST if many else Effort.QUICK,
        )  # fmt: skip


def _evaluate(arrays, operands, rows, static, how: Evaluation, paths, gradient, devices):
    def batch(arrays, operands, rows):
        rig, drive = eqx.combine(arrays, static)
        times, substeps = operands
        whole = how._replace(times=times, substeps=substeps)

        def one(x):
            figures, status = whole(*apply(rig, drive, paths, x))
            return figures, (figures, status)

        if gradient:
            slopes, (figures, status) = each(jax.jacfwd(one, has_aux=True), [rows], how.order)
            return figures, slopes, status
        figures, status = each(lambda x: one(x)[1], [rows], how.order)
        return figures, jnp.zeros((*figures.shape, 0)), status

    if devices == 1:
        return batch(arrays, operands, rows)
    mesh = jax.make_mesh((devices,), ("design",), axis_types=(AxisType.Auto,))
    whole, split = PartitionSpec(), PartitionSpec("design")
    spread = jax.shard_map(
        batch, mesh=mesh, in_specs=(whole, whole, split), out_specs=split, check_vma=False
    )
    return spread(arrays, operands, rows)


_evaluate_kept = kept(_evaluate)
