"""`omnijax global-sensitivity`: what matters over whole ranges."""

from pathlib import Path
from typing import Any

from .._files import claim
from .._reading import existing
from ._options import Force, Json
from ._progress import bar
from ._study_page import Switch, deliver, kept, made_by


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

    existing(study)
    from ..study import checked_metrics, load_study
    from ..study import global_sensitivity as run

    asked = load_study(study)
    claim([out], [report], force=force)
    metrics = None if metric is None else checked_metrics(metric)
    with kept(store), bar("runs") as report_progress:
        found = run(asked, metrics, out=store, resume=resume, report=report_progress)
    deliver(
        found,
        out,
        report,
        lambda: made_by(study, asked),
        json,
        _plain(found),
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
