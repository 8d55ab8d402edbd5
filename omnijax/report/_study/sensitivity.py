"""The page of local sensitivities."""

from ..._text import amount
from ...study import Sensitivity
from .._content import Column, Fact, Provenance, Table, shown
from .._page import Page
from .page import answer_page

ROUNDING = 1e-9  # % per %: less is none


def sensitivity_page(found: Sensitivity, made: Provenance) -> Page:
    """The page of the result; `made` says what makes it again."""
    first = found.metrics[0]
    lead, value = next(iter(found.together(first).items()))
    lines = [
        f"`{lead}` matters most for {first}: {shown(value)} % per %.",
        f"Exact derivatives by {found.how}. Parameters of the same kind are changed on all "
        "wheels at once in the figures; the table has every wheel by itself.",
        *found.sentences(),
    ]
    figures = []
    for name in found.metrics:
        bars = found.together(name)
        data = {"parameter": list(bars), f"{name} / % per %": list(bars.values())}
        figures.append(
            (f"tornado-{name}", f"What each parameter does to {name}.",
             lambda name=name: found.plot_tornado(name, together=True), data)
        )  # fmt: skip
    columns = [Column("parameter", text=True), Column("value", text=True, minor=True)]
    columns += [Column(f"{name}", "% per %") for name in found.metrics]
    rows = [
        [
            path,
            amount(found.values[i], found.units[i]),
            *(float(x) if abs(x) > ROUNDING else 0.0 for x in found.relative[:, i]),
        ]
        for i, path in enumerate(found.parameters)
    ]
    facts = [
        Fact(name, amount(found.figures[m], found.metric_units[m]))
        for m, name in enumerate(found.metrics)
    ]
    table = Table(columns, rows, "sensitivities", "Change of each metric in % per %.")
    return answer_page(
        "Sensitivities", "Which parameters does the vibration depend on?", lines, figures,
        [table], made, facts,
    )  # fmt: skip
