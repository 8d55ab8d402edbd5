"""Pictures of a sweep: heat maps over two parameters, families of lines over one."""

import math
from typing import Any

import numpy as np
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter

from ..._errors import InputError
from ..._plot import PALETTE, new_axes, styled
from ..._text import label, path_words, quantity_text
from .._points import Grid

MARKS = ("-", "--", "-.", ":")
LINES = 8  # of one family
HATCH = "////"  # of designs that slip or lift off


def _label(result: Any, name: str) -> str:
    _, unit = result.readable(name)
    return label(name if name in result.spec.metrics else path_words(name), unit)


def _ticks(axis: Any, levels: np.ndarray, log: bool) -> None:
    """Plain numbers; on a logarithmic axis of few decades also between the powers of ten."""
    if not log:
        axis.set_major_locator(MaxNLocator(6))
        return
    decades = math.log10(levels.max() / levels.min())
    axis.set_major_locator(LogLocator(subs=(1, 2, 5) if decades < 3 else (1,)))
    axis.set_minor_formatter(NullFormatter())
    if decades < 4:
        axis.set_major_formatter(FuncFormatter(lambda v, _: f"{v:.4g}"))


def _slice(result: Any, metric: str, kept: tuple[int, ...]) -> tuple[np.ndarray, str]:
    """Values over the kept axes, the others at their first level, and the words that say so."""
    values, axes = result.readable(metric)[0] * result[metric], result.points.axes
    held = ", ".join(
        f"{path_words(axis.path)} {quantity_text(float(axis.level(0)), axis.unit)}"
        for i, axis in enumerate(axes) if i not in kept
    )  # fmt: skip
    return _kept(values, kept), held


def _index(result: Any, path: str | None, default: int, metric: str) -> int:
    names = [axis.path for axis in result.points.axes]
    if path is None:
        return default
    if path not in names:
        raise InputError(f"`{path}` is not varied in this sweep, which varies {', '.join(names)}.")
    return names.index(path)


@styled
def heatmap(result: Any, metric: str, x: str | None = None, y: str | None = None, *, ax=None):
    """`metric` in colour over two axes of a grid; designs without figures stay white."""
    if not isinstance(result.points, Grid) or len(result.points.axes) < 2:
        raise InputError("a heat map needs a grid over two parameters: use `plot_lines`.")
    i, j = _index(result, x, 0, metric), _index(result, y, 1, metric)
    j = (i + 1) % len(result.points.axes) if i == j else j
    ax, axes = new_axes(ax, width=6.4), result.points.axes
    values, held = _slice(result, metric, (i, j))
    across, up = (result.readable(axes[k].path)[0] * axes[k].levels() for k in (i, j))
    order = np.argsort(across), np.argsort(up)
    shown = np.ma.masked_invalid(values[np.ix_(*order)].T)
    edges = _edges(across[order[0]], axes[i].log), _edges(up[order[1]], axes[j].log)
    image = ax.pcolormesh(*edges, shown, cmap="cividis", rasterized=True)  # cells without seams
    ax.grid(False)
    ax.figure.colorbar(image, ax=ax, label=_label(result, metric))
    for k, levels, scale, axis in (
        (i, across, ax.set_xscale, ax.xaxis), (j, up, ax.set_yscale, ax.yaxis),
    ):  # fmt: skip
        if axes[k].log:
            scale("log")
        _ticks(axis, levels, axes[k].log)
    ax.set(xlabel=_label(result, axes[i].path), ylabel=_label(result, axes[j].path))
    ax.set_title(f"{metric}; {held}" if held else metric)
    loose = ~_kept(result.held(), (i, j))[np.ix_(*order)].T
    if loose.any():
        _marked(ax, edges, loose)
    return ax


def _kept(values: np.ndarray, kept: tuple[int, ...]) -> np.ndarray:
    """An array of the grid's shape over the kept axes, the others at their first level."""
    values = np.moveaxis(values, kept, range(len(kept)))
    return values[(..., *(0 for _ in range(values.ndim - len(kept))))]


