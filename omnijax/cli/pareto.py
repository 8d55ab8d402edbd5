"""`omnijax pareto`: the trade-off between metrics."""

from pathlib import Path
from typing import Any

from ._options import Force, Json
from ._progress import bar
from ._study_page import Switch, deliver, kept, made_by, readable, write_page


def pareto(
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
    """Trace the front of two or three metrics: nothing better in one without loss in another.

    Example: omnijax pareto study.toml --metric rms,sphere_acceleration_rms --report page

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
    from .._files import claim
    from ..study import checked_metrics, load_study
    from ..study import pareto as run

    asked = load_study(study)
    claim([out], [report], force=force)
    names = () if metric is None else checked_metrics(metric)
    with kept(store), bar("searches") as report_progress:
        found = run(asked, names, out=store, resume=resume, report=report_progress)
    deliver(
        found,
        out,
        report,
        lambda folder: _page(folder, found, study, asked),
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
    variables = list(zip(found.variables, found.variable_units, strict=True))
    names = [f"{n} ({u})" if u != "1" else n for n, u in _both(found) + variables]
    print("  ".join(names))
    for values, x in zip(found.values, found.x, strict=True):
        cells = (f"{v:.5g}" for v in (*values, *x))
        print("  ".join(c.rjust(len(n)) for c, n in zip(cells, names, strict=True)))


def _page(folder: Path, found: Any, study: Path, asked: Any) -> None:
    from ..report import Fact

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
    write_page(
        folder, "Trade-off", f"What does {one} cost in {other}?", found.sentences(), figures,
        [_table(found)], made_by(study, asked), facts,
    )  # fmt: skip


def _both(found: Any) -> list[tuple[str, str]]:
    return list(zip(found.metrics, found.units, strict=True))


def _table(found: Any) -> Any:
    """The designs on the front."""
    from ..report import Column, Table

    variables = zip(found.variables, found.variable_units, strict=True)
    parts = [(n, *readable(found.values[:, m], u)) for m, (n, u) in enumerate(_both(found))]
    parts += [(n, *readable(found.x[:, i], u)) for i, (n, u) in enumerate(variables)]
    columns = [*(Column(n, unit) for n, _, unit in parts), Column("status", text=True)]
    rows = [[*(v[i] for _, v, _ in parts), s] for i, s in enumerate(found.status)]
    return Table(columns, rows, "front-designs", "Designs on the front.")
