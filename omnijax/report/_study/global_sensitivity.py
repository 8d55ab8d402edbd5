"""The page of a global study."""

from typing import Any

import numpy as np

from ...study import GlobalSensitivity
from .._content import Column, Fact, Provenance, Table
from .._page import Page
from .page import answer_page, readable

BOUND = "Upright marks: upper bounds of the totals from the gradients, drawn at 1 at most."


def global_sensitivity_page(result: GlobalSensitivity, made: Provenance) -> Page:
    """The page of the result; `made` says what makes it again."""
    figures = []
    for m, name in enumerate(result.metrics):
        data = {"input": list(result.inputs), "first / 1": result.sobol.first[m]}
        data |= {"total / 1": result.sobol.total[m], "bound / 1": result.bound[m]}
        figures.append(
            (f"indices-{name}", f"Shares of the variance of {name}. {BOUND}",
             lambda name=name: result.plot_indices(name), data)
        )  # fmt: skip
        figures.append(
            (f"convergence-{name}", f"Total indices of {name} as runs are added.",
             lambda name=name: result.plot_convergence(name), _stages(result, m))
        )  # fmt: skip
    facts = [Fact("runs", result.runs), Fact("failed runs", len(result.failed))]
    return answer_page(
        "Global sensitivity", "What matters over the whole ranges?", result.sentences(),
        figures, [_table(result, m) for m in range(len(result.metrics))], made,
        facts,
    )  # fmt: skip


def _stages(result: GlobalSensitivity, m: int) -> dict[str, Any]:
    """Columns of the convergence figure's CSV."""
    totals = result.sobol.total_stages[:, m]
    data: dict[str, Any] = {"blocks / 1": result.sobol.stages}
    return data | {f"total of {name} / 1": totals[:, i] for i, name in enumerate(result.inputs)}


def _table(result: GlobalSensitivity, m: int) -> Table:
    """Every index of one metric."""
    name = result.metrics[m]
    both = np.stack([result.morris.mu_star[m], result.morris.sigma[m]])
    effects, unit = readable(both, result.units[m])
    columns = [Column("input", text=True), Column("first order"), Column("± 95 %", minor=True)]
    columns += [Column("total"), Column("± 95 %"), Column("bound from gradients", minor=True)]
    columns += [Column("Morris μ*", unit, minor=True), Column("Morris σ", unit, minor=True)]
    parts = (
        result.sobol.first, result.sobol.first_half, result.sobol.total, result.sobol.total_half,
        result.bound,
    )  # fmt: skip
    rows = [
        [path, *(part[m, i] for part in parts), *effects[:, i]]
        for i, path in enumerate(result.inputs)
    ]
    words = f"Shares of the variance of {name}; Morris' effects over the whole range of an input."
    return Table(columns, rows, f"indices-{name}-table", words)
