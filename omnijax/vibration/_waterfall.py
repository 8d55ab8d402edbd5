"""Pictures of orders: the map, the waterfall and the tracks."""

from typing import Any

import numpy as np

from .._plot import COLOURS, PALETTE, SCALES, new_axes, styled

OVER = {"time": "time (s)", "speed": "speed (rpm)"}


def _rows(result: Any, over: str) -> tuple[np.ndarray, np.ndarray]:
    """What stands on the axis of the windows, and their order along it."""
    if over not in OVER:
        raise ValueError(f"`over` must be time or speed, but is {over!r}.")
    values = getattr(result, over)
    return values, np.argsort(values, kind="stable")


def _label(result: Any) -> tuple[float, str]:
    factor, unit = SCALES.get(result.unit, (1.0, result.unit))
    return factor, f"{name_of(result.channel)}, {result.kind} ({unit})"


def _unit(result: Any) -> str:
    return SCALES.get(result.unit, (1.0, result.unit))[1]


def name_of(channel: str) -> str:
    """The channel as it is written in formulas."""
    return "|ΔR|" if channel == "distance" else channel.replace("dR", "ΔR")


@styled
def plot_map(result: Any, *, ax: Any = None, over: str = "time") -> Any:
    """Orders to the right, time or speed upwards, amplitude as colour; grey cannot be told."""
    ax = new_axes(ax)
    values, order = _rows(result, over)
    factor, label = _label(result)
    ax.set_facecolor("#d8dde3")
    where = np.maximum.accumulate(values[order] + 1e-12 * np.arange(len(values)))
    if len(where) == 1:  # a picture needs two rows
        where, order = np.array([where[0] - 0.5, where[0] + 0.5]), np.repeat(order, 2)
    shown = np.ma.masked_invalid(factor * result.amplitude[order])
    mesh = ax.pcolormesh(result.orders, where, shown, cmap="cividis", shading="nearest", vmin=0)
    mesh.set_rasterized(True)
    ax.figure.colorbar(mesh, ax=ax, label=label)
    ax.set_xlabel(f"order of {result.reference}")
    ax.set_ylabel(OVER[over])
    ax.grid(False)
    return ax


@styled
def plot_spectrum(result: Any, *, ax: Any = None) -> Any:
    """The whole run's amplitude over the orders; returns the axes."""
    ax = new_axes(ax)
    factor, label = _label(result)
    ax.plot(result.orders, factor * result.spectrum(), color=COLOURS[0], lw=1.2)
    ax.set_xlabel(f"order of {result.reference}")
    ax.set_ylabel(label)
    ax.set_ylim(bottom=0)
    return ax


@styled
def plot_waterfall(result: Any, *, ax: Any = None, count: int = 24) -> Any:
    """Up to `count` spectra, each above the one before it; the scale stands beside the first."""
    ax = new_axes(ax)
    factor, _ = _label(result)
    pick = np.unique(np.linspace(0, len(result.time) - 1, count).astype(int))
    shown = factor * result.amplitude[pick]
    top = np.nanmax(shown, initial=0.0) or 1.0
    span = max(float(result.time[pick[-1]] - result.time[pick[0]]), 1e-9)
    height = 3 * span / len(pick) / top  # seconds on the axis for one unit of amplitude
    for i in range(len(pick))[::-1]:
        base = result.time[pick[i]]
        line = base + height * shown[i]
        ax.fill_between(result.orders, base, line, color="white", zorder=-i, lw=0)
        ax.plot(result.orders, line, color=COLOURS[0], lw=0.9, zorder=-i)
    ax.set_xlabel(f"order of {result.reference}")
    ax.set_ylabel("time (s)")
    ax.set_title(f"{name_of(result.channel)} at {len(pick)} times")
    size = float(f"{0.6 * top:.1g}")  # a bar as long as a round amplitude
    edge = 1.02 * result.orders[-1]
    ax.plot([edge, edge], [result.time[pick[0]], result.time[pick[0]] + height * size], lw=3,
            color=PALETTE["black"], clip_on=False, solid_capstyle="butt")  # fmt: skip
    ax.annotate(f"{size:g} {_unit(result)}", (edge, result.time[pick[0]] + height * size / 2),
                (5, 0), textcoords="offset points", va="center", annotation_clip=False)  # fmt: skip
    return ax


@styled
def plot_track(result: Any, *, ax: Any = None, over: str = "time") -> Any:
    """Amplitude of each order; dashed where the sampling alone cannot tell it from another."""
    ax = new_axes(ax)
    values, order = _rows(result, over)
    factor, label = _label(result)
    for i, number in enumerate(result.orders):
        colour, amplitude = COLOURS[i % len(COLOURS)], factor * result.amplitude[order, i]
        for hidden, style in ((False, "-"), (True, "--")):
            part = np.where(result.aliased[order, i] == hidden, amplitude, np.nan)
            name = f"order {number:.4g}" if hidden == bool(result.aliased[:, i].all()) else None
            ax.plot(values[order], part, style, color=colour, label=name, marker=".", ms=3)
    ax.set_xlabel(OVER[over])
    ax.set_ylabel(label)
    ax.set_ylim(bottom=0)
    ax.legend(title=f"of {result.reference}", frameon=False)
    return ax
