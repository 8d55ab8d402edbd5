"""The page of a trade-off front."""

from ...study import Front
from .._content import Column, Fact, Provenance, Table
from .._page import Page
from .page import answer_page, readable


def front_page(front: Front, made: Provenance) -> Page:
    """The page of the result; `made` says what makes it again."""
    data = {f"{n} / {u}": front.values[:, m] for m, (n, u) in enumerate(_both(front))}
    figures = []
    for a, b in front.pairs():
        one, other = front.metrics[a], front.metrics[b]
        figures.append(
            (f"front-{one}-{other}", f"The front, {other} against {one}: nothing on it can be "
             "better in one metric without being worse in another.",
             lambda pair=(a, b): front.plot_front(pair), data)
        )  # fmt: skip
    facts = [Fact("designs", len(front.x)), Fact("evaluations with gradient", front.evaluations)]
    one, other = (front.metrics[m] for m in front.pairs()[0])
    return answer_page(
        "Trade-off", f"What does {one} cost in {other}?", front.sentences(), figures,
        [_table(front)], made, facts,
    )  # fmt: skip


def _both(front: Front) -> list[tuple[str, str]]:
    return list(zip(front.metrics, front.units, strict=True))


def _table(front: Front) -> Table:
    """The designs on the front."""
    variables = zip(front.variables, front.variable_units, strict=True)
    parts = [(n, *readable(front.values[:, m], u)) for m, (n, u) in enumerate(_both(front))]
    parts += [(n, *readable(front.x[:, i], u)) for i, (n, u) in enumerate(variables)]
    columns = [*(Column(n, unit) for n, _, unit in parts), Column("status", text=True, minor=True)]
    rows = [[*(v[i] for _, v, _ in parts), s] for i, s in enumerate(front.status)]
    return Table(columns, rows, "front-designs", "Designs on the front.", stacked=True)
