"""`sensitivity`: exact derivatives of the vibration metrics over the parameters of a rig."""

import dataclasses
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from ..._errors import InputError, RunError
from ..._programs import kept
from ..._result import AbstractResult, texts
from ..._text import listed, quantity_text, split_names
from ...rig import Rig, as_rig, parameter_info
from ...simulation import BULK_METRICS
from ...vibration import METRICS
from .._batches import percent_per_percent, value_and_jacobian
from .._evaluation import (
    BULK,
    METHODS,
    Drive,
    Evaluation,
    Question,
    apply,
    checked_metrics,
    drive_of,
    evaluate_in_bulk,
    evaluation_of,
    read_run,
    with_few_knots,
)
from .._parameters import (
    checked_parameters,
    group_of,
    scalar_parameters,
    values_of,
    with_values,
)
from .check import Check, compare

SHOWN = 6  # parameters in a printed result
COUNTS = ("rollers",)  # last word of parameters that take whole numbers
Evaluated = tuple[np.ndarray, np.ndarray]  # metrics (m,), derivatives (m, p)
FiguresOf = Callable[[np.ndarray], np.ndarray]  # values (b, p) -> metrics (b, m)
NOTHING = 1e-12  # of the metric, per relative change: rounding, not influence


@dataclasses.dataclass(frozen=True, repr=False, eq=False)
class Sensitivity(AbstractResult):
    """M metrics, and what each of P parameters does to them.

    `values` (P,) in the SI `units` of `parameters`, `figures` (M,) in the `metric_units` of
    `metrics`.  `raw` (M, P) is d metric / d parameter in SI units, `relative` (M, P) the change of
    the metric in % per % of the parameter.  `raw` of `wheel.w1.rollers` treats the number as a real
    one.
    """

    parameters: tuple[str, ...]
    units: tuple[str, ...]
    values: np.ndarray
    metrics: tuple[str, ...]
    metric_units: tuple[str, ...]
    figures: np.ndarray
    raw: np.ndarray
    method: str
    check: Check | None = None

    file_kind: ClassVar[str] = "omnijax sensitivity"
    what: ClassVar[str] = "sensitivities"

    def __repr__(self) -> str:
        lines = [f"Sensitivity ({self.how}): % of the metric per % of a parameter on all wheels"]
        for m, name in enumerate(self.metrics):
            first = list(self.together(name).items())[:SHOWN]
            parts = ", ".join(f"{path} {value:+.3g}" for path, value in first)
            lines.append(
                f"{name} = {quantity_text(self.figures[m], self.metric_units[m])}: {parts}"
            )
        return "\n".join(lines)

    @property
    def how(self) -> str:
        """The method in words."""
        return METHODS[self.method]

    def table(self):
        """One row a parameter, all wheels together."""
        columns = [self.together(name) for name in self.metrics]
        rows = [(path, *(float(c[path]) for c in columns)) for path in columns[0]]
        title = f"% of the metric per % of the parameter, all wheels together ({self.how})"
        return title, rows, ("parameter", *self.metrics)

    @property
    def relative(self) -> np.ndarray:
        """% per %; zero where the parameter or the metric is zero."""
        return percent_per_percent(self.raw * self.values, self.figures)

    def column(self, metric: str) -> dict[str, float]:
        """Relative sensitivities of one metric, largest first."""
        row = self.relative[self._index(metric)]
        order = np.argsort(-np.abs(row), kind="stable")
        return {self.parameters[i]: float(row[i]) for i in order}

    def together(self, metric: str) -> dict[str, float]:
        """% per % where a parameter changes on all wheels at once, largest first."""
        total: dict[str, float] = {}
        for path, value in self.column(metric).items():
            total[group_of(path)] = total.get(group_of(path), 0.0) + value
        return dict(sorted(total.items(), key=lambda item: -abs(item[1])))

    def without_influence(self, metric: str | None = None) -> tuple[str, ...]:
        """Parameters that change no metric (or not this one)."""
        rows = slice(None) if metric is None else [self._index(metric)]
        scale = np.where(self.values == 0, 1.0, np.abs(self.values))
        size = NOTHING * np.abs(self.figures[rows])[:, None]
        quiet = np.all(np.abs(self.raw[rows]) * scale <= size, axis=0)
        return tuple(path for path, q in zip(self.parameters, quiet, strict=True) if q)

    def sentences(self) -> list[str]:
        """Which parameters take whole numbers, and which have no influence; one sentence each."""
        metrics = self.metrics[0] if len(self.metrics) == 1 else "any of " + ", ".join(self.metrics)
        quiet, silent = set(self.without_influence()), []
        for group in dict.fromkeys(group_of(path) for path in self.parameters):
            members = [path for path in self.parameters if group_of(path) == group]
            if len(members) > 1 and quiet.issuperset(members):
                silent.append(f"`{group}` (of every wheel)")
            else:
                silent += [f"`{path}`" for path in members if path in quiet]
        told = [
            f"`{path}` takes whole numbers: its derivative says which way to go, a sweep how far."
            for path in self.whole
        ]
        if not silent:
            return told
        *others, last = silent
        listed = f"{', '.join(others)} and {last}" if others else last
        return [*told, f"{listed} {'do' if others else 'does'} not influence {metrics}."]

    @property
    def whole(self) -> tuple[str, ...]:
        """Parameters that count something, as `together` names them."""
        groups = dict.fromkeys(group_of(path) for path in self.parameters)
        return tuple(group for group in groups if group.rpartition(".")[2] in COUNTS)

    def _index(self, metric: str) -> int:
        if metric not in self.metrics:
            raise InputError(f"this study has no metric `{metric}`, but {', '.join(self.metrics)}.")
        return self.metrics.index(metric)

    def to_xarray(self) -> Any:
        """`figure`, `raw`, `relative` (and `difference`) over metric and parameter."""
        import xarray as xr

        both, per = ("metric", "parameter"), {"units": "unit of the metric / unit of the parameter"}
        data: dict[str, Any] = {
            "value": ("parameter", self.values),
            "figure": ("metric", self.figures),
            "raw": (both, self.raw, per),
            "relative": (both, self.relative, {"units": "% per %"}),
        }
        if self.check is not None:
            data["difference"] = (both, self.check.differences, per)
            data["difference_error"] = (both, self.check.error, {"units": "1"})
        coords = {
            "metric": list(self.metrics),
            "parameter": list(self.parameters),
            "metric_unit": ("metric", list(self.metric_units)),
            "parameter_unit": ("parameter", list(self.units)),
        }
        return xr.Dataset(data, coords, {"method": self.method})

    @classmethod
    def from_xarray(cls, data: Any) -> "Sensitivity":
        """The result of which `to_xarray` made `data`."""
        check = None
        if "difference" in data:
            check = Check(data["difference"].values, data["difference_error"].values)
        return cls(
            texts(data, "parameter"), texts(data, "parameter_unit"), data["value"].values,
            texts(data, "metric"), texts(data, "metric_unit"),
            np.atleast_1d(data["figure"].values), data["raw"].values, str(data.attrs["method"]),
            check,
        )  # fmt: skip

    def plot_tornado(self, metric: str | None = None, *, together: bool = False, ax=None):
        """Bars of the relative sensitivities of one metric, largest on top."""
        from .plot import tornado

        return tornado(self, metric or self.metrics[0], together, ax)


