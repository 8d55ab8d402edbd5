"""A figure as inline SVG, in two widths and in every unit of its axis, and as PNG."""

import io
import re
from dataclasses import dataclass

import matplotlib as mpl
from matplotlib.figure import Figure

from ._axis import SpeedAxis, plain_labels, shown_in
from ._style import NARROW, fold_legends, style, wrapped

PNG_DPI = 150


@dataclass(frozen=True)
class Drawing:
    """One rendering: `unit` of its x axis ("" for an axis without choice), SVG wide and narrow."""

    unit: str
    wide: str
    narrow: str


def png(fig: Figure) -> bytes:
    """The figure as PNG."""
    buffer = io.BytesIO()
    with style():
        plain_labels(fig)
        fig.savefig(buffer, format="png", dpi=PNG_DPI, metadata={"Software": "omnijax"})
    return buffer.getvalue()


def drawings(fig: Figure, name: str, axis: SpeedAxis | None = None) -> list[Drawing]:
    """Every rendering of `fig` that a page holds; ids in it begin with `name`."""
    with style():
        plain_labels(fig)
        if axis is None:
            return [_both(fig, name, "")]
        renderings = []
        for i, unit in enumerate(axis.units):
            with shown_in(fig, axis, unit):
                renderings.append(_both(fig, f"{name}-{i}", unit))
        return renderings


def _both(fig: Figure, name: str, unit: str) -> Drawing:
    wide = _svg(fig, f"{name}-w")
    width, height = fig.get_size_inches()
    fig.set_size_inches(NARROW * width / max(width, NARROW), height)
    fold_legends(fig, 2)
    try:
        with wrapped(fig):
            narrow = _svg(fig, f"{name}-n")
    finally:
        fig.set_size_inches(width, height)
        fold_legends(fig, 4)
    return Drawing(unit, wide, narrow)


def _svg(fig: Figure, prefix: str) -> str:
    buffer = io.StringIO()
    with mpl.rc_context({"svg.hashsalt": prefix}):
        fig.savefig(buffer, format="svg", metadata={"Date": None})
    return inline(buffer.getvalue(), prefix)


def inline(document: str, prefix: str) -> str:
    """The `<svg>` element alone: scalable, with ids that no other figure on a page has."""
    text = document[document.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.S)
    text = re.sub(r"(<svg[^>]*?) width=\"[^\"]*\"", r"\1", text, count=1)
    text = re.sub(r"(<svg[^>]*?) height=\"[^\"]*\"", r"\1", text, count=1)
    text = re.sub(r'\bid="', f'id="{prefix}-', text)
    text = re.sub(r"url\(#", f"url(#{prefix}-", text)
    return re.sub(r'href="#', f'href="#{prefix}-', text)
