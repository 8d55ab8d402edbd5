"""Evaluation of designs in batches of one fixed shape, over the local devices."""

import dataclasses
import functools
import os
import tomllib
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import AxisType, PartitionSpec

from ..._errors import InputError
from ...rig import Rig, parse_rig
from ...vibration import METRICS
from .._drive import Drive, drive_from_plain
from .._target import apply
from .bulk import bulk_batch, plan_of
from .paths import Settings, figures_of
from .spec import SweepSpec
from .store import Quantity

# designs at a time where memory allows
BATCH = {
    "steady": 64,
    "bulk": 2048,
    "steady-bulk": 2048,
    "propagation": 32,
    "fixed": 256,
    "full": 32,
}
BULK = ("bulk", "steady-bulk")
BATCHES_A_CHUNK = 8
CHANNELS = 75  # numbers kept a sample of a run
SHARE_OF_MEMORY = 0.25


def batch_size(path: str, samples: int, columns: int, devices: int = 1) -> int:
    """Designs at a time: a power of two from the free memory, never above `BATCH`.

    A design needs about 8 bytes x samples x channels, once more for each gradient's direction.
    """
    need = 8.0 * max(samples, 1000) * CHANNELS * 2 * (1 + columns)
    need = 1e5 * (1 + columns) if path in BULK else need  # keeps no samples
    fit = int(SHARE_OF_MEMORY * _free_memory() / need)
    size = 1 << max(min(fit, BATCH[path]), 1).bit_length() - 1
    return max(size, devices)


def _free_memory() -> float:
    try:
        return float(os.sysconf("SC_AVPHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    except (AttributeError, ValueError, OSError):  # not every system says
        return 2e9


def gradient_name(metric: str, path: str) -> str:
    """Name of the stored array of d metric / d path."""
    return f"d_{metric}.{path}"


def quantities(spec: SweepSpec) -> list[Quantity]:
    """The arrays that a sweep stores: varied values, metrics, gradients, status last."""
    found = [Quantity(path, unit, path) for path, unit, _ in spec.vary]
    for name in spec.metrics:
        metric = METRICS[name]
        found.append(Quantity(name, metric.unit, metric.meaning))
        if spec.gradient:
            found += [
                Quantity(gradient_name(name, path), _per(metric.unit, unit), f"d {name} / d {path}")
                for path, unit, _ in spec.vary
            ]
    return [*found, Quantity("status", "1", "how the design's evaluation ended")]


def _per(unit: str, other: str) -> str:
    if other == "1":
        return unit
    return f"{unit}/({other})" if " " in other or "/" in other else f"{unit}/{other}"


@eqx.filter_jit
def _evaluate(arrays, times, values, static, settings: Settings, paths, devices: int, plan):
    """Figures (B, m), gradients (B, m, d) and status (B,) of a batch, spread over the devices."""

    def batch(arrays, times, values):
        rig, drive = eqx.combine(arrays, static)
        if settings.path in BULK:
            return bulk_batch(rig, drive, paths, settings.metrics, values, plan, settings.gradient)

        def one(x):
            figures, status = figures_of(settings, *apply(rig, drive, paths, x), *times)
            return figures, (figures, status)

        if settings.gradient:
            slopes, (figures, status) = jax.vmap(jax.jacfwd(one, has_aux=True))(values)
            return figures, slopes, status
        figures, status = jax.vmap(lambda x: one(x)[1])(values)
        return figures, jnp.zeros((*figures.shape, 0)), status

    if devices == 1:
        return batch(arrays, times, values)
    mesh = jax.make_mesh((devices,), ("design",), axis_types=(AxisType.Auto,))
    whole, split = PartitionSpec(), PartitionSpec("design")
    spread = jax.shard_map(
        batch, mesh=mesh, in_specs=(whole, whole, split), out_specs=split, check_vma=False
    )
    return spread(arrays, times, values)


def _machine(spec: SweepSpec) -> tuple[Rig, Drive]:
    return parse_rig(tomllib.loads(spec.rig)), drive_from_plain(spec.drive)


@functools.lru_cache(maxsize=16)
def _bulk_plan(text: str) -> Any:
    """The bulk kernel's plan of a spec (as JSON), the same for every number of designs."""
    spec = SweepSpec.from_json(text)
    paths = tuple(path for path, _, _ in spec.vary)
    machine = _machine(spec)
    return plan_of(spec.points, *machine, paths, spec.duration, spec.rate, spec.model)


class Evaluator:
    """Evaluates designs of one sweep by index; the compiled program depends on the shapes only."""

    def __init__(self, spec: SweepSpec, devices: int = 1):
        if devices > jax.local_device_count():
            raise InputError(
                f"`devices` must lie in [1, {jax.local_device_count()}], but is {devices}."
            )
        self.spec, self.devices = spec, devices
        self.points = spec.points
        rig, drive = _machine(spec)
        self._arrays, self._static = eqx.partition((rig, drive), eqx.is_array)
        ts = None if spec.duration is None else _samples(spec)
        # an operand, so that other substeps take the same program
        self._times = (ts, None if spec.substeps is None else jnp.asarray(spec.substeps))
        self._paths = tuple(path for path, _, _ in spec.vary)
        self._settings = Settings(
            spec.path,
            spec.metrics,
            spec.model,
            spec.solver,
            spec.rtol,
            spec.max_steps,
            spec.gradient,
        )
        size = None if spec.samples is None else 1
        shape = dataclasses.replace(spec, samples=size, seed=0, batch=1, chunk=1)
        self._plan = _bulk_plan(shape.to_json()) if spec.path in BULK else None
        self._batch = -(-spec.batch // devices) * devices

    def designs(self, index: np.ndarray) -> dict[str, np.ndarray]:
        """Every stored array for the designs `index` (m,)."""
        values = self.points.at(index)
        parts = [
            self._some(values[i : i + self._batch]) for i in range(0, len(values), self._batch)
        ]
        figures, slopes, status = (np.concatenate(part) for part in zip(*parts, strict=True))
        found = dict(zip(self._paths, values.T, strict=True))
        for i, name in enumerate(self.spec.metrics):
            found[name] = figures[:, i]
            for j, path in enumerate(self._paths if self.spec.gradient else ()):
                found[gradient_name(name, path)] = slopes[:, i, j]
        broken = ~np.isfinite(slopes).all(axis=(1, 2)) & (status != 2) & (status != 3)
        found["status"] = np.where(broken, 1, status).astype(np.int8)
        return found

    def figures(self, values: np.ndarray) -> np.ndarray:
        """Metrics (m, metrics) of designs anywhere in the ranges, at most a batch."""
        return self._some(values)[0]

    def _some(self, values: np.ndarray):
        """One batch, padded with its last design to the one shape that is compiled."""
        count = len(values)
        padded = np.concatenate([values, np.repeat(values[-1:], self._batch - count, axis=0)])
        out = _evaluate(
            self._arrays,
            self._times,
            jnp.asarray(padded),
            self._static,
            self._settings,
            self._paths,
            self.devices,
            self._plan,
        )
        return [np.asarray(part)[:count] for part in out]


def _samples(spec: SweepSpec):
    assert spec.duration is not None and spec.rate is not None
    return jnp.linspace(0.0, spec.duration, round(spec.duration * spec.rate) + 1)
