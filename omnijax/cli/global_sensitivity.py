"""`omnijax global-sensitivity`: what matters over whole ranges."""

from pathlib import Path
from typing import Any

from ._studies import Results, finish, worked


def global_sensitivity(
    study: Path,
    /,
    *,
    metric: str | None = None,
    results: Results = Results(),
) -> int:
    """Sobol indices, Morris effects and gradient-based bounds over the ranges of a study.

    Example: omnijax global-sensitivity study.toml --metric rms,peak --report page

    Parameters
    ----------
    study
        A study file with [[variable]] ranges and a [[drive]].
    metric
        Metrics, with commas between; without it those of the objective.
    """

    def run(asked: Any, **how: Any) -> Any:
        from ..study import global_sensitivity

        return global_sensitivity(asked, metric, **how)

    asked, result = worked(study, results, "runs", run)
    finish(study, results, asked, result, _plain(result))
    return 0


def _plain(result: Any) -> dict[str, Any]:
    return {
        "runs": result.runs,
        "failed": list(result.failed),
        "metrics": {
            name: {
                key: dict(zip(result.inputs, getattr(where, key)[m].tolist(), strict=True))
                for where, keys in (
                    (result.sobol, ("first", "first_half", "total", "total_half")),
                    (result.morris, ("mu", "mu_star", "sigma")),
                    (result, ("bound",)),
                )
                for key in keys
            }
            for m, name in enumerate(result.metrics)
        },
    }
