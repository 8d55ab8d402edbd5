"""`omnijax global-sensitivity`: what matters over whole ranges."""

from pathlib import Path
from typing import Any

from ._options import Force, Json
from ._progress import bar
from ._study_page import Switch, deliver, kept, made_by, readable, write_page

BOUND = "Upright marks: upper bounds of the totals from the gradients, drawn at 1 at most."


def global_sensitivity(
    study: Path,
    /,
    *,
    metric: str | None = None,
    store: Path | None = None,
    resume: Switch = False,
    out: Path | None = None,
    report: Path | None = None,
    force: Force = False,
    json: Json = False,
) -> int:
    """Sobol indices, Morris effects and gradient-based bounds over the ranges of a study.

    Example: omnijax global-sensitivity study.toml --metric rms,peak --report page

    Parameters
    ----------
    study
        A study file with [[variable]] ranges and a [[drive]].
    metric
        Metrics, with commas between; without it those of the objective.
    store
        A folder for finished chunks of runs.
    resume
        Take up the runs of that folder.
    out
        A netCDF file for the result.
    report
        A folder for a page with the figures.
    """
    from .._files import claim
    from ..study import checked_metrics, load_study
    from ..study import global_sensitivity as run

    asked = load_study(study)
    claim([out], [report], force=force)
    metrics = None if metric is None else checked_metrics(metric)
    with kept(store), bar("runs") as report_progress:
        found = run(asked, metrics, out=store, resume=resume, report=report_progress)
    deliver(
        found, out, report, lambda folder: _page(folder, found, study, asked), json, _plain(found)
    )
    return 0


def _plain(found: Any) -> dict[str, Any]:
    return {
        "runs": found.runs,
        "failed": list(found.failed),
        "metrics": {
            name: {
                key: dict(zip(found.inputs, getattr(where, key)[m].tolist(), strict=True))
                for where, keys in (
                    (found.sobol, ("first", "first_half", "total", "total_half")),
                    (found.morris, ("mu", "mu_star", "sigma")),
                    (found, ("bound",)),
                )
                for key in keys
            }
            for m, name in enumerate(found.metrics)
        },
    }


def _page(folder: Path, found: Any, study: Path, asked: Any) -> None:
    from ..report import Fact

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
    write_page(
        folder, "Global sensitivity", "What matters over the whole ranges?", found.sentences(),
        figures, [_table(found, m) for m in range(len(found.metrics))], made_by(study, asked),
        facts,
    )  # fmt: skip


def _stages(found: Any, m: int) -> dict[str, Any]:
    """Columns of the convergence figure's CSV."""
    totals = found.sobol.total_stages[:, m]
    data: dict[str, Any] = {"blocks / 1": found.sobol.stages}
    return data | {f"total of {name} / 1": totals[:, i] for i, name in enumerate(found.inputs)}


def _table(found: Any, m: int) -> Any:
    """Every index of one metric."""
    import numpy as np

    from ..report import Column, Table

    name = found.metrics[m]
    both = np.stack([found.morris.mu_star[m], found.morris.sigma[m]])
    effects, unit = readable(both, found.units[m])
    columns = [Column("input", text=True), Column("first order"), Column("± 95 %")]
    columns += [Column("total"), Column("± 95 %"), Column("bound from gradients")]
    columns += [Column("Morris μ*", unit), Column("Morris σ", unit)]
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
