"""`omnijax tolerances`: how far parts may be off."""

from pathlib import Path
from typing import Any

from ._options import Json
from ._progress import bar
from ._study_page import Switch, deliver, kept, write_page

WORDS = (
    "Tolerances: by the derivatives alone, and so that machines drawn afterwards confirm them. The "
    "second column is the derivative for a relative change of the part."
)


def tolerances(
    study: Path,
    /,
    *,
    draws: int = 1024,
    store: Path | None = None,
    resume: Switch = False,
    out: Path | None = None,
    report: Path | None = None,
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
    from ..study import load_study
    from ..study import tolerances as run

    asked = load_study(study)
    with kept(store), bar("machines") as progress:
        found = run(asked, draws=draws, out=store, resume=resume, report=progress)
    deliver(found, out, report, lambda folder: _page(folder, found, asked), json, _plain(found))
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


def _page(folder: Path, found: Any, asked: Any) -> None:
    from ..report import Column, Table
    from ..rig import rig_text

    columns = [Column("part", text=True), Column(f"{found.metric} by", f"{found.unit} per 100 %")]
    columns += [Column("by derivatives", "± %"), Column("by drawn machines", "± %")]
    both = zip(found.parts, found.slopes, found.linear, found.widths, strict=True)
    rows = [[part, slope, 100 * linear, 100 * sure] for part, slope, linear, sure in both]
    data = {"part": list(found.parts), "tolerance / %": 100 * found.widths}
    figures = [("tolerances", "How far each part may be off.", found.plot_widths, data)]
    lines = [found.sentences()[0], found.sentences()[-1]]
    write_page(
        folder, "Tolerances", "How precisely must each wheel be made?", lines, figures,
        [Table(columns, rows, "parts", WORDS)], rig_text(asked.rig), asked.seed,
    )  # fmt: skip
