"""Axes in the unit that the reader thinks in: rpm, rad/s, Hz or orders of one wheel's rotation."""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, Locator, LogFormatter, LogLocator, MaxNLocator

from .._text import label
from ._style import raised, superscript

UNITS = ("rpm", "rad/s", "Hz", "orders")


@dataclass(frozen=True)
class SpeedAxis:
    """An x axis that holds a speed or an angular frequency in rad/s.

    `label` is its name without a unit, `unit` the one shown first, `reference` the rotation in
    rad/s that counts as order 1 (None: the axis is not offered in orders).
    """

    label: str
    unit: str = "rad/s"
    reference: float | None = None

    @property
    def units(self) -> tuple[str, ...]:
        """The units on offer."""
        return UNITS if self.reference else UNITS[:3]

    def factor(self, unit: str) -> float:
        """What a value in rad/s is multiplied by."""
        turns = {"rpm": 30 / math.pi, "rad/s": 1.0, "Hz": 0.5 / math.pi}
        return 1 / self.reference if unit == "orders" and self.reference else turns[unit]


class _Scaled(Locator):
    """Round ticks in a unit other than the data's."""

    def __init__(self, factor: float, inner: Locator):
        self.factor, self.inner = factor, inner

    def __call__(self):
        assert self.axis is not None
        return self.tick_values(*self.axis.get_view_interval())

    def tick_values(self, vmin, vmax):
        ticks = self.inner.tick_values(vmin * self.factor, vmax * self.factor)
        return np.asarray(ticks) / self.factor


def power_of_ten(value: float) -> str:
    """`value` as a label of a logarithmic axis: 0.001 to 1000 as they are, others as powers."""
    if value <= 0:
        return ""
    exponent = round(math.log10(value))
    if not math.isclose(value, 10.0**exponent, rel_tol=1e-6):
        return f"{value:g}"
    return f"{10.0**exponent:g}" if -4 < exponent < 4 else "10" + superscript(exponent)


def plain_labels(fig: Figure) -> None:
    """Raised powers in labels; logarithmic axes get labels without TeX: text in an SVG."""
    for ax in fig.axes:
        ax.set_xlabel(raised(ax.get_xlabel()))
        ax.set_ylabel(raised(ax.get_ylabel()))
        for axis in (ax.xaxis, ax.yaxis):
            formatter = axis.get_major_formatter()
            if isinstance(formatter, LogFormatter):
                axis.set_major_formatter(FuncFormatter(lambda v, _: power_of_ten(v)))
                axis.set_minor_formatter(FuncFormatter(lambda v, _: ""))


def _in_unit(ax: Axes, factor: float) -> None:
    log = ax.get_xscale() == "log"
    inner = LogLocator() if log else MaxNLocator(nbins=7, steps=[1, 2, 2.5, 5, 10])
    inner.set_axis(ax.xaxis)  # pyright: ignore[reportArgumentType]
    ax.xaxis.set_major_locator(_Scaled(factor, inner))
    show = power_of_ten if log else (lambda v: f"{v:.6g}".replace("-", "−"))
    ax.xaxis.set_major_formatter(FuncFormatter(lambda v, _: show(v * factor)))


@contextmanager
def shown_in(fig: Figure, axis: SpeedAxis, unit: str) -> Iterator[None]:
    """`fig` with its x axes in `unit` for the block."""
    panels = [ax for ax in fig.axes if ax.get_label() != "<colorbar>"]
    before = [
        (ax, ax.xaxis.get_major_locator(), ax.xaxis.get_major_formatter(), ax.get_xlabel())
        for ax in panels
    ]
    for ax in panels:
        _in_unit(ax, axis.factor(unit))
    lowest = min(panels, key=lambda ax: ax.get_position().y0)
    lowest.set_xlabel(label(axis.label, "" if unit == "orders" else unit))
    try:
        yield
    finally:
        for ax, locator, formatter, words in before:
            ax.xaxis.set_major_locator(locator)
            ax.xaxis.set_major_formatter(formatter)
            ax.set_xlabel(words)
