"""`omnijax pareto`: the trade-off between metrics."""

from pathlib import Path
from typing import Any

from ._options import Json
from ._progress import bar
from ._study_page import Switch, deliver, kept, write_page


def pareto(
    study: Path,
    /,
    *,
    metric: str | None = None,
    store: Path | None = None,
    resume: Switch = False,
    out: Path | None = None,
    report: Path | None = None,
    json: Json = False,
) -> int:
    """Trace the front of two or three metrics: nothing better in one without loss in another.

    Example: omnijax pareto study.toml --metric rms,acceleration_rms --report page

    Parameters
    ----------
    study
        A study file; its [pareto] table names the metrics and the number of points.
    metric
        Two or three metrics with commas between, in place of the file's.
    store
        A folder for finished searches.
    resume
        Take up the searches of that folder.
    out
        A netCDF file for the result.
    report
        A folder for a page with the figure.
    """
    from ..study import load_study
    from ..study import pareto as run
    from ..study._sensitivity_target import checked_metrics

    asked = load_study(study)
    names = () if metric is None else checked_metrics(metric)
    with kept(store), bar("searches") as report_progress:
        found = run(asked, names, out=store, resume=resume, report=report_progress)
    deliver(
        found,
        out,
        report,
        lambda folder: _page(folder, found, asked),
        json,
        _plain(found),
        lambda: _print(found),
    )
    return 0


def _plain(found: Any) -> dict[str, Any]:
    return {
        "metrics": dict(zip(found.metrics, found.units, strict=True)),
        "variables": list(found.variables),
        "values": found.values.tolist(),
        "x": found.x.tolist(),
        "status": list(found.status),
        "evaluations": found.evaluations,
    }


def _print(found: Any) -> None:
    print("\n".join(found.sentences()))
    names = [f"{n} ({u})" for n, u in zip(found.metrics, found.units, strict=True)]
    print("  ".join([*names, *found.variables]))
    for values, x in zip(found.values, found.x, strict=True):
        print("  ".join(f"{v:.5g}" for v in (*values, *x)))


def _page(folder: Path, found: Any, asked: Any) -> None:
    from ..report import Column, Fact, Table
    from ..rig import rig_text
    from ..study import scaled

    both = list(zip(found.metrics, found.units, strict=True))
    read = [scaled(found.values[:, m].max(), unit) for m, (_, unit) in enumerate(both)]
    columns = [Column(n, unit) for n, (_, unit) in zip(found.metrics, read, strict=True)]
    columns += [Column(n, u) for n, u in zip(found.variables, found.variable_units, strict=True)]
    columns += [Column("status", text=True)]
    values = found.values * [factor for factor, _ in read]
    rows = [[*v, *x, s] for v, x, s in zip(values, found.x, found.status, strict=True)]
    data = {f"{n} / {u}": found.values[:, m] for m, (n, u) in enumerate(both)}
    caption = "The front: nothing can be better in one without being worse in another."
    figures = [("front", caption, found.plot_front, data)]
    facts = [Fact("designs", len(found.x)), Fact("evaluations with gradient", found.evaluations)]
    table = Table(columns, rows, "front-designs", "Designs on the front.")
    write_page(
        folder, "Trade-off", f"What does {found.metrics[0]} cost in {found.metrics[1]}?",
        found.sentences(), figures, [table], rig_text(asked.rig), asked.seed, facts,
    )  # fmt: skip
