"""The tolerances of parts, in numbers, in sentences and as a figure."""

import dataclasses
from typing import Any, ClassVar

import numpy as np

from ..._plot import PALETTE, new_axes, styled
from ..._result import AbstractResult, texts
from ..._text import quantity_text

WIDEST = 0.2  # relative
SILENT = 1e-9  # of the largest derivative: rounding


@dataclasses.dataclass(frozen=True, repr=False)
class Tolerances(AbstractResult):
    """Relative half widths for every part, and what drawn machines say of them.

    `values` are the parts' nominal values in `units`.

    `linear` is what the derivatives alone allow, `widths` what drawn machines bear out.  Of `draws`
    new machines, none of which set the widths, `share` stay below `limit` (95 % bounds `share_low`
    and `share_high`); `linear_share` is that of the widths by derivatives alone.

    Widths are relative, `limit` in the metric's SI unit.
    """

    metric: str
    unit: str
    limit: float
    nominal: float
    confidence: float
    parts: tuple[str, ...]
    values: np.ndarray
    units: tuple[str, ...]
    slopes: np.ndarray  # change of the metric per relative change of the part
    linear: np.ndarray
    widths: np.ndarray
    share: float
    share_low: float
    share_high: float
    linear_share: float
    draws: int
    failed: int = 0  # of the new machines: runs without figures, which keep no limit

    @property
    def confirmed(self) -> bool:
        """Whether the new machines keep the limit as often as asked for."""
        return self.share >= self.confidence

    file_kind: ClassVar[str] = "omnijax tolerances"
    what: ClassVar[str] = "tolerances"

    def table(self):
        """One row a part."""
        percent = 100 * np.column_stack([self.linear, self.widths])
        rows = [(part, *map(float, row)) for part, row in zip(self.parts, percent, strict=True)]
        return self.sentences()[0], rows, ("part", "by derivatives / ± %", "± %")

    def sentences(self) -> list[str]:
        """The tolerances in words."""
        lines = [
            f"{self.metric} is {quantity_text(self.nominal, self.unit)} with nominal parts and "
            f"stays below {quantity_text(self.limit, self.unit)} for {100 * self.share:.2f} % of "
            f"{self.draws} new machines (95 %: {100 * self.share_low:.2f} to "
            f"{100 * self.share_high:.2f} %); asked for: {100 * self.confidence:g} %."
            + (f" {self.failed} of them failed and keep nothing." if self.failed else "")
            + ("" if self.confirmed else " The tolerances are NOT confirmed.")
        ]
        capped = self.capped
        for i, part in enumerate(self.parts):
            lines.append(f"`{part}` {self.width_text(i)}{', capped' if capped[i] else ''}")
        if capped.any():
            lines.append(
                f"Capped: the derivatives would allow more than ± {100 * WIDEST:g} %, the widest "
                "that they give to any part."
            )
        ratio = float(np.min(self.widths / self.linear))
        if ratio < 1 - 1e-9:
            lines.append(
                f"All parts are held {1 / ratio:.3g} times as closely as the derivatives alone "
                f"allow: with those only {100 * self.linear_share:.2f} % stay below the limit, "
                "because the metric is curved."
            )
        quiet = [f"`{part}`" for part, q in zip(self.parts, self.silent, strict=True) if q]
        if quiet:
            lines.append(
                f"{', '.join(quiet)} {'do' if quiet[1:] else 'does'} not change {self.metric} in "
                "this drive: it says nothing of them. Turn every wheel."
            )
        return lines

    @property
    def silent(self) -> np.ndarray:
        """Which parts the drive does not put to the test."""
        size = np.abs(self.slopes)
        return size <= SILENT * np.max(size, initial=0.0)

    @property
    def capped(self) -> np.ndarray:
        """Which parts the derivatives would let be off by more than `WIDEST`."""
        return self.linear >= WIDEST * (1 - 1e-9)

    def width_text(self, i: int) -> str:
        """The tolerance of part `i`, in per cent and in its unit."""
        return f"± {100 * self.widths[i]:.3g} % (± {self.own_width(i)})"

    def own_width(self, i: int) -> str:
        """The tolerance of part `i` in its unit."""
        return quantity_text(float(self.widths[i] * abs(self.values[i])), self.units[i])

    def to_xarray(self) -> Any:
        """An `xarray.Dataset` over the parts."""
        import xarray as xr

        one = {"units": "1"}
        data = {
            "slope": ("part", self.slopes, {"units": self.unit}),
            "linear": ("part", self.linear, one),
            "width": ("part", self.widths, one),
            "value": ("part", self.values),
        }
        keys = ("metric", "unit", "limit", "nominal", "confidence", "share", "share_low",
                "share_high", "linear_share", "draws", "failed")  # fmt: skip
        attrs = {k: getattr(self, k) for k in keys}
        coords = {"part": list(self.parts), "part_unit": ("part", list(self.units))}
        return xr.Dataset(data, coords, attrs)

    @classmethod
    def from_xarray(cls, data: Any) -> "Tolerances":
        """The result of which `to_xarray` made `data`."""
        a = {k: v for k, v in data.attrs.items() if k != "kind"}
        numbers = {k: v if k in {"metric", "unit"} else float(v) for k, v in a.items()}
        numbers |= {k: int(a[k]) for k in ("draws", "failed")}
        parts, units = (texts(data, k) for k in ("part", "part_unit"))
        arrays = {
            "values": data["value"].values,
            "slopes": data["slope"].values,
            "linear": data["linear"].values,
        }
        return cls(parts=parts, units=units, widths=data["width"].values, **arrays, **numbers)  # pyright: ignore

    @styled
    def plot_widths(self, ax: Any = None) -> Any:
        """Tolerances as bars, tightest on top; capped ones paler."""
        order = np.argsort(-self.widths)
        ax = new_axes(ax, 1.4 + 0.27 * len(order))
        capped, place = self.capped[order], np.arange(len(order))
        colours = np.where(capped, PALETTE["sky"], PALETTE["blue"]).tolist()
        ax.barh(place, 100 * self.widths[order], color=colours, height=0.7)
        ax.set_yticks(place, [self.parts[i] for i in order])
        ax.grid(axis="y", visible=False)
        ax.set_xlabel("tolerance (± %)")
        ax.set_title(f"{self.metric} below {quantity_text(self.limit, self.unit)}")
        return ax
