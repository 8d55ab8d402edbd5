"""Pictures of a run: `trajectory.plot_displacement()` and `.plot_channels()`."""

from typing import Any

import numpy as np

from .._plot import COLOURS, SCALES, new_axes, styled
from ._run import PER_WHEEL, AbstractRun

LABELS = {"dR": "ΔR", "dR_elastic": "elastic ΔR", "theta": "θ", "Omega": "Ω", "omega": "ω"}
LARGE = ("R_l", "V_l")  # the platform's way is metres, not micrometres


@styled
def plot_displacement(trajectory: AbstractRun, *, ax: Any = None) -> Any:
    """Components and length of ΔR in µm over time; returns the axes."""
    ax = plot_channel(trajectory, "dR", ax=ax)
    factor, _ = channel_scale(trajectory, "dR")
    size = factor * np.asarray(trajectory.distance)
    ax.plot(trajectory.t, size, color="#222222", lw=1.0, ls="--", label="|ΔR|")
    _legend(ax)
    return ax


@styled
def plot_channel(trajectory: AbstractRun, name: str, *, ax: Any = None) -> Any:
    """One channel over time, one line a component or wheel; returns the axes.

    Raises `ValueError` where the run has no such channel.
    """
    if name not in trajectory.UNITS or name == "t":
        raise ValueError(f"`name` must be one of {sorted(trajectory.UNITS)}, but is {name!r}.")
    ax = new_axes(ax, 3.2)
    values = getattr(trajectory, name)
    factor, shown = channel_scale(trajectory, name)
    values = factor * np.asarray(values)
    ends = "xyz" if values.shape[1] == 3 and name not in PER_WHEEL else trajectory.names
    ends = "wxyz" if name == "attitude" else ends
    for i, end in enumerate(ends):
        ax.plot(
            trajectory.t,
            values[:, i],
            lw=1.0,
            alpha=0.9,
            color=COLOURS[i % len(COLOURS)],
            label=end,
        )
    ax.set_xlabel("time (s)")
    ax.set_ylabel(f"{LABELS.get(name, name.replace('_', ' '))} ({shown})")
    _legend(ax)
    return ax


def channel_scale(trajectory: AbstractRun, name: str) -> tuple[float, str]:
    """Factor and unit of a channel's axis: micrometres, but what is larger in mm or m."""
    unit, values = trajectory.UNITS[name], getattr(trajectory, name)
    if name in LARGE:
        return 1.0, unit
    largest = float(np.max(np.abs(np.asarray(values)), where=np.isfinite(values), initial=0.0))
    if unit == "m" and largest >= 3e-3:
        return (1e3, "mm") if largest < 3 else (1.0, "m")
    return SCALES.get(unit, (1.0, unit))


def _legend(ax: Any) -> None:
    """Above the axes, in one line: the width belongs to the curves."""
    columns = len(ax.get_legend_handles_labels()[1])
    ax.legend(
        loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=columns, frameon=False,
        borderaxespad=0.1, handlelength=1.4, columnspacing=1.2,
    )  # fmt: skip


@styled
def figure_of_run(trajectory: AbstractRun) -> Any:
    """A figure with the four panels of `plot_run`."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8, 8), layout="constrained")
    plot_run(trajectory, figure.subplots(4, sharex=True))
    return figure


def plot_run(trajectory: AbstractRun, axes: Any) -> None:
    """ΔR, its elastic part, Ω and the platform's acceleration, one below the other."""
    plot_displacement(trajectory, ax=axes[0])
    for name, ax in zip(("dR_elastic", "Omega", "a"), axes[1:], strict=True):
        plot_channel(trajectory, name, ax=ax)
        if ax.get_legend() is not None:
            ax.get_legend().remove()  # x, y, z as in the panel above
    for ax in axes[:-1]:
        ax.set_xlabel("")
