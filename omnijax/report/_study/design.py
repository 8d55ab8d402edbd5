"""The page of a design: what to build and what it brings first, the search behind."""

import numpy as np

from ..._text import quantity_text, scaled
from ...study import Design
from .._content import Column, Fact, Figure, Provenance, Section, Table
from .._page import Page
from .._style import style
from .._terms import meanings
from .page import as_sentence, readable

OPEN = 12  # limits that are listed without a click


def design_page(design: Design, made: Provenance) -> Page:
    """The page of the result; `made` says what makes it again."""
    rest = design.sentences()[1:-1]
    what = Section(
        "What it brings", "\n\n".join(map(as_sentence, rest)), _gain(design), _limits(design)
    )
    facts = _facts(design)
    return Page(
        "Design", "What to build, and what does it bring?", design.headline(),
        [Section("What to build", tables=[_parts(design)]), what, _search(design)], made,
        facts, meanings(*(fact.label for fact in facts)),
    )  # fmt: skip


def _facts(design: Design) -> list[Fact]:
    """The objective, and what the tightest limited quantity of each kind comes to."""
    value = design.was.get("new", design.objective)
    factor, unit = scaled(value, design.unit)
    facts = [Fact(design.nominal_name, f"{factor * value:.4g}", unit)]
    for text, count in _tightest(design.limits):
        reached, own = design.limits[text]
        factor, unit = scaled(reached, own)
        label = text.replace("<=", "at most").replace(">=", "at least")
        label += f" (tightest of {count})" if count > 1 else ""
        facts.append(Fact(label, f"{factor * reached:.4g}", unit))
    return facts


def _tightest(limits: dict[str, tuple[float, str]]) -> list[tuple[str, int]]:
    """The tightest limit of each kind, and how many of its kind there are.

    Of a kind are those of one quantity, whatever wheel, mode or order it is of, with one bound.
    """
    kinds: dict[tuple[str, ...], list[str]] = {}
    for text in limits:
        what, sign, bound = text.rpartition(" >= ") if " >= " in text else text.rpartition(" <= ")
        kinds.setdefault((what.split(" of ")[0], sign, bound), []).append(text)

    def reached(text: str) -> float:
        return limits[text][0]

    return [
        ((min if sign == " >= " else max)(texts, key=reached), len(texts))
        for (_, sign, _), texts in kinds.items()
    ]


def _parts(design: Design) -> Table:
    """The variables of the design beside those of the rig."""
    was = design.was.get("variables", {})
    rows = [
        [n, quantity_text(v, design.units[n]),
         quantity_text(was[n], design.units[n]) if n in was else "–"]
        for n, v in design.variables.items()
    ]  # fmt: skip
    columns = [Column("parameter", text=True), Column("build", text=True, unbroken=True),
               Column("your rig", text=True, unbroken=True)]  # fmt: skip
    return Table(columns, rows, "design", "The design.")


def _gain(design: Design) -> list[Figure]:
    if not design.was:
        return []
    factor, unit = scaled(design.was["new"], design.unit)
    ends = np.array(list(design.was["cases"].values()))
    name = f"{design.nominal_case_name} / {unit}"
    data = {"case": list(design.was["cases"]), f"your rig: {name}": factor * ends[:, 0],
            f"the design: {name}": factor * ends[:, 1]}  # fmt: skip
    with style():
        fig = design.plot_gain().figure
    return [Figure(fig, "gain", "Your rig and the design, parts at their nominal values.", data)]


def _limits(design: Design) -> list[Table]:
    if not design.limits:
        return []
    rows = [[text, quantity_text(*reached)] for text, reached in design.limits.items()]
    columns = [Column("limit", text=True), Column("reached", text=True, unbroken=True)]
    words = "What must hold, and what the design reaches."
    return [Table(columns, rows, "limits", words, folded=len(rows) > OPEN)]


def _search(design: Design) -> Section:
    """How sure it is: where every search ended."""
    same, total = design.agreement
    text = design.sentences()[-1]
    figures = []
    if same < total:  # equal dots on a line would say nothing
        order = design.ranking
        data = {"search / 1": list(range(1, len(order) + 1)),
                f"objective / {design.unit}": [design.ends["objective"][i] for i in order],
                "status": [design.ends["status"][i] for i in order]}  # fmt: skip
        with style():
            fig = design.plot_searches().figure
        figures = [Figure(fig, "searches", "Where every search ended, best first.", data)]
    return Section("How it was searched", text, figures, [_ends(design)])


def _ends(design: Design) -> Table:
    """Where every search ended."""
    ends, order = design.ends, design.ranking
    x = np.array(ends["x"])
    parts = [(design.objective_name, *readable(ends["objective"], design.unit))]
    parts += [(n, *readable(x[:, i], u)) for i, (n, u) in enumerate(design.units.items())]
    parts += [("KKT residual", ends["kkt_residual"], "")]
    if "infeasible" in ends["status"]:
        parts += [("violation", ends["violation"], "")]
    parts += [("evaluations", ends["evaluations"], "")]
    side = ("KKT residual", "evaluations", "violation")
    columns = [Column("search"), Column("status", text=True, minor=True)]
    columns += [Column(name, unit, minor=name in side) for name, _, unit in parts]
    rows = [
        [rank, ends["status"][i], *(values[i] for _, values, _ in parts)]
        for rank, i in enumerate(order, 1)
    ]
    words = "Where every search ended, best first."
    return Table(columns, rows, "searches-table", words, folded=True)
