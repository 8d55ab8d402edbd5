"""Evaluation of designs in batches of one fixed shape, over the local devices."""

import tomllib

import numpy as np

from ..._status import FAILED, Status
from ...rig import Rig, carried_laws, parse_rig
from ...simulation import MAX_STEPS, RTOL
from ...vibration import METRICS
from .._evaluation import (
    Drive,
    Evaluation,
    Rows,
    drive_from_plain,
    gathers,
    samples_of,
)
from .spec import SweepSpec
from .store import StoredQuantity

BATCHES_A_CHUNK = 8


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


def machine_in(spec: SweepSpec) -> tuple[Rig, Drive]:
    """A spec's rig, its users' laws from the texts that the spec carries, and its drive."""
    with carried_laws(dict(spec.laws)):
        rig = parse_rig(tomllib.loads(spec.rig))
    return rig, drive_from_plain(spec.drive)


def evaluation_in(spec: SweepSpec, rig: Rig) -> Evaluation:
    """How a spec's designs, of its `rig`, are evaluated."""
    return Evaluation(
        spec.method, spec.metrics, spec.model, samples_of(spec.duration, spec.rate),
        spec.solver or "auto",
        spec.rtol or RTOL, spec.max_steps or MAX_STEPS, spec.gradient, spec.substeps or 1,
        gathers(spec.method, rig, spec.model, spec.metrics),
    )  # fmt: skip


class Evaluator:
    """Evaluates designs of one sweep by index; the compiled program depends on the shapes only."""

    def __init__(self, spec: SweepSpec, devices: int = 1):
        self.spec, self.points = spec, spec.points
        self._paths = tuple(path for path, _, _ in spec.vary)
        rig, drive = machine_in(spec)
        self._rows = Rows(
            evaluation_in(spec, rig), rig, drive, self._paths, spec.gradient, devices,
            total=self.points.size,
        )  # fmt: skip
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
