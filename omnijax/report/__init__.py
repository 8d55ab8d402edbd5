"""Figures, tables and one offline HTML page from them; no physics of its own."""

from typing import TYPE_CHECKING

from .._lazy import lazy_face

if TYPE_CHECKING:
    from .._plot import COLOURS as COLOURS
    from .._plot import MUTED as MUTED
    from .._plot import PALETTE as PALETTE
    from ._axis import SpeedAxis as SpeedAxis
    from ._content import Badge as Badge
    from ._content import Column as Column
    from ._content import Dial as Dial
    from ._content import Fact as Fact
    from ._content import Figure as Figure
    from ._content import Provenance as Provenance
    from ._content import Section as Section
    from ._content import Table as Table
    from ._content import provenance as provenance
    from ._content import shown as shown
    from ._diagnosis import diagnosis_page as diagnosis_page
    from ._diagnosis_words import effect_sizes as effect_sizes
    from ._orders import orders_page as orders_page
    from ._orders import strongest_orders as strongest_orders
    from ._page import Page as Page
    from ._page import file_name as file_name
    from ._signals import signals_page as signals_page
    from ._study import study_page as study_page
    from ._style import INK as INK
    from ._style import figure as figure
    from ._style import legend_above as legend_above
    from ._style import style as style
    from ._sweep import sweep_figure as sweep_figure
    from ._sweep import sweep_page as sweep_page

__getattr__, __dir__ = lazy_face(__name__)
