"""`omnijax tolerances`: how far parts may be off."""

from pathlib import Path
from typing import Any

from .._files import claim
from .._reading import existing
from ._options import Force, Json
from ._progress import bar
from ._study_page import Switch, deliver, kept, made_by


def tolerances(
    study: Path,
    /,
    *,
    draws: int = 1024,
    store: Path | None = None,
    resume: Switch = False,
    out: Path | None = None,
    report: Path | None = None,
    force: Force = False,
    json: Json = False,
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
    store
        A folder for finished chunks of machines.
    resume
        Take up the machines of that folder.
    out
        A netCDF file for the result.
    report
        A folder for a page with the figure.
    """

    existing(study)
    from ..study import load_study
    from ..study import tolerances as run

    asked = load_study(study)
    claim([out], [report], force=force)
    with kept(store), bar("machines") as progress:
        found = run(asked, draws=draws, out=store, resume=resume, report=progress)
    deliver(
        found,
        out,
        report,
        lambda: made_by(study, asked),
        json,
        _plain(found),
    )
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
