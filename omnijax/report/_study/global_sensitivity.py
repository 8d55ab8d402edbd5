"""The page of a global study."""

from typing import Any

import numpy as np

from ...study import GlobalSensitivity
from .._content import Column, Fact, Provenance, Table
from .._page import Page
from .page import answer_page, readable

BOUND = "Upright marks: upper bounds of the totals from the gradients, drawn at 1 at most."


def global_sensitivity_page(found: GlobalSensitivity, made: Provenance) -> Page:
    """The page of the result; `made` says what makes it again."""
    figures = []
    for m, name in enumerate(found.metrics):
        data = {"input": list(found.inputs), "first / 1": found.sobol.first[m]}
        data |= {"total / 1": found.sobol.total[m], "bound / 1": found.bound[m]}
        figures.append(
            (f"indices-{name}", f"Shares of the variance of {name}. {BOUND}",
             lambda name=name: found.plot_indices(name), data)
        )  # fmt: skip
        figures.append(
            (f"convergence-{name}", f"Total indices of {name} as runs are added.",
             lambda name=name: found.plot_convergence(name), _stages(found, m))
        )  # fmt: skip
    facts = [Fact("runs", found.runs), Fact("failed runs", len(found.failed))]
    return answer_page(
        "Global sensitivity", "What matters over the whole ranges?", found.sentences(),
        figures, [_table(found, m) for m in range(len(found.metrics))], made,
        facts,
    )  # fmt: skip


def _stages(found: GlobalSensitivity, m: int) -> dict[str, Any]:
    """Columns of the convergence figure's CSV."""
    totals = found.sobol.total_stages[:, m]
    data: dict[str, Any] = {"blocks / 1": found.sobol.stages}
    return data | {f"total of {name} / 1": totals[:, i] for i, name in enumerate(found.inputs)}


def _table(found: GlobalSensitivity, m: int) -> Table:
    """Every index of one metric."""
    name = found.metrics[m]
    both = np.stack([found.morris.mu_star[m], found.morris.sigma[m]])
    effects, unit = readable(both, found.units[m])
    columns = [Column("input", text=True), Column("first order"), Column("± 95 %", minor=True)]
    columns += [Column("total"), Column("± 95 %"), Column("bound from gradients", minor=True)]
    columns += [Column("Morris μ*", unit, minor=True), Column("Morris σ", unit, minor=True)]
    parts = (
        found.sobol.first, found.sobol.first_half, found.sobol.total, found.sobol.total_half,
        found.bound,
    )  # fmt: skip
    rows = [
        [path, *(part[m, i] for part in parts), *effects[:, i]]
        for i, path in enumerate(found.inputs)
    ]
    words = f"Shares of the variance of {name}; Morris' effects over the whole range of an input."
    return Table(columns, rows, f"indices-{name}-table", words)
