"""The trade-off between metrics: designs of which none is better in every metric."""

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np

from .._html import html_table
from ._amounts import amount, label, scaled
from ._netcdf import read_result, write_result


@dataclasses.dataclass(frozen=True, repr=False)
class Front:
    """Designs none of which is better than another in every metric.

    `values[p, m]` are the metrics and `x[p, d]` the variables; `status` as in `Design`.
    `evaluations` counts objectives with gradients, of all searches.
    """

    metrics: tuple[str, ...]
    units: tuple[str, ...]
    variables: tuple[str, ...]
    variable_units: tuple[str, ...]
    values: np.ndarray
    x: np.ndarray
    status: tuple[str, ...]
    evaluations: int

    def __repr__(self) -> str:
        return "\n".join(self.sentences())

    def _repr_html_(self) -> str:
        names, units = (*self.metrics, *self.variables), (*self.units, *self.variable_units)
        header = [f"{n} / {u}" for n, u in zip(names, units, strict=True)]
        rows = [(*map(float, v), *map(float, x)) for v, x in zip(self.values, self.x, strict=True)]
        return html_table(self.sentences()[0], rows, header)

    def sentences(self) -> list[str]:
        """The span of the front in words."""
        good = sum(s == "optimal" for s in self.status)
        first, second = (self.values[int(np.argmin(self.values[:, m]))] for m in (0, 1))
        change = 100 * (second / first - 1)
        lines = [
            f"from the design best in {self.metrics[0]} to the one best in {self.metrics[1]}, "
            f"{self.metrics[0]} rises by {change[0]:.1f} % and {self.metrics[1]} falls by "
            f"{-change[1]:.1f} %; {len(self.x)} designs on the front, {good} of them optimal (KKT "
            "residual)."
        ]
        for m, (name, unit) in enumerate(zip(self.metrics, self.units, strict=True)):
            low, high = self.values[:, m].min(), self.values[:, m].max()
            lines.append(f"{name} from {amount(low, unit)} to {amount(high, unit)}.")
        return lines

    def to_xarray(self) -> Any:
        """An `xarray.Dataset` over point, metric and variable."""
        import xarray as xr

        data = {
            "value": (("point", "metric"), self.values),
            "x": (("point", "variable"), self.x),
            "status": ("point", np.array(self.status)),
        }
        coords = {
            "metric": list(self.metrics),
            "variable": list(self.variables),
            "metric_unit": ("metric", list(self.units)),
            "variable_unit": ("variable", list(self.variable_units)),
        }
        return xr.Dataset(data, coords, {"kind": "omnijax front", "evaluations": self.evaluations})

    def save(self, path: str | Path) -> None:
        """Write netCDF that `Front.load` reads back equal."""
        write_result(self.to_xarray(), path)

    @classmethod
    def load(cls, path: str | Path) -> "Front":
        """The front that `save` wrote."""
        d = read_result(path, "omnijax front", "front")

        def texts(name):
            return tuple(str(x) for x in d[name].values)

        return cls(
            texts("metric"), texts("metric_unit"), texts("variable"), texts("variable_unit"),
            d["value"].values, d["x"].values, texts("status"), int(d.attrs["evaluations"]),
        )  # fmt: skip

    def plot_front(self, ax: Any = None) -> Any:
        """The first two metrics against each other; a third in colour."""
        from ._sensitivity_plot import new_axes

        ax = new_axes(ax)
        order = np.argsort(self.values[:, 0])
        sizes = [
            scaled(float(v), u) for v, u in zip(self.values.max(axis=0), self.units, strict=True)
        ]
        shown = self.values[order] * [factor for factor, _ in sizes]
        names = [label(n, unit) for n, (_, unit) in zip(self.metrics, sizes, strict=True)]
        if len(self.metrics) == 2:
            ax.plot(shown[:, 0], shown[:, 1], "o-", color="#0072B2")
        else:
            dots = ax.scatter(shown[:, 0], shown[:, 1], c=shown[:, 2], cmap="cividis")
            ax.figure.colorbar(dots, ax=ax, label=names[2])
        ax.set_xlabel(names[0])
        ax.set_ylabel(names[1])
        return ax
