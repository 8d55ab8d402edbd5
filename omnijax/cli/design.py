"""`omnijax design`: the best rig of a study."""

import dataclasses
from pathlib import Path

from .._files import claim
from .._reading import existing
from ._options import Force, Json
from ._progress import bar
from ._study_page import Switch, deliver, kept, made_by


def design(
    study: Path,
    /,
    *,
    store: Path | None = None,
    resume: Switch = False,
    out: Path | None = None,
    rig: Path | None = None,
    report: Path | None = None,
    force: Force = False,
    json: Json = False,
) -> int:
    """Search the best design of a study: bounds, constraints, drives, loads and tolerances.

    Example: omnijax design study.toml --rig best.toml --report page

    Exits with 1 where no design is optimal (what was found is printed with the reason), and
    with 2 where no design meets all constraints.

    Parameters
    ----------
    study
        A study file.
    store
        A folder for finished searches.
    resume
        Take up the searches of that folder.
    out
        A netCDF file for the result.
    rig
        A rig file for the design.
    report
        A folder for a page with the figures.
    """
    from .._errors import InputError

    existing(study)
    from ..rig import files_of_rig, save_rig
    from ..study import design as run
    from ..study import designed_rig, load_study

    asked = load_study(study)
    claim([out, *([] if rig is None else files_of_rig(asked.rig, rig))], [report], force=force)
    with kept(store), bar("searches") as report_progress:
        found = run(asked, out=store, resume=resume, report=report_progress)
    if found.status == "infeasible":
        raise InputError(f"{found.reason}.", study)
    if rig is not None:
        save_rig(designed_rig(asked, found), rig)
    deliver(
        found,
        out,
        report,
        lambda: made_by(study, asked),
        json,
        dataclasses.asdict(found),
    )
    return 0 if found.optimal else 1
