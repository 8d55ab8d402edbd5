"""Relative sensitivities over a range of speeds, a parameter changed on all wheels at once."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np

from ..._plot import MUTED, new_axes
from ..._result import AbstractResult, texts
from ..._text import split_names
from ...rig import Rig, as_rig, get_parameter, put_parameter, typed_numbers
from ...simulation import speeds as speed_drive
from ...vibration import METRICS
from .._batches import each, percent_per_percent, value_and_jacobian
from .._evaluation import Question, checked_metrics, evaluation_of


@dataclasses.dataclass(frozen=True, repr=False, eq=False)
class SpeedSensitivity(AbstractResult):
    """`figures[s, m]` and `relative[s, m, p]` (% per %) at the wheel speeds `scale` x `speeds`.

    Sensitivities are zero where the parameter or the metric is zero.
    """

    scale: np.ndarray
    speeds: np.ndarray  # rad/s, one a wheel
    parameters: tuple[str, ...]
    metrics: tuple[str, ...]
    figures: np.ndarray
    relative: np.ndarray

    file_kind: ClassVar[str] = "omnijax sensitivity over speeds"
    what: ClassVar[str] = "sensitivities over speeds"

    def sentences(self) -> list[str]:
        """Where each metric depends most on each parameter."""
        fastest, lines = self.scale * np.max(np.abs(self.speeds)), []
        for metric in self.metrics:
            for parameter in self.parameters:
                course = self.of(metric, parameter)
                most = int(np.argmax(np.abs(course)))
                lines.append(
                    f"{metric} depends most on `{parameter}` at {fastest[most]:.4g} rad/s of the "
                    f"fastest wheel: {course[most]:+.3g} % per %."
                )
        return lines

    def table(self):
        """One row a speed."""
        pairs = [(m, p) for m in self.metrics for p in self.parameters]
        rows = [
            (float(s), *(float(self.of(m, p)[i]) for m, p in pairs))
            for i, s in enumerate(self.scale)
        ]
        return "% per %", rows, ("scale of the speeds", *(f"{m}, {p}" for m, p in pairs))

    def of(self, metric: str, parameter: str) -> np.ndarray:
        """% per % over the speeds."""
        return self.relative[:, self.metrics.index(metric), self.parameters.index(parameter)]

    def to_xarray(self) -> Any:
        """An `xarray.Dataset` over scale, metric and parameter."""
        import xarray as xr

        data = {
            "figure": (("scale", "metric"), self.figures),
            "relative": (("scale", "metric", "parameter"), self.relative, {"units": "% per %"}),
        }
        units = ("metric", [METRICS[m].unit for m in self.metrics])
        coords = {
            "scale": self.scale, "metric": list(self.metrics), "parameter": list(self.parameters),
            "metric_unit": units,
        }  # fmt: skip
        return xr.Dataset(data, coords, {"speeds_rad_per_s": self.speeds})

    @classmethod
    def from_xarray(cls, data: Any) -> "SpeedSensitivity":
        """The result of which `to_xarray` made `data`."""
        return cls(
            data["scale"].values, np.atleast_1d(data.attrs["speeds_rad_per_s"]),
            texts(data, "parameter"), texts(data, "metric"), data["figure"].values,
            data["relative"].values,
        )  # fmt: skip

    def plot_speeds(self, parameter: str, ax: Any = None) -> Any:
        """One parameter's part in every metric over the speed of the fastest wheel."""
        from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

        ax = new_axes(ax)
        fastest = self.scale * np.max(np.abs(self.speeds))
        for metric in self.metrics:
            ax.plot(fastest, self.of(metric, parameter), label=metric)
        ax.axhline(0, color=MUTED, linewidth=0.8)
        ax.set_xscale("log")
        ax.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        ax.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
        ax.xaxis.set_minor_formatter(NullFormatter())
        ax.set_xlabel("speed of the fastest wheel (rad/s)")
        ax.set_ylabel(f"% per % of {parameter}")
        ax.legend()
        return ax


def sensitivity_over_speeds(
    rig: Rig | str | Path,
    speeds: Sequence[float | str] | str,
    scale: Sequence[float] | np.ndarray,
    metrics: Sequence[str] | str = ("rms",),
    parameters: Sequence[str] | str = ("contact.stiffness", "mount.stiffness", "wheel.roundness"),
    model: str = "coupled",
) -> SpeedSensitivity:
    """Steady-state sensitivities at the wheel speeds (rad/s) times each of `scale`.

    `metrics` and `parameters` are lists, or text with commas between; `speeds` as `simulate` takes
    them.
    """
    machine = as_rig(rig)
    names, paths = checked_metrics(metrics), tuple(split_names(parameters))
    base = jnp.asarray(typed_numbers("speeds", speeds, "rad/s"), float)
    drive = speed_drive(base)
    asked = Question(machine, (drive,), paths, names, model, None, gradient=True)
    how, _ = evaluation_of(asked)

    @jax.jit
    def all_of(scale):
        def one(s):
            moved = speed_drive(s * base)

            def figures(change):
                rig = machine
                for i, path in enumerate(paths):
                    rig = put_parameter(rig, path, get_parameter(machine, path) * (1 + change[i]))
                return how.values(rig, moved)

            return value_and_jacobian(figures)(jnp.zeros(len(paths)))

        return each(one, [scale], how.order)

    value, slope = (np.asarray(x) for x in all_of(jnp.asarray(scale, float)))
    relative = percent_per_percent(slope, value)
    return SpeedSensitivity(
        np.asarray(scale, float), np.asarray(base), paths, names, value, relative
    )