def _asked(
    question: Question, rate: float | None, rtol: float | None, values: np.ndarray
) -> tuple[Evaluation, Evaluated, FiguresOf]:
    """How, the metrics (m,) with derivatives (m, p) at `values` (p,), and the metrics (b, m) of
    other values (b, p).

    RMS and peak of runs go in bulk where that serves: 40 parameters of a tripod took 0.3 s for 5
    (4.7 for 6.1 with kept programs).  Its program of steady states is three times as dear to
    compile as one evaluation whose tangents go forwards, and no faster.
    """
    rig, (drive,), paths = question.rig, question.drives, question.varied
    how, _ = evaluation_of(question, rate, rtol=rtol)
    if how.method in BULK:

        def of_rows(rows: np.ndarray, gradient: bool):
            machine = eqx.Partial(apply, rig, with_few_knots(drive), paths)
            return evaluate_in_bulk(how, machine, rows, gradient)

        figures, slopes, _ = of_rows(values[None], True)
        return how, (figures[0], slopes[0]), lambda rows: of_rows(rows, False)[0]

    def figures_of(rows: np.ndarray) -> np.ndarray:
        def one(x):
            return how.values(with_values(rig, paths, x), drive)

        return np.asarray(jax.jit(lambda rows: jax.lax.map(one, rows))(rows))

    evaluated = _figures_and_slopes(how, rig, drive, paths, jnp.asarray(values, float))
    return how, jax.tree.map(np.asarray, evaluated), figures_of


