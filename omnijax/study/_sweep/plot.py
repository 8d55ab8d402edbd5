"""Pictures of a sweep: heat maps over two parameters, families of lines over one."""

from typing import Any

import numpy as np

from ..._errors import InputError
from ..._plot import new_axes
from .._points import Grid

MARKS = ("-", "--", "-.", ":")
LINES = 8  # of one family
CELLS = 5000  # of a heat map, from which a vector file holds it as a picture


def _label(result: Any, name: str) -> str:
    _, unit = result.readable(name)
    return name if unit in {"", "1"} else f"{name} ({unit})"


def _slice(result: Any, metric: str, kept: tuple[int, ...]) -> tuple[np.ndarray, str]:
    """Values over the kept axes, the others at their first level, and the words that say so."""
    values, axes = result.readable(metric)[0] * result[metric], result.points.axes
    others = [i for i in range(len(axes)) if i not in kept]
    values = np.moveaxis(values, kept, range(len(kept)))
    values = values[(..., *(0 for _ in others))] if others else values
    held = ", ".join(f"{axes[i].path} = {float(axes[i].level(0)):.4g}" for i in others)
    return values, held


def _index(result: Any, path: str | None, default: int, metric: str) -> int:
    names = [axis.path for axis in result.points.axes]
    if path is None:
        return default
    if path not in names:
        raise InputError(f"`{path}` is not varied in this sweep, which varies {', '.join(names)}.")
    return names.index(path)


def heatmap(result: Any, metric: str, x: str | None = None, y: str | None = None, *, ax=None):
    """`metric` in colour over two axes of a grid; designs without figures stay white."""
    if not isinstance(result.points, Grid) or len(result.points.axes) < 2:
        raise InputError("a heat map needs a grid over two parameters: use `plot_lines`.")
    i, j = _index(result, x, 0, metric), _index(result, y, 1, metric)
    j = (i + 1) % len(result.points.axes) if i == j else j
    ax, axes = new_axes(ax, width=6.4), result.points.axes
    values, held = _slice(result, metric, (i, j))
    across, up = (axes[k].levels() for k in (i, j))
    order = np.argsort(across), np.argsort(up)
    shown = np.ma.masked_invalid(values[np.ix_(*order)].T)
    edges = _edges(across[order[0]], axes[i].log), _edges(up[order[1]], axes[j].log)
    image = ax.pcolormesh(*edges, shown, cmap="cividis", rasterized=shown.size > CELLS)
    ax.grid(False)
    ax.figure.colorbar(image, ax=ax, label=_label(result, metric))
    for axis, k in ((ax.set_xscale, i), (ax.set_yscale, j)):
        if axes[k].log:
            axis("log")
    ax.set(xlabel=_label(result, axes[i].path), ylabel=_label(result, axes[j].path), title=held)
    return ax


def _edges(levels: np.ndarray, log: bool) -> np.ndarray:
    """Borders of the cells around `levels`, half way between them (in their logarithm)."""
    x = np.log(levels) if log else levels
    inner = (x[1:] + x[:-1]) / 2
    margin = (x[1] - x[0], x[-1] - x[-2]) if len(x) > 1 else (abs(x[0]) or 1.0,) * 2
    x = np.concatenate([[x[0] - margin[0] / 2], inner, [x[-1] + margin[1] / 2]])
    return np.exp(x) if log else x


def lines(result: Any, metric: str, x: str | None = None, hue: str | None = None, *, ax=None):
    """`metric` over one axis, one line a level of `hue`; a cloud of points for samples."""
    ax, axes = new_axes(ax, width=6.4), result.points.axes
    i = _index(result, x, 0, metric)
    ax.set(xlabel=_label(result, axes[i].path), ylabel=_label(result, metric))
    if axes[i].log:
        ax.set_xscale("log")
    if not isinstance(result.points, Grid):
        values = result.readable(metric)[0] * result[metric]
        ax.plot(result[axes[i].path], values, ".", markersize=3)
        return ax
    j = _index(result, hue, 1 if i == 0 else 0, metric) if len(axes) > 1 else None
    values, held = _slice(result, metric, (i,) if j is None or j == i else (i, j))
    across = axes[i].levels()
    order = np.argsort(across)
    if values.ndim == 1:
        ax.plot(across[order], values[order], marker=".")
    else:
        _family(ax, across[order], values[order], axes[j], _label(result, axes[j].path))
    ax.set_title(held)
    return ax


def _family(ax: Any, across, values, axis, label: str) -> None:
    import matplotlib as mpl

    shown = np.unique(np.linspace(0, axis.count - 1, min(LINES, axis.count)).round().astype(int))
    for k, level in enumerate(shown):
        colour = mpl.colormaps["cividis"](k / max(len(shown) - 1, 1) * 0.9)
        text = f"{float(axis.level(level)):.4g}"
        ax.plot(across, values[:, level], MARKS[k % len(MARKS)], color=colour, label=text)
    ax.legend(title=label, fontsize="small", title_fontsize="small")