def _marked(ax: Any, edges: tuple[np.ndarray, np.ndarray], loose: np.ndarray) -> None:
    """Hatching over the cells that slip or lift off, and what it means."""
    from matplotlib.patches import Patch, Rectangle

    look: dict[str, Any] = {
        "hatch": HATCH,
        "facecolor": "none",
        "edgecolor": PALETTE["vermillion"],
        "lw": 0,
    }
    x, y = edges
    for row, column in np.argwhere(loose).tolist():
        (left, right), (low, high) = x[column : column + 2].tolist(), y[row : row + 2].tolist()
        ax.add_patch(Rectangle((left, low), right - left, high - low, **look))
    sample = Patch(hatch=HATCH, facecolor="none", edgecolor=PALETTE["vermillion"], lw=0)
    ax.legend(
        [sample], ["a wheel slips or lifts off"], loc="upper left", bbox_to_anchor=(0, -0.16),
        frameon=False, borderaxespad=0.1,
    )  # fmt: skip


def _edges(levels: np.ndarray, log: bool) -> np.ndarray:
    """Borders of the cells around `levels`, half way between them (in their logarithm)."""
    x = np.log(levels) if log else levels
    inner = (x[1:] + x[:-1]) / 2
    margin = (x[1] - x[0], x[-1] - x[-2]) if len(x) > 1 else (abs(x[0]) or 1.0,) * 2
    x = np.concatenate([[x[0] - margin[0] / 2], inner, [x[-1] + margin[1] / 2]])
    return np.exp(x) if log else x


@styled
def lines(result: Any, metric: str, x: str | None = None, hue: str | None = None, *, ax=None):
    """`metric` over one axis, one line a level of `hue`; a cloud of points for samples.

    Designs that slip or lift off are ringed.
    """
    ax, axes = new_axes(ax, width=6.4), result.points.axes
    i = _index(result, x, 0, metric)
    ax.set(xlabel=_label(result, axes[i].path), ylabel=_label(result, metric))
    factor = result.readable(axes[i].path)[0]
    if axes[i].log:
        ax.set_xscale("log")
    if not isinstance(result.points, Grid):
        values, across = result.readable(metric)[0] * result[metric], result[axes[i].path]
        ax.plot(factor * across, values, ".", markersize=3)
        _ticks(ax.xaxis, factor * across, axes[i].log)
        _ringed(ax, factor * across, values, ~result.held())
        ax.set_title(f"{metric} over {path_words(axes[i].path)}")
        return ax
    j = _index(result, hue, 1 if i == 0 else 0, metric) if len(axes) > 1 else None
    kept = (i,) if j is None or j == i else (i, j)
    values, held = _slice(result, metric, kept)
    across = factor * axes[i].levels()
    order = np.argsort(across)
    loose = ~_kept(result.held(), kept)
    _ticks(ax.xaxis, across, axes[i].log)
    if values.ndim == 1:
        ax.plot(across[order], values[order], marker=".")
    else:
        shown = _family(ax, across[order], values[order], result, axes[j])
        loose = loose & np.isin(np.arange(loose.shape[1]), shown)
    wide = np.broadcast_to(across.reshape(-1, *(1 for _ in kept[1:])), values.shape)
    _ringed(ax, wide, values, loose)
    ax.set_title(f"{metric}; {held}" if held else metric)
    return ax


def _ringed(ax: Any, across: np.ndarray, values: np.ndarray, loose: np.ndarray) -> None:
    """Rings around the designs that slip or lift off."""
    if loose.any():
        ax.plot(
            across[loose], values[loose], "o", ms=8, mfc="none", mec=PALETTE["vermillion"],
            label="a wheel slips or lifts off", ls="",
        )  # fmt: skip
        title = ax.get_legend().get_title().get_text() if ax.get_legend() else None
        ax.legend(title=title)


def _family(ax: Any, across, values, result: Any, axis: Any) -> np.ndarray:
    """One line for each of at most `LINES` levels of `axis`, which are returned."""
    import matplotlib as mpl

    shown = np.unique(np.linspace(0, axis.count - 1, min(LINES, axis.count)).round().astype(int))
    factor, _ = result.readable(axis.path)
    for k, level in enumerate(shown):
        colour = mpl.colormaps["cividis"](k / max(len(shown) - 1, 1) * 0.9)
        text = f"{factor * float(axis.level(level)):.4g}"
        ax.plot(across, values[:, level], MARKS[k % len(MARKS)], color=colour, label=text)
    ax.legend(title=_label(result, axis.path))
    return shown
