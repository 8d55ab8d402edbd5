"""`omnijax pareto`: the trade-off between metrics."""

from pathlib import Path
from typing import Any

from .._files import claim
from .._reading import existing
from ._options import Force, Json
from ._progress import bar
from ._study_page import Switch, deliver, kept, made_by


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

    existing(study)
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
        lambda: made_by(study, asked),
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


def _both(found: Any) -> list[tuple[str, str]]:
    return list(zip(found.metrics, found.units, strict=True))
