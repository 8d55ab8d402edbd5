"""Global sensitivities: indices, effects and bounds, in sentences, files and figures."""

import dataclasses
from typing import Any, ClassVar

import numpy as np

from ..._result import AbstractResult, texts
from .morris import MorrisEffects
from .sobol import SobolIndices

SILENT = 1e-12  # share of the variance that no run would show
NAMED = 5  # failed runs listed by name


@dataclasses.dataclass(frozen=True, repr=False)
class GlobalSensitivity(AbstractResult):
    """Sobol indices, Morris effects and derivative-based bounds of metrics over inputs.

    `bound[m, d]` is an upper bound on the total index from the gradients, C E[(df/dt)^2]/V (Sobol
    and Kucherenko 2009).  `failed` names the runs that failed; none of them entered a figure.
    """

    inputs: tuple[str, ...]
    metrics: tuple[str, ...]
    units: tuple[str, ...]
    sobol: SobolIndices
    morris: MorrisEffects
    bound: np.ndarray
    bound_half: np.ndarray
    runs: int
    failed: tuple[str, ...]

    file_kind: ClassVar[str] = "omnijax global sensitivity"
    what: ClassVar[str] = "global sensitivities"

    def table(self):
        """One row an input of a metric."""
        columns = self.sobol.first, self.sobol.total, self.sobol.total_half, self.bound
        rows = [
            (metric, name, *(float(x[m, i]) for x in columns))
            for m, metric in enumerate(self.metrics)
            for i, name in enumerate(self.inputs)
        ]
        header = ("metric", "input", "first order", "total", "± (95 %)", "bound from gradients")
        return f"Shares of the variance, {self.runs} runs", rows, header

    def sentences(self) -> list[str]:
        """The ranking in words, and what failed."""
        lines = [line for m in range(len(self.metrics)) for line in self._ranking(m)]
        if self.failed:
            listed = "; ".join(self.failed[:NAMED])
            more = f" and {len(self.failed) - NAMED} more" if len(self.failed) > NAMED else ""
            lines.append(
                f"{len(self.failed)} of {self.runs} runs failed ({listed}{more}); left out with "
                f"{self.sobol.dropped} blocks and {self.morris.dropped} steps."
            )
        return lines

    def _ranking(self, m: int) -> list[str]:
        """What one metric depends on, what it does not, and whether that is settled."""
        metric, total, half = self.metrics[m], self.sobol.total[m], self.sobol.total_half[m]
        order = [i for i in np.argsort(-total) if self.bound[m, i] > SILENT]
        parts = [f"`{self.inputs[i]}` ({total[i]:.3f} ± {half[i]:.3f})" for i in order]
        lines = []
        if parts:
            lines.append(
                f"{metric} depends most on {', then '.join(parts)}: shares of its variance, "
                "interactions included."
            )
        if len(order) > 1 and total[order[0]] - half[order[0]] < total[order[1]] + half[order[1]]:
            one, two = (f"`{self.inputs[i]}`" for i in order[:2])
            lines.append(
                f"which of {one} and {two} matters more for {metric} is not settled by "
                f"{self.sobol.blocks} blocks: their intervals overlap."
            )
        silent = [name for i, name in enumerate(self.inputs) if i not in order]
        return lines + [f"`{name}` does not influence {metric}." for name in silent]

    def to_xarray(self) -> Any:
        """An `xarray.Dataset` over metric and input."""
        import xarray as xr

        both = ("metric", "input")
        one = {"units": "1"}
        data: dict[str, Any] = {
            name: (both, getattr(self.sobol, name), one)
            for name in ("first", "first_half", "total", "total_half")
        }
        data |= {
            name: (both, getattr(self.morris, name), {"units": "unit of the metric"})
            for name in ("mu", "mu_star", "sigma")
        }
        data |= {"bound": (both, self.bound, one), "bound_half": (both, self.bound_half, one)}
        data |= {
            "first_stages": (("stage", *both), self.sobol.first_stages, one),
            "total_stages": (("stage", *both), self.sobol.total_stages, one),
            "effects_used": ("input", self.morris.used, one),
        }
        coords = {
            "metric": list(self.metrics),
            "input": list(self.inputs),
            "metric_unit": ("metric", list(self.units)),
            "stage": self.sobol.stages,
        }
        attrs = {
            "runs": self.runs,
            "failed": "\n".join(self.failed), "blocks": self.sobol.blocks,
            "dropped_blocks": self.sobol.dropped, "dropped_steps": self.morris.dropped,
        }  # fmt: skip
        return xr.Dataset(data, coords, attrs)

    @classmethod
    def from_xarray(cls, data: Any) -> "GlobalSensitivity":
        """The result of which `to_xarray` made `data`."""
        a, v = data.attrs, {name: data[name].values for name in data.variables}
        sobol = SobolIndices(
            v["first"], v["first_half"], v["total"], v["total_half"], v["stage"], v["first_stages"],
            v["total_stages"], int(a["blocks"]), int(a["dropped_blocks"]),
        )  # fmt: skip
        morris = MorrisEffects(
            v["mu"], v["mu_star"], v["sigma"], v["effects_used"], int(a["dropped_steps"])
        )
        names, metrics, units = (texts(data, k) for k in ("input", "metric", "metric_unit"))
        failed = tuple(x for x in str(a["failed"]).split("\n") if x)
        widths = v["bound"], v["bound_half"]
        return cls(names, metrics, units, sobol, morris, *widths, int(a["runs"]), failed)

    def plot_convergence(self, metric: str | None = None, ax: Any = None) -> Any:
        """Total indices against the number of blocks."""
        from .plot import convergence

        return convergence(self, metric or self.metrics[0], ax)

    def plot_indices(self, metric: str | None = None, ax: Any = None) -> Any:
        """First and total indices with their confidence intervals, and the gradients' bound."""
        from .plot import indices

        return indices(self, metric or self.metrics[0], ax)
