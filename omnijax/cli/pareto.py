"""`omnijax pareto`: the trade-off between metrics."""

from pathlib import Path
from typing import Any

from ._study_page import Results, finish, worked


def pareto(
    study: Path,
    /,
    *,
    metric: str | None = None,
    results: Results = Results(),
) -> int:
    """Trace the front of two or three metrics: nothing better in one without loss in another.

    Example: omnijax pareto study.toml --metric rms,sphere_acceleration_rms --report page

    Parameters
    ----------
    study
        A study file; its [pareto] table names the metrics and the number of points.
    metric
        Two or three metrics with commas between, in place of the file's.
    """

    def run(asked: Any, **how: Any) -> Any:
        from ..study import checked_metrics, pareto

        return pareto(asked, () if metric is None else checked_metrics(metric), **how)

    asked, found = worked(study, results, "searches", run)
    finish(study, results, asked, found, _plain(found), lambda: _print(found))
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
