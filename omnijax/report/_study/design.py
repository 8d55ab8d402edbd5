"""The page of a design: what to build and what it brings first, the search behind."""

import numpy as np

from ..._text import amount, path_words, scaled
from ...study import Design
from .._content import Column, Fact, Figure, Provenance, Section, Table
from .._page import Page
from .._style import style
from .page import as_sentence, readable


def design_page(found: Design, made: Provenance) -> Page:
    """The page of the result; `made` says what makes it again."""
    rest = found.sentences()[1 + len(found.variables) :]
    what = Section(
        "What it brings", "\n\n".join(map(as_sentence, rest)), _gain(found), _limits(found)
    )
    return Page(
        "Design", "What to build, and what does it bring?", _answer(found),
        [Section("What to build", tables=[_parts(found)]), what, _search(found)], made,
        _facts(found),
    )  # fmt: skip


def _answer(found: Design) -> str:
    """What to build, what it brings, and whether something better may exist."""
    given = []
    for name, value in found.variables.items():
        said = f"{path_words(name)} {amount(value, found.units[name])}"
        old = found.was.get("variables", {}).get(name)
        given.append(said if old is None else f"{said} (now {amount(old, found.units[name])})")
    if found.status == "infeasible":
        return f"Nothing to build: {found.reason}."
    answer = f"Build it with {', '.join(given[:-1])}{' and ' if given[1:] else ''}{given[-1]}."
    if found.was:
        old, new = found.was["old"], found.was["new"]
        factor, unit = scaled(new, found.unit)
        ends = f"from {factor * old:.4g} to {factor * new:.4g} {unit}".strip()
        change = 100 * (new / old - 1) if old else 0.0
        way = "less" if change < 0 else "more"
        answer += (
            f" That is {abs(change):.3g} % {way} {found.objective_name} than your rig: {ends}."
        )
    if not found.optimal:
        answer += f" A better one may exist: {found.reason}."
    return answer


def _facts(found: Design) -> list[Fact]:
    """The objective, and what each limited quantity comes to."""
    value = found.was.get("new", found.objective)
    factor, unit = scaled(value, found.unit)
    facts = [Fact(found.objective_name, f"{factor * value:.4g}", unit)]
    for text, (reached, own) in found.limits.items():
        factor, unit = scaled(reached, own)
        facts.append(Fact(text.replace("<=", "at most").replace(">=", "at least"),
                          f"{factor * reached:.4g}", unit))  # fmt: skip
    return facts


def _parts(found: Design) -> Table:
    """The variables of the design beside those of the rig."""
    was = found.was.get("variables", {})
    rows = [
        [n, amount(v, found.units[n]),
         amount(was[n], found.units[n]) if n in was else "–"]
        for n, v in found.variables.items()
    ]  # fmt: skip
    columns = [Column("parameter", text=True), Column("build", text=True, unbroken=True),
               Column("your rig", text=True, unbroken=True)]  # fmt: skip
    return Table(columns, rows, "design", "The design.")


def _gain(found: Design) -> list[Figure]:
    if not found.was:
        return []
    factor, unit = scaled(found.was["new"], found.unit)
    ends = np.array(list(found.was["cases"].values()))
    name = f"{found.case_name} / {unit}"
    data = {"case": list(found.was["cases"]), f"your rig: {name}": factor * ends[:, 0],
            f"the design: {name}": factor * ends[:, 1]}  # fmt: skip
    with style():
        fig = found.plot_gain().figure
    return [Figure(fig, "gain", "Your rig and the design, parts at their nominal values.", data)]


def _limits(found: Design) -> list[Table]:
    if not found.limits:
        return []
    rows = [[text, amount(*reached)] for text, reached in found.limits.items()]
    columns = [Column("limit", text=True), Column("reached", text=True, unbroken=True)]
    return [Table(columns, rows, "limits", "What must hold, and what the design reaches.")]


def _search(found: Design) -> Section:
    """How sure it is: where every search ended."""
    same, total = found.agreement
    text = f"{same} of {total} searches ended at this design: {found.status} ({found.reason})."
    figures = []
    if same < total:  # equal dots on a line would say nothing
        order = found.ranking
        data = {"search / 1": list(range(1, len(order) + 1)),
                f"objective / {found.unit}": [found.ends["objective"][i] for i in order],
                "status": [found.ends["status"][i] for i in order]}  # fmt: skip
        with style():
            fig = found.plot_searches().figure
        figures = [Figure(fig, "searches", "Where every search ended, best first.", data)]
    return Section("How it was searched", text, figures, [_ends(found)])


def _ends(found: Design) -> Table:
    """Where every search ended."""
    ends, order = found.ends, found.ranking
    x = np.array(ends["x"])
    parts = [(found.objective_name, *readable(ends["objective"], found.unit))]
    parts += [(n, *readable(x[:, i], u)) for i, (n, u) in enumerate(found.units.items())]
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
