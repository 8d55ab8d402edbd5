"""The page of a design."""

import numpy as np

from ..._text import amount
from ...study import Design
from .._content import Column, Provenance, Table
from .._page import Page
from .page import answer_page, readable


def design_page(found: Design, made: Provenance) -> Page:
    """The page of the result; `made` says what makes it again."""
    ends, order = found.ends, found.ranking
    figures = [
        ("searches", "Where every search ended, best first.", found.plot_searches,
         {"search / 1": list(range(1, len(order) + 1)),
          f"objective / {found.unit}": [ends["objective"][i] for i in order],
          "status": [ends["status"][i] for i in order]}),
    ]  # fmt: skip
    if len(found.cases) > 1:
        cases = {"case": list(found.cases)}
        cases |= {f"objective / {found.unit}": list(found.cases.values())}
        figures.append(("cases", "The objective in every case.", found.plot_cases, cases))
    given = [f"`{n}` = {amount(v, found.units[n])}" for n, v in found.variables.items()]
    head, *rest = found.sentences()
    lines = [f"{', '.join(given)}: {head}", *rest[len(given) :]]
    return answer_page(
        "Design", "Which design vibrates least?", lines, figures, _tables(found),
        made,
    )  # fmt: skip


def _tables(found: Design) -> list[Table]:
    """The design, and where every search ended."""
    columns = [Column("variable", text=True), Column("value"), Column("unit", text=True)]
    rows = [[n, *readable(v, found.units[n])] for n, v in found.variables.items()]
    tables = [Table(columns, rows, "design", "The design.")]
    ends, order = found.ends, found.ranking
    x = np.array(ends["x"])
    parts = [(found.objective_name, *readable(ends["objective"], found.unit))]
    parts += [(n, *readable(x[:, i], u)) for i, (n, u) in enumerate(found.units.items())]
    parts += [("KKT residual", ends["kkt_residual"], "")]
    if "infeasible" in ends["status"]:
        parts += [("violation", ends["violation"], "")]
    parts += [("evaluations", ends["evaluations"], "")]
    columns = [Column("search"), Column("status", text=True)]
    columns += [Column(name, unit) for name, _, unit in parts]
    rows = [
        [rank, ends["status"][i], *(values[i] for _, values, _ in parts)]
        for rank, i in enumerate(order, 1)
    ]
    words = "Where every search ended, best first."
    return [*tables, Table(columns, rows, "searches-table", words)]
