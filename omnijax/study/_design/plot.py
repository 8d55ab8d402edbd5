"""Pictures of designs."""

from typing import Any

import numpy as np
from matplotlib.ticker import MaxNLocator

from ..._plot import MUTED, PALETTE, new_axes, styled
from ..._text import label, scaled

COLOURS = {
    "optimal": PALETTE["green"], "not optimal": PALETTE["orange"],
    "infeasible": PALETTE["vermillion"], "failed": PALETTE["black"],
}  # fmt: skip


@styled
def searches(result: Any, ax: Any = None) -> Any:
    """Where every search ended, by status, best first; the best design as a line."""
    ax = new_axes(ax)
    factor, unit = scaled(result.objective, result.unit)
    values = factor * np.array(result.ends["objective"], float)
    status = np.array(result.ends["status"])
    order = result.ranking
    for kind, colour in COLOURS.items():
        here = np.flatnonzero(status[order] == kind)
        if len(here):
            ax.plot(here + 1, values[order][here], "o", color=colour, label=kind)
    best = factor * result.objective
    ax.axhline(best, color=MUTED, linewidth=0.9)
    low, high = ax.get_ylim()
    room = 0.02 * abs(best)  # searches that agree shall look so
    ax.set_ylim(min(low, best - room), max(high, best + room))
    ax.ticklabel_format(axis="y", useOffset=False)
    ax.xaxis.set_major_locator(MaxNLocator(integer=True))
    ax.set_xlabel("search, best first")
    ax.set_ylabel(label(result.objective_name, unit))
    ax.set_title(f"{len(values)} searches: {result.status}")
    ax.legend()
    return ax


@styled
def gain(result: Any, ax: Any = None) -> Any:
    """The rig as it was against the design, in every case, in the objective's unit."""
    names = list(result.was["cases"])
    ax = new_axes(ax, 1.5 + 0.75 * len(names))
    factor, unit = scaled(result.was["new"], result.unit)
    place = np.arange(len(names))[::-1].astype(float)
    for shift, which, colour, said in (
        (0.2, 0, PALETTE["sky"], "your rig"), (-0.2, 1, PALETTE["blue"], "the design"),
    ):  # fmt: skip
        values = [factor * result.was["cases"][name][which] for name in names]
        bars = ax.barh(place + shift, values, 0.36, color=colour, label=said)
        ax.bar_label(bars, [f"{said}: {v:.4g}" for v in values], padding=4)
    ax.set_yticks(place, [n if len(names) > 1 else "" for n in names])
    ax.grid(axis="y", visible=False)
    ax.margins(x=0.3)
    ax.set_xlabel(label(result.nominal_case_name, unit))
    ax.set_title("What it brings")
    return ax


@styled
def cases(result: Any, ax: Any = None) -> Any:
    """The objective in every case."""
    names = list(result.cases)
    ax = new_axes(ax, 1.4 + 0.4 * len(names))
    factor, unit = scaled(result.objective, result.unit)
    place = np.arange(len(names))[::-1]
    ax.barh(place, factor * np.array(list(result.cases.values())), 0.7, color=PALETTE["blue"])
    ax.set_yticks(place, [n or "objective" for n in names])
    ax.grid(axis="y", visible=False)
    ax.set_xlabel(label(result.case_name, unit))
    return ax
