"""Picture of a sweep of an axis: a misfit over one of the numbers that were varied."""

from typing import Any

import numpy as np

from ..._plot import new_axes, styled
from ..._text import label, path_words, scaled


@styled
def plot_designs(
    path: str, values: np.ndarray, unit: str, metric: str, figures: np.ndarray, of: str, *, ax: Any
) -> Any:
    """Figures (designs,) in the unit `of` over values (designs,) in `unit`; returns the axes.

    A point a design; one whose run left all bounds has none.
    """
    ax = new_axes(ax, width=6.4)
    (across, wide), (up, high) = (
        scaled(float(np.max(np.abs(x), where=np.isfinite(x), initial=0.0)), u)
        for x, u in ((values, unit), (figures, of))
    )
    ax.plot(across * values, up * figures, ".")
    ax.set(xlabel=label(path_words(path), wide), ylabel=label(metric, high))
    ax.set_title(f"{metric} over {path_words(path)}")
    return ax
