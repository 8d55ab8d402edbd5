"""`omnijax tolerances`: how far parts may be off."""

from pathlib import Path
from typing import Any

from ._inputs import Whole
from ._studies import Results, finish, worked


def tolerances(
    study: Path,
    /,
    *,
    draws: Whole = 1024,
    results: Results = Results(),
) -> int:
    """Find tolerances of each wheel's parts that keep a metric below a limit.

    Example: omnijax tolerances study.toml --report page

    Exits with 1 where machines drawn afterwards do not confirm the tolerances.

    Parameters
    ----------
    study
        A study file with [limit]: metric, and max or rise.
    draws
        Number of drawn machines.
    """

    def run(asked: Any, **how: Any) -> Any:
        from ..study import tolerances

        return tolerances(asked, draws=draws, **how)

    asked, result = worked(study, results, "machines", run)
    finish(study, results, asked, result, _plain(result))
    return 0 if result.confirmed else 1


def _plain(result: Any) -> dict[str, Any]:
    return {
        "metric": result.metric,
        "limit": result.limit,
        "nominal": result.nominal,
        "share": result.share,
        "share_bounds": [result.share_low, result.share_high],
        "failed": result.failed,
        "linear": dict(zip(result.parts, result.linear.tolist(), strict=True)),
        "widths": dict(zip(result.parts, result.widths.tolist(), strict=True)),
        "confirmed": result.confirmed,
    }
