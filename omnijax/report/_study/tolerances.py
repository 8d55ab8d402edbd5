"""The page of tolerances."""

import numpy as np

from ..._text import quantity_text
from ...study import Tolerances
from .._content import Column, Provenance, Table
from .._page import Page
from .page import answer_page, readable

WORDS = (
    "Tolerances: by the derivatives alone, and so that machines drawn afterwards confirm them. The "
    "third column is the derivative for a change of the part by 1 %."
)
TIGHTEST = 3  # parts named in the answer


def tolerances_page(result: Tolerances, made: Provenance) -> Page:
    """The page of the result; `made` says what makes it again."""
    slopes, unit = readable(np.where(result.silent, 0.0, result.slopes) / 100, result.unit)
    columns = [Column("part", text=True), Column("nominal", text=True, minor=True)]
    columns += [
        Column(f"change of {result.metric}", f"{unit} per %", minor=True),
        Column("by derivatives", "± %", minor=True),
    ]
    columns += [Column("by drawn machines", "± %"), Column("in its unit", text=True, unbroken=True)]
    rows = [
        [part, quantity_text(result.values[i], result.units[i]), slopes[i], 100 * result.linear[i],
         100 * result.widths[i], f"± {result.own_width(i)}"]
        for i, part in enumerate(result.parts)
    ]  # fmt: skip
    data = {"part": list(result.parts), "tolerance / %": 100 * result.widths}
    pale = " Pale: capped, hardly matters." if result.capped.any() else ""
    caption = f"How far each part may be off.{pale}"
    figures = [("tolerances", caption, result.plot_widths, data)]
    order = [i for i in np.argsort(result.widths) if not result.silent[i]]
    tightest = [f"`{result.parts[i]}` to {result.width_text(i)}" for i in order[:TIGHTEST]]
    head, *rest = result.sentences()
    lines = [
        f"Hold {', '.join(tightest) or 'nothing'}"
        + (", and the others as below" if len(result.parts) > TIGHTEST else "")
        + f": then {head}",
        *rest[len(result.parts) :],
    ]
    return answer_page(
        "Tolerances", "How precisely must each wheel be made?", lines, figures,
        [Table(columns, rows, "parts", WORDS)], made,
    )  # fmt: skip
