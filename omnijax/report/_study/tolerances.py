"""The page of tolerances."""

import numpy as np

from ..._text import amount
from ...study import Tolerances
from .._content import Column, Provenance, Table
from .._page import Page
from .page import answer_page, readable

WORDS = (
    "Tolerances: by the derivatives alone, and so that machines drawn afterwards confirm them. The "
    "third column is the derivative for a change of the part by 1 %."
)
TIGHTEST = 3  # parts named in the answer


def tolerances_page(found: Tolerances, made: Provenance) -> Page:
    """The page of the result; `made` says what makes it again."""
    slopes, unit = readable(found.slopes / 100, found.unit)
    columns = [Column("part", text=True), Column("nominal", text=True, minor=True)]
    columns += [
        Column(f"change of {found.metric}", f"{unit} per %", minor=True),
        Column("by derivatives", "± %", minor=True),
    ]
    columns += [Column("by drawn machines", "± %"), Column("in its unit", text=True, unbroken=True)]
    rows = [
        [part, amount(found.values[i], found.units[i]), slopes[i], 100 * found.linear[i],
         100 * found.widths[i], f"± {found.own_width(i)}"]
        for i, part in enumerate(found.parts)
    ]  # fmt: skip
    data = {"part": list(found.parts), "tolerance / %": 100 * found.widths}
    pale = " Pale: capped, hardly matters." if found.capped.any() else ""
    caption = f"How far each part may be off.{pale}"
    figures = [("tolerances", caption, found.plot_widths, data)]
    tightest = [
        f"`{found.parts[i]}` to {found.width_text(i)}" for i in np.argsort(found.widths)[:TIGHTEST]
    ]
    head, *rest = found.sentences()
    lines = [
        f"Hold {', '.join(tightest)}"
        + (", and the others as below" if len(found.parts) > TIGHTEST else "")
        + f": then {head}",
        *rest[len(found.parts) :],
    ]
    return answer_page(
        "Tolerances", "How precisely must each wheel be made?", lines, figures,
        [Table(columns, rows, "parts", WORDS)], made,
    )  # fmt: skip
