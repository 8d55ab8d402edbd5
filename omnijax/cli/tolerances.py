"""`omnijax tolerances`: how far parts may be off."""

from pathlib import Path
from typing import Any

from ._options import Whole
from ._study_page import Results, finish, worked


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
        A study file with [limit] metric and max.
    draws
        Number of drawn machines.
    """

    def run(asked: Any, **how: Any) -> Any:
        from ..study import tolerances

        return tolerances(asked, draws=draws, **how)

    asked, found = worked(study, results, "machines", run)
    finish(study, results, asked, found, _plain(found))
    return 0 if found.confirmed else 1


def _plain(found: Any) -> dict[str, Any]:
    return {
        "metric": found.metric,
        "limit": found.limit,
        "nominal": found.nominal,
        "share": found.share,
        "share_bounds": [found.share_low, found.share_high],
        "failed": found.failed,
        "linear": dict(zip(found.parts, found.linear.tolist(), strict=True)),
        "widths": dict(zip(found.parts, found.widths.tolist(), strict=True)),
        "confirmed": found.confirmed,
    }
