"""What an order analysis returns: the map over orders and time, and single orders over time."""

import dataclasses
from typing import Any, ClassVar

import numpy as np

from .._result import AbstractResult


@dataclasses.dataclass(frozen=True, repr=False)
class OrderMap(AbstractResult):
    """Amplitude of every order in every window; `aliased` marks what the sampling cannot tell.

    Aliased cells are NaN: there the line of another order would show, folded back.

    `amplitude` (windows, orders) is in the channel's unit, `time` in s, `speed` in rpm.
    """

    channel: str
    unit: str
    reference: str
    orders: np.ndarray  # (k,)
    time: np.ndarray  # s, middle of the windows, (m,)
    speed: np.ndarray  # rpm of the reference, (m,)
    amplitude: np.ndarray  # of the kind, in `unit`, (m, k)
    aliased: np.ndarray  # (m, k)
    kind: str = "peak"  # of the sine: its peak, its rms, or its power (mean square)

    file_kind: ClassVar[str] = "omnijax order map"
    what: ClassVar[str] = "map of orders"

    @property
    def turns(self) -> float:
        """Length of a window in turns, of the run's own at most half; 4 orders for each 1/turns."""
        return 0.25 / float(self.orders[1] - self.orders[0])

    def spectrum(self) -> np.ndarray:
        """The whole run's amplitude at each order (k,): the root mean square over the windows.

        Of powers it is their mean, as MATLAB's `orderspectrum` averages.
        """
        power = 1 if self.kind == "power" else 2
        raised = np.where(np.isfinite(self.amplitude), self.amplitude, 0.0) ** power
        seen = np.maximum((~self.aliased).sum(axis=0), 1)
        return (raised.sum(axis=0) / seen) ** (1 / power)

    def strongest(self, count: int = 5) -> list[tuple[float, float]]:
        """The highest peaks of the `spectrum` (order, amplitude), largest first."""
        level = self.spectrum()
        inner = level[1:-1]
        peaks = 1 + np.flatnonzero((inner >= level[:-2]) & (inner > level[2:]))
        best = peaks[np.argsort(-level[peaks])][:count]
        return [(float(self.orders[i]), float(level[i])) for i in best]

    def plot(self, *, ax: Any = None, over: str = "time") -> Any:
        """The map as a picture, orders to the right; returns the axes."""
        from ._waterfall import plot_map

        return plot_map(self, ax=ax, over=over)

    def plot_spectrum(self, *, ax: Any = None) -> Any:
        """The whole run's amplitude over the orders; returns the axes."""
        from ._waterfall import plot_spectrum

        return plot_spectrum(self, ax=ax)

    def plot_waterfall(self, *, ax: Any = None) -> Any:
        """One spectrum above the other, as time goes on; returns the axes."""
        from ._waterfall import plot_waterfall

        return plot_waterfall(self, ax=ax)

    def sentences(self) -> list[str]:
        """How large the map is, and the strongest orders."""
        top = ", ".join(f"{order:.3g}" for order, _ in self.strongest(3))
        shape = f"{len(self.time)} windows, {len(self.orders)} orders of {self.reference}"
        return [f"OrderMap({self.channel}: {shape}; strongest {top})"]

    def table(self):
        """The strongest orders."""
        rows = [(order, level) for order, level in self.strongest(8)]
        title = f"{self.channel} over the orders of {self.reference}"
        return title, rows, ("order", f"{self.kind} amplitude ({self.unit})")

    def to_xarray(self) -> Any:
        """Amplitude over time and order as an `xarray.Dataset`, with the speed beside."""
        return _dataset(self, {"amplitude": (self.amplitude, self.unit)})

    @classmethod
    def from_xarray(cls, data):
        """The map of which `to_xarray` made `data`."""
        return _of_dataset(cls, data)


@dataclasses.dataclass(frozen=True, repr=False)
class OrderTrack(AbstractResult):
    """Amplitude and phase of chosen orders in every window, fitted together.

    `amplitude` (windows, orders) is in the channel's unit, `phase` in rad, `time` in s.
    """

    channel: str
    unit: str
    reference: str
    orders: np.ndarray  # (k,)
    time: np.ndarray  # s, (m,)
    speed: np.ndarray  # rpm, (m,)
    amplitude: np.ndarray  # in `unit`, (m, k)
    phase: np.ndarray  # rad, of amplitude cos(o theta + phase), (m, k)
    aliased: np.ndarray  # (m, k): a lower order would fit as well if the speed stayed the same
    kind: str = "peak"  # as in `OrderMap`

    file_kind: ClassVar[str] = "omnijax order track"
    what: ClassVar[str] = "track of orders"

    def plot(self, *, ax: Any = None, over: str = "time") -> Any:
        """One curve an order, over `time` or `speed`; returns the axes."""
        from ._waterfall import plot_track

        return plot_track(self, ax=ax, over=over)

    def sentences(self) -> list[str]:
        """Which orders, of what, in how many windows."""
        names = ", ".join(f"{order:g}" for order in self.orders)
        about = f"orders {names} of {self.reference}, {len(self.time)} windows"
        return [f"OrderTrack({self.channel}: {about})"]

    def table(self):
        """Mean and largest amplitude of each order."""
        rows = [
            (order, float(np.nanmean(level)), float(np.nanmax(level)))
            for order, level in zip(self.orders.tolist(), self.amplitude.T, strict=True)
        ]
        title = f"Orders of {self.reference} in {self.channel}"
        return title, rows, ("order", f"mean ({self.unit})", f"largest ({self.unit})")

    def to_xarray(self) -> Any:
        """Amplitude and phase over time and order as an `xarray.Dataset`."""
        figures = {"amplitude": (self.amplitude, self.unit), "phase": (self.phase, "rad")}
        return _dataset(self, figures)

    @classmethod
    def from_xarray(cls, data):
        """The track of which `to_xarray` made `data`."""
        return _of_dataset(cls, data)


def _dataset(result: "OrderMap | OrderTrack", figures: dict[str, tuple[np.ndarray, str]]) -> Any:
    import xarray

    dims = ("time", "order")
    variables: dict[str, Any] = {
        name: (dims, value, {"units": unit}) for name, (value, unit) in figures.items()
    }
    variables["aliased"] = (dims, result.aliased, {"long_name": "beyond half the sampling rate"})
    variables["speed"] = ("time", result.speed, {"units": "rpm"})
    return xarray.Dataset(
        variables,
        coords={"time": ("time", result.time, {"units": "s"}), "order": result.orders},
        attrs={name: getattr(result, name) for name in ("channel", "reference", "unit")}
        | {"amplitude_kind": result.kind},
    )


def _of_dataset(cls: Any, data: Any) -> Any:
    fields = {field.name for field in dataclasses.fields(cls)}
    arrays = {name: data[name].values for name in fields & {*data.data_vars, "time"}}
    words = {name: str(data.attrs[name]) for name in ("channel", "reference", "unit")}
    kind = str(data.attrs["amplitude_kind"])
    return cls(**words, **arrays, orders=data["order"].values, kind=kind)
