"""Pictures of sensitivities."""

from typing import Any

import numpy as np

from ..._plot import MUTED, PALETTE, new_axes, styled

BARS = 14
LEAST = 1e-3  # of the longest bar: shorter ones are left out


@styled
def tornado(result: Any, metric: str, together: bool = False, ax: Any = None) -> Any:
    """Relative sensitivities as bars, largest on top; what has next to none is left out."""
    from ..._text import quantity_text

    pairs = result.together(metric) if together else result.column(metric)
    least = LEAST * max(map(abs, pairs.values()), default=0.0)
    shown = [(path, value) for path, value in pairs.items() if abs(value) > least][:BARS]
    ax = new_axes(ax, 1.4 + 0.27 * len(shown))
    place = np.arange(len(shown))[::-1]
    values = [value for _, value in shown]
    colours = [PALETTE["vermillion"] if value > 0 else PALETTE["blue"] for value in values]
    ax.barh(place, values, color=colours, height=0.7)
    for y, value in zip(place, values, strict=True):
        text = f"{value:+.3g}".replace("-", "−")
        ax.annotate(
            text, (value, y), (4 if value >= 0 else -4, 0), fontsize=8.5,
            textcoords="offset points", va="center", ha="left" if value >= 0 else "right",
        )  # fmt: skip
    ax.set_yticks(place, [path for path, _ in shown])
    ax.axvline(0, color=MUTED, linewidth=0.8)
    ax.margins(x=0.3)  # for the numbers, on a telephone too
    ax.grid(axis="y", visible=False)
    figure = result.figures[result.metrics.index(metric)]
    unit = result.metric_units[result.metrics.index(metric)]
    ax.set_title(f"{metric} = {quantity_text(figure, unit)}")
    ax.set_xlabel(f"change of {metric} in % per % of the parameter")
    return ax
