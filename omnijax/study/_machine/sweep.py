"""`sweep` of an axis: misfits over designs."""

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..._errors import tell
from ..._result import AbstractResult, texts
from ..._text import quantity_text
from ...machine import Log, MachineFile
from .._axes import read_axis, split_vary
from .._points import build_points
from .misfit import Misfit, checked_misfits
from .numbers import VariedNumbers


@dataclasses.dataclass(frozen=True, repr=False, eq=False)
class MachineSweep(AbstractResult):
    """Misfits (designs, metrics) of an axis at `values` (designs, paths), SI units."""

    paths: tuple[str, ...]
    units: tuple[str, ...]
    values: np.ndarray
    metrics: tuple[str, ...]
    unit: str
    figures: np.ndarray

    file_kind = "omnijax sweep of an axis"
    what = "sweep of an axis"

    def best(self, metric: str) -> int | None:
        """The design of the least misfit; None where every run left all bounds."""
        column = self.figures[:, self.metrics.index(metric)]
        return int(np.nanargmin(column)) if np.isfinite(column).any() else None

    @property
    def failed(self) -> int:
        """Designs whose run left all bounds."""
        return int((~np.all(np.isfinite(self.figures), axis=1)).sum())

    def plot(self, metric: str | None = None, path: str | None = None, *, ax: Any = None) -> Any:
        """A metric (default: the first) over one varied number, a point a design; the axes.

        Raises `ValueError` for a metric or a path that the sweep has not.
        """
        from .plot import plot_designs

        metric, path = metric or self.metrics[0], path or self.paths[0]
        for name, known in ((metric, self.metrics), (path, self.paths)):
            if name not in known:
                raise ValueError(f"`{name}` must be one of {', '.join(known)}.")
        k, figures = self.paths.index(path), self.figures[:, self.metrics.index(metric)]
        return plot_designs(
            path, self.values[:, k], self.units[k], metric, figures, self.unit, ax=ax
        )

    def sentences(self):
        """How many designs, and the best one by each metric."""
        lines = [f"{len(self.values)} designs by free runs of the log; {self.failed} failed."]
        for m, name in enumerate(self.metrics):
            k = self.best(name)
            if k is not None:
                numbers = zip(self.paths, self.values[k], self.units, strict=True)
                at = ", ".join(f"{p} = {quantity_text(float(v), u)}" for p, v, u in numbers)
                size = quantity_text(float(self.figures[k, m]), self.unit)
                lines.append(f"least {name}: {size} at {at} (design {k})")
        return lines

    def table(self):
        """One row a design."""
        rows = [tuple(map(float, r)) for r in np.concatenate([self.values, self.figures], axis=1)]
        return "misfits by design", rows, (*self.paths, *self.metrics)

    def to_xarray(self):
        """`value` over design and parameter, `figure` over design and metric."""
        import xarray as xr

        data = {"value": (("design", "parameter"), self.values),
                "figure": (("design", "metric"), self.figures, {"units": self.unit})}  # fmt: skip
        coords = {"parameter": list(self.paths), "metric": list(self.metrics),
                  "parameter_unit": ("parameter", list(self.units))}  # fmt: skip
        return xr.Dataset(data, coords)

    @classmethod
    def from_xarray(cls, data):
        """The result of which `to_xarray` made `data`."""
        return cls(
            texts(data, "parameter"), texts(data, "parameter_unit"), data["value"].values,
            texts(data, "metric"), data["figure"].attrs["units"], data["figure"].values,
        )  # fmt: skip


def sweep_machine(
    file: MachineFile,
    log: Log,
    vary: Any,
    metric: str | Sequence[str] = "rms",
    *,
    sampler: str = "grid",
    samples: int | None = None,
    seed: int = 0,
) -> MachineSweep:
    """Misfits of an axis' free run under a log's inputs over designs, as `sweep` samples them.

    `vary` is `{path: range}` or texts `path=range`; paths are those of the machine file
    (`axis.inertia`, `effect.bearing-coulomb.torque`).  Figures are in the unit of what the log
    measured, a position or a speed.  Raises `InputError` for an unknown path or metric and for a
    range that cannot be read.
    """
    numbers, given = VariedNumbers.of(file), split_vary(vary)
    paths = numbers.checked(list(given))
    axes = [read_axis(p, given[p], numbers.unit(p)) for p in paths]
    points = build_points(axes, sampler, samples, seed)
    values = points.at(np.arange(points.size))
    misfit = Misfit(file, log, paths, checked_misfits(metric))
    units = tuple(numbers.unit(p) for p in paths)
    figures, steps = misfit.at(values)
    stiff = int(np.sum(steps > misfit.most))
    if stiff:
        tell([
            f"{stiff} of {len(values)} designs cannot be followed: they need more than "
            f"{misfit.most} Runge-Kutta steps between two samples, and have no figures."
        ])  # fmt: skip
    return MachineSweep(paths, units, values, misfit.metrics, misfit.unit, figures)
