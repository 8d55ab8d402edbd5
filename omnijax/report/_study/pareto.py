"""The page of a trade-off front."""

from ...study import Front
from .._content import Column, Fact, Provenance, Table
from .._page import Page
from .page import answer_page, readable


def front_page(found: Front, made: Provenance) -> Page:
    """The page of the result; `made` says what makes it again."""
    data = {f"{n} / {u}": found.values[:, m] for m, (n, u) in enumerate(_both(found))}
    figures = []
    for a, b in found.pairs():
        one, other = found.metrics[a], found.metrics[b]
        figures.append(
            (f"front-{one}-{other}", f"The front, {other} against {one}: nothing on it can be "
             "better in one metric without being worse in another.",
             lambda pair=(a, b): found.plot_front(pair), data)
        )  # fmt: skip
    facts = [Fact("designs", len(found.x)), Fact("evaluations with gradient", found.evaluations)]
    one, other = (found.metrics[m] for m in found.pairs()[0])
    return answer_page(
        "Trade-off", f"What does {one} cost in {other}?", found.sentences(), figures,
        [_table(found)], made, facts,
    )  # fmt: skip


def _both(found: Front) -> list[tuple[str, str]]:
    return list(zip(found.metrics, found.units, strict=True))


def _table(found: Front) -> Table:
    """The designs on the front."""
    variables = zip(found.variables, found.variable_units, strict=True)
    parts = [(n, *readable(found.values[:, m], u)) for m, (n, u) in enumerate(_both(found))]
    parts += [(n, *readable(found.x[:, i], u)) for i, (n, u) in enumerate(variables)]
    columns = [*(Column(n, unit) for n, _, unit in parts), Column("status", text=True, minor=True)]
    rows = [[*(v[i] for _, v, _ in parts), s] for i, s in enumerate(found.status)]
    return Table(columns, rows, "front-designs", "Designs on the front.", stacked=True)
