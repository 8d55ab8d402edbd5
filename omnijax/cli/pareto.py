"""`omnijax pareto`: the trade-off between metrics."""

from pathlib import Path
from typing import Any

from ._studies import Results, finish, worked


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
        from ..study import pareto

        return pareto(asked, metric or (), **how)

    asked, front = worked(study, results, "searches", run)
    finish(study, results, asked, front, _plain(front), lambda: _print(front))
    return 0


def _plain(front: Any) -> dict[str, Any]:
    return {
        "metrics": dict(zip(front.metrics, front.units, strict=True)),
        "variables": list(front.variables),
        "values": front.values.tolist(),
        "x": front.x.tolist(),
        "status": list(front.status),
        "evaluations": front.evaluations,
    }


def _print(front: Any) -> None:
    import numpy as np

    from .._text import scaled
    from ._console import columns, paragraph

    for sentence in front.sentences():
        print(paragraph(sentence))
    heads, units, cells = ["design"], [""], [[str(k + 1) for k in range(len(front.values))]]
    values = np.concatenate([front.values, front.x], axis=1)
    for (name, unit), own in zip(_both(front), values.T, strict=True):
        factor, written = scaled(float(np.max(np.abs(own))), unit)
        heads.append(name)
        units.append(written)
        cells.append([f"{factor * x:.5g}" for x in own])
    print("\n".join(columns([heads, units, *map(list, zip(*cells, strict=True))])))


def _both(front: Any) -> list[tuple[str, str]]:
    named = (*front.metrics, *front.variables), (*front.units, *front.variable_units)
    return list(zip(*named, strict=True))
