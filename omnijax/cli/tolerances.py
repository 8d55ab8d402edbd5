"""`omnijax tolerances`: how far parts may be off."""

from pathlib import Path
from typing import Any

from ._options import Json, emit


def tolerances(
    study: Path,
    /,
    *,
    draws: int = 1024,
    out: Path | None = None,
    report: Path | None = None,
    json: Json = False,
) -> int:
    """Find tolerances of each wheel's parts that keep a metric below a limit.

    Example: omnijax tolerances study.toml --report page

    Parameters
    ----------
    study
        A study file with [limit] metric and max.
    draws
        Number of drawn machines.
    out
        A netCDF file for the result.
    report
        A folder for a page with the figure.
    """
    from .._errors import InputError
    from ..study import load_study
    from ..study import tolerances as run
    from ._study_page import deliver

    if draws < 64:
        raise InputError(f"`draws` must be at least 64, but is {draws}.")
    asked = load_study(study)
    found = run(asked, draws=draws)
    deliver(found, out)
    if report is not None:
        _page(report, found, asked)
    emit(json, _plain(found), lambda: print("\n".join(found.sentences())))
    return 0


def _plain(found: Any) -> dict[str, Any]:
    return {
        "metric": found.metric,
        "limit": found.limit,
        "nominal": found.nominal,
        "share": found.share,
        "share_bounds": [found.share_low, found.share_high],
        "linear": dict(zip(found.parts, found.linear.tolist(), strict=True)),
        "confirmed": dict(zip(found.parts, found.confirmed.tolist(), strict=True)),
    }


def _page(folder: Path, found: Any, asked: Any) -> None:
    from ..report import Column, Table
    from ..rig import rig_text
    from ._study_page import write_page

    columns = [Column("part", text=True), Column("slope", found.unit)]
    columns += [Column("by derivatives", "± %"), Column("confirmed", "± %")]
    both = zip(found.parts, found.slopes, found.linear, found.confirmed, strict=True)
    rows = [[part, slope, 100 * linear, 100 * sure] for part, slope, linear, sure in both]
    data = {"part": list(found.parts), "tolerance / %": 100 * found.confirmed}
    figures = [("tolerances", "How far each part may be off.", found.plot, data)]
    lines = [found.sentences()[0], found.sentences()[-1]]
    write_page(
        folder, "Tolerances", "How precisely must each wheel be made?", lines, figures,
        [Table(columns, rows, "parts", "Tolerances.")], rig_text(asked.rig), asked.seed,
    )  # fmt: skip
