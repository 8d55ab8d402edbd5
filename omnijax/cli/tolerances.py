"""`omnijax tolerances`: how far parts may be off."""

from pathlib import Path
from typing import Any

from ._options import Force, Json
from ._progress import bar
from ._study_page import Switch, deliver, kept, made_by, readable, write_page

WORDS = (
    "Tolerances: by the derivatives alone, and so that machines drawn afterwards confirm them. The "
    "third column is the derivative for a change of the part by 1 %."
)
TIGHTEST = 3  # parts named in the answer


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
    from .._files import claim
    from ..study import load_study
    from ..study import tolerances as run

    asked = load_study(study)
    claim([out], [report], force=force)
    with kept(store), bar("machines") as progress:
        found = run(asked, draws=draws, out=store, resume=resume, report=progress)
    deliver(
        found, out, report, lambda folder: _page(folder, found, study, asked), json, _plain(found)
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


def _page(folder: Path, found: Any, study: Path, asked: Any) -> None:
    import numpy as np

    from .._text import amount
    from ..report import Column, Table

    slopes, unit = readable(found.slopes / 100, found.unit)
    columns = [Column("part", text=True), Column("nominal", text=True)]
    columns += [
        Column(f"change of {found.metric}", f"{unit} per %"),
        Column("by derivatives", "± %"),
    ]
    columns += [Column("by drawn machines", "± %"), Column("in its unit", text=True)]
    rows = [
        [part, amount(found.values[i], found.units[i]), slopes[i], 100 * found.linear[i],
         100 * found.widths[i], f"± {found.own_width(i)}"]
        for i, part in enumerate(found.parts)
    ]  # fmt: skip
    data = {"part": list(found.parts), "tolerance / %": 100 * found.widths}
    pale = " Pale: capped, hardly matters." if found.capped.any() else ""
    caption = f"How far each part may be off.{pale}"
    figures = [("tolerances", caption, found.plot_widths, data)]
    tightest = [
        f"`{found.parts[i]}` to {found.width_text(i)}" for i in np.argsort(found.widths)[:TIGHTEST]
    ]
    head, *rest = found.sentences()
    lines = [
        f"Hold {', '.join(tightest)}"
        + (", and the others as below" if len(found.parts) > TIGHTEST else "")
        + f": then {head}",
        *rest[len(found.parts) :],
    ]
    write_page(
        folder, "Tolerances", "How precisely must each wheel be made?", lines, figures,
        [Table(columns, rows, "parts", WORDS)], made_by(study, asked),
    )  # fmt: skip