@kept
def _figures_and_slopes(how: Any, rig: Rig, drive: Drive, paths: tuple[str, ...], values: Any):
    """The metrics (m,) and their derivatives (m, d) with respect to `paths`."""
    return value_and_jacobian(lambda x: how.values(with_values(rig, paths, x), drive))(values)


def sensitivity(
    rig: Rig | str | Path,
    drive: Drive | Sequence[float | str] | str,
    metrics: Sequence[str] | str = ("rms", "peak"),
    *,
    parameters: Sequence[str] | str | None = None,
    duration: float | str | None = None,
    rate: float | str | None = None,
    model: str = "coupled",
    rtol: float | None = None,
    check: bool = False,
) -> Sensitivity:
    """Exact derivatives of `metrics` with respect to every parameter of `rig` that is one number.

    `drive` is a drive or constant wheel speeds (rad/s, or text with units).  Without `duration`
    (s) the metrics are those of the steady state, else of a run sampled at `rate` (1/s).  RMS and
    peak of linear rigs' runs go as one row of a sweep, all else forwards over the vector of
    parameters, one compiled function.  `check` adds finite differences.
    Directions (normal, drive, gravity) and inertia tensors are not numbers and stay out.  An `rtol`
    asks for runs by the adaptive solver where there is no closed form.

    `raw` (metrics, parameters) is in the metric's unit by the parameter's, `relative` in % per %.
    Raises `InputError` for an unknown metric or parameter, `RunError` where the run fails or a
    derivative is not finite.

    Source: derivatives of `evaluate`'s and `steady_state`'s figures by JAX, checked by central
    differences.
    """
    machine = as_rig(rig)
    chosen = drive_of(drive, machine)
    paths = scalar_parameters(machine)
    paths = paths if parameters is None else checked_parameters(machine, split_names(parameters))
    names = checked_metrics(metrics)
    duration, rate = read_run(duration, rate)
    bulk = duration is not None and set(names) <= set(BULK_METRICS)
    asked = Question(
        machine, (chosen,), paths, names, model, duration, rows=bulk, gradient=True, alone=True
    )
    values = values_of(machine, paths)
    how, (figures, raw), figures_of = _asked(asked, rate, rtol, values)
    if not np.all(np.isfinite(figures)):
        raise RunError("the run of this rig and drive failed, so that it has no sensitivities.")
    if lost := [
        f"of {names[m]} by `{paths[p]}`" for m, p in np.argwhere(~np.isfinite(raw)).tolist()
    ]:
        raise RunError(f"the derivatives {listed(lost)} are not finite.")
    return Sensitivity(
        parameters=paths,
        units=tuple(parameter_info(machine, path).unit for path in paths),
        values=values,
        metrics=names,
        metric_units=tuple(METRICS[name].unit for name in names),
        figures=figures,
        raw=raw,
        method=how.method,
        check=compare(figures_of, machine, paths, values, raw, how.precision) if check else None,
    )
