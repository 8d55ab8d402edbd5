"""A page of signals over time: a run without a scene."""

import textwrap
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from .._text import quantity_text
from ._content import Figure, Provenance, Section
from ._page import Page
from ._style import figure, legend_above, raised, style

LETTERS = 20  # of a label that stand beside one another along an ordinate

Signal = tuple[str, str, Mapping[str, tuple[Any, Any]]]  # word, unit, curves (times, values)


def signals_page(title: str, signals: Sequence[Signal], made: Provenance) -> Page:
    """The page of a run's signals, one below the other on one clock.

    A signal is (word, unit, curves by name); the second, measured less simulated, is the answer.
    """
    with style():
        fig, axes = figure(len(signals), height=0.9 + 1.5 * len(signals))
        data: dict[str, Any] = {}
        for ax, (word, unit, curves) in zip(axes, signals, strict=True):
            for k, (name, (t, x)) in enumerate(curves.items()):
                ax.plot(t, x, color=f"C{k}", label=name or None, lw=1.2 if k == 0 else 0.8)
                data.setdefault("time / s", t)
                data[f"{word} {name}".strip() + f" / {unit}"] = x
            ax.set_ylabel(raised(textwrap.fill(f"{word} / {unit}", LETTERS)), fontsize="small")
            if len(curves) > 1:
                legend_above(ax)
        axes[-1].set_xlabel("time / s")
    word, unit, curves = signals[1]
    error = np.asarray(next(iter(curves.values()))[1])
    answer = (
        f"{word[0].upper()}{word[1:]}: RMS {quantity_text(float(np.sqrt(np.mean(error**2))), unit)}"
    )
    answer += f", at most {quantity_text(float(np.max(np.abs(error))), unit)}."
    said = "Simulated from the first sample under the log's inputs, and measured."
    drawn = Figure(fig, "signals", said, data)
    return Page(title, "How does it move?", answer, [Section("Signals", figures=[drawn])], made)
