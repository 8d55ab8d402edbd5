"""An axis under the input of a log: how far its free run is from what was measured."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from .._arrays import largest
from .._errors import InputError, RunError, did_you_mean
from .._result import AbstractResult, texts
from .._text import quantity_text
from ..machine import (
    Axis,
    Log,
    MachineFile,
    between,
    delayed_inputs,
    field_units,
    motion,
    numbers_of,
    places_of,
    sensed,
    slopes_of,
    steps_between,
)
from ._axes import read_axis, split_vary
from ._points import build_points
from ._sensitivity import Sensitivity

MISFITS = ("rms", "mae", "peak")  # of measured less simulated
LANES = 32  # designs side by side


def checked_misfits(metric: str | Sequence[str]) -> tuple[str, ...]:
    """Names of `MISFITS`, with commas between; `InputError` for another one."""
    names = [m.strip() for m in metric.split(",")] if isinstance(metric, str) else list(metric)
    wrong = [m for m in names if m not in MISFITS]
    if wrong or not names:
        raise InputError(
            f"`metric` of an axis must be among {', '.join(MISFITS)} (of measured less "
            f"simulated), but is {(wrong or ['nothing'])[0]!r}."
        )
    return tuple(dict.fromkeys(names))


@dataclasses.dataclass(frozen=True)
class VariedNumbers:
    """The numbers of a machine file that may be varied: path -> where it is."""

    file: MachineFile
    where: Mapping[str, tuple[int | None, str]]  # None: of the axis, else of an effect

    @staticmethod
    def of(file: MachineFile) -> "VariedNumbers":
        """`axis.inertia`, `servo.gain`, ..., and `effect.ID.KEY` for every effect of the file."""
        machine = file.machine
        if not isinstance(machine, Axis):
            raise InputError(f"{file.source}: only an axis has numbers by name.")
        out: dict[str, tuple[int | None, str]] = {}
        out |= {path: (None, key.field) for path, key, _ in numbers_of(machine)}
        for k, one in enumerate(file.placed):
            out |= {f"effect.{one.law.id}.{key}": (k, key) for key in one.law.parameters}
        return VariedNumbers(file, out)

    def checked(self, paths: Sequence[str]) -> tuple[str, ...]:
        """The paths; `InputError` for one that the file does not have."""
        wrong = [p for p in paths if p not in self.where]
        if wrong:
            raise InputError([
                f"`{p}` is no number of {self.file.source}.{did_you_mean(p, self.where)}"
                for p in wrong
            ])  # fmt: skip
        return tuple(paths)

    def unit(self, path: str) -> str:
        """SI unit of a number."""
        k, key = self.where[path]
        if k is None:
            return field_units(self.file.machine)[key]
        return self.file.placed[k].law.parameters[key].unit

    def value(self, path: str) -> float:
        """The number as the file states it."""
        k, key = self.where[path]
        return float(getattr(self.file.machine if k is None else self.file.placed[k].law, key))

    def at(self, paths: Sequence[str], values: Any) -> tuple[Any, Any]:
        """(machine, laws) at other values; may be traced."""
        machine, placed = self.file.machine, list(self.file.placed)
        for path, given in zip(paths, values, strict=True):
            k, key = self.where[path]
            value = jnp.asarray(given, float)
            if k is None:
                machine = eqx.tree_at(lambda m, key=key: getattr(m, key), machine, value)
            else:
                placed[k] = eqx.tree_at(lambda p, key=key: getattr(p.law, key), placed[k], value)
        return machine, tuple(placed)


class Misfit:
    """Figures of measured less simulated output over some numbers of a machine file."""

    def __init__(self, file: MachineFile, log: Log, paths: Sequence[str], metrics: Sequence[str]):
        self.numbers, self.log, self.metrics = VariedNumbers.of(file), log, tuple(metrics)
        self.paths, self.hold = self.numbers.checked(paths), file.compare.hold
        q, n = log.outputs["position"], len(log.time)
        self.parts = places_of(self.hold)
        fine = {k: jnp.asarray(between(np.asarray(x), self.hold)) for k, x in log.inputs.items()}
        clock = jnp.arange(n) * log.step
        start = {k: tuple(map(jnp.asarray, pair)) for k, pair in log.start.items()}
        some = np.linspace(0, n - 1, min(n, 20)).astype(int)
        few = {k: jnp.asarray(x[some]) for k, x in log.inputs.items()}
        there = (jnp.asarray(q[some]), jnp.zeros(len(some)))

        def state(machine, first):
            return jnp.stack([jnp.asarray(x, float) for x in machine.start(first)])

        def slopes(values):
            machine, placed = self.numbers.at(self.paths, values)
            states = jax.vmap(lambda *x: state(machine, {"position": x}))(*there)
            return slopes_of(machine, placed, states, few)

        def figures(values, steps):
            machine, placed = self.numbers.at(self.paths, values)
            times = jnp.linspace(0.0, clock[-1], self.parts * (n - 1) + 1)
            late = delayed_inputs(placed, times, fine)
            out = motion(machine, placed, state(machine, start), late, log.step, steps,
                         self.parts, self.hold)  # fmt: skip
            error = jnp.asarray(log.shown) - sensed(placed, clock, out)[log.measured]
            size = {"rms": jnp.sqrt(jnp.mean(error**2)), "mae": jnp.mean(jnp.abs(error)),
                    "peak": largest(jnp.abs(error))}  # fmt: skip
            return jnp.stack([size[m] for m in self.metrics])

        self._slopes = jax.jit(jax.vmap(slopes))
        self._figures = jax.jit(jax.vmap(figures, in_axes=(0, None)))
        self._derivatives = jax.jit(jax.jacfwd(figures))

    @property
    def unit(self) -> str:
        """Unit of every metric."""
        return self.numbers.file.machine.outputs[self.log.measured]

    def steps(self, values: np.ndarray) -> int:
        """Runge-Kutta steps between two samples that all of some designs (m, d) can do with."""
        slopes = np.asarray(self._slopes(jnp.asarray(values, float)))
        step = self.log.step / self.parts
        return max(steps_between(s, step) for s in slopes)

    def at(self, values: np.ndarray) -> np.ndarray:
        """Figures (m, metrics) of designs (m, d); NaN or inf where a run leaves all bounds."""
        out = []
        for begin in range(0, len(values), LANES):
            part = values[begin : begin + LANES]
            filled = np.concatenate([part, np.repeat(part[-1:], LANES - len(part), 0)])
            figures = self._figures(jnp.asarray(filled, float), self.steps(filled))
            out.append(np.asarray(figures)[: len(part)])
        return np.concatenate(out)

    def slopes(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Figures (metrics,) of one design (d,) and their derivatives (metrics, d)."""
        steps = self.steps(values[None])
        (figures,) = self.at(values[None])
        return figures, np.asarray(self._derivatives(jnp.asarray(values, float), steps))


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
        from ._misfit_plot import plot_designs

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
    return MachineSweep(paths, units, values, misfit.metrics, misfit.unit, misfit.at(values))


def sensitivity_machine(
    file: MachineFile, log: Log, metrics: str | Sequence[str] = "rms",
    parameters: Sequence[str] | None = None,
) -> Sensitivity:  # fmt: skip
    """What each number of a machine file does to the misfit of its free run under a log's inputs.

    Exact derivatives; `raw` is in the unit of what was measured by the parameter's.  Raises
    `InputError` for an unknown metric or parameter, `RunError` where the run leaves all bounds.
    """
    numbers = VariedNumbers.of(file)
    paths = list(numbers.where) if parameters is None else parameters
    misfit = Misfit(file, log, numbers.checked(paths), checked_misfits(metrics))
    values = np.array([numbers.value(p) for p in misfit.paths])
    figures, raw = misfit.slopes(values)
    if not (np.all(np.isfinite(figures)) and np.all(np.isfinite(raw))):
        raise RunError("the free run of this axis left all bounds: it has no sensitivities.")
    return Sensitivity(
        misfit.paths, tuple(map(numbers.unit, misfit.paths)), values, misfit.metrics,
        (misfit.unit,) * len(misfit.metrics), figures, raw, "free-run",
    )  # fmt: skip
