"""A figure as inline SVG, in two widths and in every unit of its axis, and as PNG."""

import io
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import matplotlib as mpl
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

from ._axis import SpeedAxis, plain_labels, shown_in
from ._style import NARROW, fold_legends, laid_out, style, wrapped

PNG_DPI = 150


@dataclass(frozen=True)
class Drawing:
    """One rendering: `unit` of its x axis ("" for an axis without choice), SVG wide and narrow."""

    unit: str
    wide: str
    narrow: str


@dataclass(frozen=True)
class Renderings:
    """All renderings of a figure: as PNG, and a drawing by unit of its axis."""

    png: bytes
    drawings: list[Drawing]


def rendered(fig: Figure, name: str, axis: SpeedAxis | None = None) -> Renderings:
    """Every rendering of `fig`; ids in the drawings begin with `name`."""
    with style():
        plain_labels(fig)
        if axis is None:
            with laid_out(fig):
                picture, wide = _png(fig), _svg(fig, f"{name}-w")
            return Renderings(picture, [Drawing("", wide, _narrow(fig, f"{name}-n"))])
        picture, drawings = _png(fig), []
        for i, unit in enumerate(axis.units):
            with shown_in(fig, axis, unit):
                wide, narrow = _svg(fig, f"{name}-{i}-w"), _narrow(fig, f"{name}-{i}-n")
                drawings.append(Drawing(unit, wide, narrow))
        return Renderings(picture, drawings)


def _narrow(fig: Figure, prefix: str) -> str:
    width, height = fig.get_size_inches()
    fig.set_size_inches(NARROW * width / max(width, NARROW), height)
    fold_legends(fig, 2)
    try:
        with wrapped(fig):
            return _svg(fig, prefix)
    finally:
        fig.set_size_inches(width, height)
        fold_legends(fig, 4)


def _png(fig: Figure) -> bytes:
    buffer = io.BytesIO()
    with _drawn_once(fig):
        fig.set_dpi(PNG_DPI)
        FigureCanvasAgg(fig).print_png(buffer, metadata={"Software": "omnijax"})
    return buffer.getvalue()


def _svg(fig: Figure, prefix: str) -> str:
    buffer = io.StringIO()
    with _drawn_once(fig), mpl.rc_context({"svg.hashsalt": prefix}):
        FigureCanvasSVG(fig).print_svg(buffer, metadata={"Date": None})
    return inline(buffer.getvalue(), prefix)


@contextmanager
def _drawn_once(fig: Figure) -> Iterator[None]:
    """`fig` for another canvas; `savefig` draws a figure that ever had a layout twice."""
    canvas, dpi = fig.canvas, fig.dpi
    try:
        yield
    finally:
        fig.set_dpi(dpi)
        fig.set_canvas(canvas)


def inline(document: str, prefix: str) -> str:
    """The `<svg>` element alone: scalable, with ids that no other figure on a page has."""
    text = document[document.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.S)
    text = re.sub(r"(<svg[^>]*?) width=\"[^\"]*\"", r"\1", text, count=1)
    text = re.sub(r"(<svg[^>]*?) height=\"[^\"]*\"", r"\1", text, count=1)
    text = re.sub(r'\bid="', f'id="{prefix}-', text)
    text = re.sub(r"url\(#", f"url(#{prefix}-", text)
    return re.sub(r'href="#', f'href="#{prefix}-', text)
