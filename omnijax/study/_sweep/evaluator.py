"""Evaluation of designs in batches of one fixed shape, over the local devices."""

import tomllib

import numpy as np

from ..._memory import available
from ..._status import FAILED, Status
from ...rig import Rig, parse_rig
from ...simulation import pieces_traced
from ...vibration import METRICS
from .._evaluation import (
    BULK,
    MAX_STEPS,
    RTOL,
    Drive,
    Evaluation,
    Rows,
    drive_from_plain,
    samples_of,
)
from .spec import SweepSpec
from .store import StoredQuantity

# designs at a time where memory allows
BATCH = {
    "steady": 64,
    "bulk": 2048,
    "steady-bulk": 2048,
    "propagation": 32,
    "fixed": 256,
    "full": 32,
}
BATCHES_A_CHUNK = 8
CHANNELS = 75  # numbers kept a sample of a run
BYTES_A_PIECE = 1e6  # of a closed form and direction, as compiled programs state it: 0.6 to 0.9 MB
SHARE_OF_MEMORY = 0.25


def batch_size(method: str, rig: Rig, samples: int, columns: int, devices: int = 1) -> int:
    """Designs at a time: a power of two from the free memory, never above `BATCH`.

    A design needs about 8 bytes x samples x channels and what its closed form does, once more for
    each gradient's direction.
    """
    need = 8.0 * max(samples, 1000) * CHANNELS * 2 * (1 + columns)
    if method in ("steady", "propagation"):
        need += BYTES_A_PIECE * pieces_traced(rig) * (1 + columns)
    need = 1e5 * (1 + columns) if method in BULK else need  # keeps no samples
    fit = int(SHARE_OF_MEMORY * available() / need)
    size = 1 << max(min(fit, BATCH[method]), 1).bit_length() - 1
    return max(size, devices)


def gradient_name(metric: str, path: str) -> str:
    """Name of the stored array of d metric / d path."""
    return f"d_{metric}.{path}"


def quantities(spec: SweepSpec) -> list[StoredQuantity]:
    """The arrays that a sweep stores: varied values, metrics, gradients, status last."""
    stored = [StoredQuantity(path, unit, path) for path, unit, _ in spec.vary]
    for name in spec.metrics:
        metric = METRICS[name]
        stored.append(StoredQuantity(name, metric.unit, metric.meaning))
        if spec.gradient:
            stored += [
                StoredQuantity(
                    gradient_name(name, path), _per(metric.unit, unit), f"d {name} / d {path}"
                )
                for path, unit, _ in spec.vary
            ]
    return [*stored, StoredQuantity("status", "1", "how the design's evaluation ended")]


def _per(unit: str, other: str) -> str:
    if other == "1":
        return unit
    return f"{unit}/({other})" if " " in other or "/" in other else f"{unit}/{other}"


def _machine(spec: SweepSpec) -> tuple[Rig, Drive]:
    return parse_rig(tomllib.loads(spec.rig)), drive_from_plain(spec.drive)


def evaluation_in(spec: SweepSpec) -> Evaluation:
    """How a spec's designs are evaluated."""
    return Evaluation(
        spec.method, spec.metrics, spec.model, samples_of(spec.duration, spec.rate), spec.solver,
        spec.rtol or RTOL, spec.max_steps or MAX_STEPS, spec.gradient, spec.substeps or 1,
    )  # fmt: skip


class Evaluator:
    """Evaluates designs of one sweep by index; the compiled program depends on the shapes only."""

    def __init__(self, spec: SweepSpec, devices: int = 1):
        self.spec, self.points = spec, spec.points
        self._paths = tuple(path for path, _, _ in spec.vary)
        self._rows = Rows(evaluation_in(spec), *_machine(spec), self._paths, spec.gradient, devices)
        few = 1 << (self.points.size - 1).bit_length()  # no more than there are designs
        self._batch = -(-min(spec.batch, few) // devices) * devices

    def designs(self, index: np.ndarray) -> dict[str, np.ndarray]:
        """Every stored array for the designs `index` (m,)."""
        values = self.points.at(index)
        figures, slopes, status = self._rows.all(values, self._batch)
        columns = dict(zip(self._paths, values.T, strict=True))
        for i, name in enumerate(self.spec.metrics):
            columns[name] = figures[:, i]
            for j, path in enumerate(self._paths if self.spec.gradient else ()):
                columns[gradient_name(name, path)] = slopes[:, i, j]
        kept = np.isin(status, FAILED)
        broken = ~np.isfinite(slopes).all(axis=(1, 2)) & ~kept
        columns["status"] = np.where(broken, Status.NON_FINITE, status).astype(np.int8)
        return columns

    def figures(self, rows: np.ndarray) -> np.ndarray:
        """Metrics, and slopes if the sweep has them, of designs (t, d) anywhere in the ranges."""
        figures, slopes, _ = self._rows.all(rows, self._batch)
        return np.concatenate([figures, slopes.reshape(len(rows), -1)], axis=1)
