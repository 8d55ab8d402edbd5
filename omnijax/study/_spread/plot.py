"""Pictures of global sensitivities."""

from typing import Any

import numpy as np

from ..._plot import PALETTE, new_axes, styled


@styled
def indices(result: Any, metric: str, ax: Any = None) -> Any:
    """First and total Sobol indices with 95 % intervals; a mark at the gradients' bound.

    A share lies in [0, 1], and so does what is drawn of an interval or of a bad estimate.
    """
    m = result.metrics.index(metric)
    order = np.argsort(result.sobol.total[m])
    ax = new_axes(ax, 1.6 + 0.42 * len(order))
    place = np.arange(len(order))
    style = {"height": 0.36, "error_kw": {"elinewidth": 1.0, "ecolor": PALETTE["black"]}}
    first, total = result.sobol.first[m, order], result.sobol.total[m, order]
    ax.barh(
        place + 0.19, _share(total), xerr=_within(total, result.sobol.total_half[m, order]),
        color=PALETTE["blue"], label="total", **style,
    )  # fmt: skip
    ax.barh(
        place - 0.19, _share(first), xerr=_within(first, result.sobol.first_half[m, order]),
        color=PALETTE["sky"], label="first order", **style,
    )  # fmt: skip
    bound = np.minimum(result.bound[m, order], 1.0)
    ax.plot(bound, place + 0.19, "|", color=PALETTE["vermillion"], ms=14, label="bound")
    ax.set_yticks(place, [result.inputs[i] for i in order])
    ax.grid(axis="y", visible=False)
    ax.set_xlabel(f"share of the variance of {metric}")
    ax.set_xlim(0.0, 1.02)
    _legend_above(ax, 3)
    return ax


@styled
def convergence(result: Any, metric: str, ax: Any = None) -> Any:
    """Total indices as blocks are added, with the final 95 % interval."""
    m, ax = result.metrics.index(metric), new_axes(ax)
    for i, name in enumerate(result.inputs):
        totals = _share(result.sobol.total_stages[:, m, i])
        (line,) = ax.plot(result.sobol.stages, totals, "o-", ms=4, label=name, clip_on=False)
        middle, half = result.sobol.total[m, i], result.sobol.total_half[m, i]
        ax.axhspan(*_share(middle + half * np.array([-1, 1])), color=line.get_color(), alpha=0.12)
    ax.set_xscale("log", base=2)
    ax.set_xlabel("blocks of runs")
    ax.set_ylabel(f"share of the variance of {metric}")
    ax.set_ylim(0.0, 1.02)
    _legend_above(ax, 2)
    return ax


def _share(values: Any) -> np.ndarray:
    """The nearest shares: estimates of few blocks can lie outside of [0, 1]."""
    return np.clip(values, 0.0, 1.0)


def _within(values: np.ndarray, half: np.ndarray) -> np.ndarray:
    """Lengths (2, k) of the intervals below and above the bars, as far as they lie in [0, 1]."""
    return np.abs(_share(np.stack([values - half, values + half])) - _share(values))


def _legend_above(ax: Any, columns: int) -> None:
    """Beside the bars and lines there is no room that is always free."""
    ax.legend(
        loc="lower left", bbox_to_anchor=(0, 1), ncols=columns, frameon=False, borderaxespad=0.1,
        handlelength=1.4, columnspacing=1.2,
    ).set_gid("above")  # fmt: skip
