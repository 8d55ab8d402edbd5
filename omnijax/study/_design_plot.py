"""Pictures of designs."""

from typing import Any

import numpy as np

from ._sensitivity_plot import new_axes

COLOURS = {
    "optimal": "#009E73", "not optimal": "#E69F00", "infeasible": "#D55E00", "failed": "#222222"
}  # fmt: skip


def searches(result: Any, ax: Any = None) -> Any:
    """Where every search ended, by status, best first; the best design as a line."""
    ax = new_axes(ax)
    values = np.array(result.ends["objective"], float)
    status = np.array(result.ends["status"])
    order = np.argsort(np.where(np.isfinite(values), values, np.inf))
    for kind, colour in COLOURS.items():
        here = np.flatnonzero(status[order] == kind)
        if len(here):
            ax.plot(here + 1, values[order][here], "o", color=colour, label=kind)
    ax.axhline(result.objective, color="#57606a", linewidth=0.9)
    unit = "" if result.unit == "1" else f" ({result.unit})"
    ax.set_xlabel("search, best first")
    ax.set_ylabel(f"{result.objective_name}{unit}")
    ax.set_title(f"{len(values)} searches: {result.status}")
    ax.legend()
    return ax


def cases(result: Any, ax: Any = None) -> Any:
    """The objective in every case."""
    names = list(result.cases)
    ax = new_axes(ax, 1.4 + 0.4 * len(names))
    place = np.arange(len(names))[::-1]
    ax.barh(place, list(result.cases.values()), 0.7, color="#0072B2")
    ax.set_yticks(place, [n or "objective" for n in names])
    ax.grid(axis="y", visible=False)
    ax.set_xlabel(f"{result.objective_name} ({result.unit})")
    return ax
