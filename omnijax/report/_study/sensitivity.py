"""The page of local sensitivities."""

from ..._text import quantity_text
from ...study import Sensitivity
from .._content import Column, Fact, Provenance, Table, shown
from .._page import Page
from .page import answer_page

ROUNDING = 1e-9  # % per %: less is none


def sensitivity_page(result: Sensitivity, made: Provenance) -> Page:
    """The page of the result; `made` says what makes it again."""
    first = result.metrics[0]
    bars = result.together(first)
    lead = next((path for path in bars if path not in result.whole), next(iter(bars)))
    among = " (whole numbers aside)" if next(iter(bars)) in result.whole else ""
    lines = [
        f"`{lead}` matters most for {first}{among}: {shown(bars[lead])} % per %.",
        f"Exact derivatives by {result.how}. Parameters of the same kind are changed on all "
        "wheels at once in the figures; the table has every wheel by itself.",
        *result.sentences(),
    ]
    figures = []
    for name in result.metrics:
        bars = result.together(name)
        data = {"parameter": list(bars), f"{name} / % per %": list(bars.values())}
        figures.append(
            (f"tornado-{name}", f"What each parameter does to {name}.",
             lambda name=name: result.plot_tornado(name, together=True), data)
        )  # fmt: skip
    columns = [Column("parameter", text=True), Column("value", text=True, minor=True)]
    columns += [Column(f"{name}", "% per %") for name in result.metrics]
    rows = [
        [
            path,
            quantity_text(result.values[i], result.units[i]),
            *(float(x) if abs(x) > ROUNDING else 0.0 for x in result.relative[:, i]),
        ]
        for i, path in enumerate(result.parameters)
    ]
    facts = [
        Fact(name, quantity_text(result.figures[m], result.metric_units[m]))
        for m, name in enumerate(result.metrics)
    ]
    table = Table(columns, rows, "sensitivities", "Change of each metric in % per %.")
    return answer_page(
        "Sensitivities", "Which parameters does the vibration depend on?", lines, figures,
        [table], made, facts,
    )  # fmt: skip
