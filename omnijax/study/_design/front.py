"""The trade-off between metrics: designs of which none is better in every metric."""

import dataclasses
from typing import Any, ClassVar

import numpy as np

from ..._plot import PALETTE, new_axes, styled
from ..._result import AbstractResult, texts
from ..._text import label, quantity_text, scaled

ALIKE = 0.1  # %: a front that spans less is one design


@dataclasses.dataclass(frozen=True, repr=False)
class Front(AbstractResult):
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

    file_kind: ClassVar[str] = "omnijax front"
    what: ClassVar[str] = "front"

    def table(self):
        """One row a design on the front."""
        names, units = (*self.metrics, *self.variables), (*self.units, *self.variable_units)
        header = [f"{n} / {u}" for n, u in zip(names, units, strict=True)]
        rows = [(*map(float, v), *map(float, x)) for v, x in zip(self.values, self.x, strict=True)]
        return self.sentences()[0], rows, header

    def pairs(self) -> list[tuple[int, int]]:
        """Pairs of metrics, those first that conflict most: where both change most."""
        count = len(self.metrics)
        every = [(a, b) for a in range(count) for b in range(a + 1, count)]
        return sorted(every, key=lambda pair: -min(abs(x) for x in self._change(*pair)))

    def _change(self, a: int, b: int) -> tuple[float, float]:
        """What a rises by and b falls by, in %, from the design best in a to the one best in b."""
        first, second = (self.values[int(np.argmin(self.values[:, m]))] for m in (a, b))
        return 100 * (second[a] / first[a] - 1), 100 * (1 - second[b] / first[b])

    def sentences(self) -> list[str]:
        """The span of the front in words."""
        good = sum(s == "optimal" for s in self.status)
        lines = []
        for a, b in self.pairs():
            one, other, (up, down) = self.metrics[a], self.metrics[b], self._change(a, b)
            lines.append(
                f"from the design best in {one} to the one best in {other}, {one} rises by "
                f"{up:.1f} % and {other} falls by {down:.1f} %"
                if min(up, down) > ALIKE  # else one of the two designs is as good in both
                else f"{one} and {other} do not compete here: one design is best in both, within "
                f"{ALIKE:g} %"
            )
        lines = [
            f"{lines[0]}; {len(self.x)} designs on the front, {good} of them optimal (KKT "
            "residual).",
            *(f"{line}." for line in lines[1:]),
        ]
        for m, (name, unit) in enumerate(zip(self.metrics, self.units, strict=True)):
            low, high = self.values[:, m].min(), self.values[:, m].max()
            lines.append(f"{name} from {quantity_text(low, unit)} to {quantity_text(high, unit)}.")
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
        return xr.Dataset(data, coords, {"evaluations": self.evaluations})

    @classmethod
    def from_xarray(cls, data: Any) -> "Front":
        """The front of which `to_xarray` made `data`."""
        return cls(
            texts(data, "metric"), texts(data, "metric_unit"),
            texts(data, "variable"), texts(data, "variable_unit"),
            data["value"].values, data["x"].values, texts(data, "status"),
            int(data.attrs["evaluations"]),
        )  # fmt: skip

    @styled
    def plot_front(self, pair: tuple[int, int] | None = None, ax: Any = None) -> Any:
        """A pair of metrics against each other (the one that conflicts most); a third in colour."""
        ax, (a, b) = new_axes(ax), pair or self.pairs()[0]
        order = np.argsort(self.values[:, a])
        sizes = [
            scaled(float(v), u) for v, u in zip(self.values.max(axis=0), self.units, strict=True)
        ]
        shown = self.values[order] * [factor for factor, _ in sizes]
        names = [label(n, unit) for n, (_, unit) in zip(self.metrics, sizes, strict=True)]
        if len(self.metrics) == 2:
            ax.plot(shown[:, a], shown[:, b], "o-", color=PALETTE["blue"])
        else:
            (c,) = {0, 1, 2} - {a, b}
            dots = ax.scatter(shown[:, a], shown[:, b], c=shown[:, c], cmap="cividis")
            ax.figure.colorbar(dots, ax=ax, label=names[c])
        ax.locator_params(axis="x", nbins=4)
        ax.set_xlabel(names[a])
        ax.set_ylabel(names[b])
        return ax
