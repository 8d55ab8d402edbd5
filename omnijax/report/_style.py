"""How the product's figures look: a colour-blind-safe palette and readable labels, in a context.

Nothing here changes a setting of the process: `style()` is a context, `figure()` makes a figure
that no window system knows of.
"""

import re
import textwrap
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from .._plot import INK as INK
from .._plot import style as style

WIDTH, NARROW = 7.2, 4.3  # inches: on a page, and on a telephone
NARROW_LETTERS = 34  # of a title there


def figure(
    rows: int = 1, columns: int = 1, *, height: float | None = None, sharex: bool = True
) -> tuple[Figure, list[Axes]]:
    """A figure of page width (in) and its axes, in reading order; use inside `style()`."""
    tall = height if height is not None else 1.6 + 1.75 * rows
    fig = Figure(figsize=(WIDTH, tall), layout="constrained")
    axes = fig.subplots(rows, columns, sharex=sharex, squeeze=False)
    return fig, list(axes.ravel())


def legend_above(ax: Axes, columns: int = 4) -> None:
    """The legend of `ax` in a line above it; a narrow page folds it into two columns."""
    legend = ax.legend(
        loc="lower left", bbox_to_anchor=(0, 1), ncols=columns, borderaxespad=0.1, handlelength=1.4,
        columnspacing=1.2,
    )  # fmt: skip
    legend.set_gid("above")


def fold_legends(fig: Figure, columns: int) -> None:
    """Legends above their axes in at most `columns` columns; any other leaves the layout alone."""
    for ax in fig.axes:
        legend = ax.get_legend()
        if legend is None:
            continue
        if legend.get_gid() == "above":
            legend_above(ax, columns)
        else:
            legend.set_in_layout(False)


def raised(text: str) -> str:
    """A unit's powers as people write them: m/s^2 is m/s²."""
    return re.sub(r"(?<=[a-zA-Z)])\^(\d)", lambda match: superscript(int(match[1])), text)


@contextmanager
def laid_out(fig: Figure) -> Iterator[None]:
    """`fig` laid out once for the block: a layout takes longer than a rendering."""
    engine = fig.get_layout_engine()
    if engine is None:
        yield
        return
    engine.execute(fig)
    fig.set_layout_engine("none")  # else each rendering does it again
    try:
        yield
    finally:
        fig.set_layout_engine(engine)


@contextmanager
def wrapped(fig: Figure) -> Iterator[None]:
    """Laid out with titles and labels in lines that fit on a telephone, inside the figure."""
    texts = [(ax, t) for ax in fig.axes for t in (ax.title, ax._left_title, ax.xaxis.label)]  # pyright: ignore[reportAttributeAccessIssue]
    before = [(text.get_text(), text.get_position()) for _, text in texts]
    for (_, text), (words, _) in zip(texts, before, strict=True):
        text.set_text(textwrap.fill(words, NARROW_LETTERS))
    try:
        with laid_out(fig):
            for ax, text in texts:
                _pulled_in(fig, ax, text)
            yield
    finally:
        for (_, text), (words, place) in zip(texts, before, strict=True):
            text.set_text(words)
            text.set_position(place)


def _pulled_in(fig: Figure, ax: Axes, text: Any) -> None:
    """`text` of `ax` moved to the left where it ends beyond the figure."""
    box = text.get_window_extent()
    over = box.x1 - 0.99 * fig.bbox.width
    if text.get_text() and over > 0:
        x, y = text.get_position()
        text.set_position((x - min(over, box.x0) / ax.bbox.width, y))


def superscript(number: int) -> str:
    """`number` in raised digits."""
    return str(number).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
