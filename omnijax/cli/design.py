"""`omnijax design`: the best rig of a study."""

import dataclasses
from pathlib import Path
from typing import Any

from ._options import Force, Json
from ._progress import bar
from ._study_page import Switch, deliver, kept, made_by, readable, write_page


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
    from .._files import claim
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
        lambda folder: _page(folder, found, study, asked),
        json,
        dataclasses.asdict(found),
    )
    return 0 if found.optimal else 1


def _page(folder: Path, found: Any, study: Path, asked: Any) -> None:
    from .._text import amount

    ends, order = found.ends, found.ranking
    figures = [
        ("searches", "Where every search ended, best first.", found.plot_searches,
         {"search / 1": list(range(1, len(order) + 1)),
          f"objective / {found.unit}": [ends["objective"][i] for i in order],
          "status": [ends["status"][i] for i in order]}),
    ]  # fmt: skip
    if len(found.cases) > 1:
        cases = {"case": list(found.cases)}
        cases |= {f"objective / {found.unit}": list(found.cases.values())}
        figures.append(("cases", "The objective in every case.", found.plot_cases, cases))
    given = [f"`{n}` = {amount(v, found.units[n])}" for n, v in found.variables.items()]
    head, *rest = found.sentences()
    lines = [f"{', '.join(given)}: {head}", *rest[len(given) :]]
    write_page(
        folder, "Design", "Which design vibrates least?", lines, figures, _tables(found),
        made_by(study, asked),
    )  # fmt: skip


def _tables(found: Any) -> list[Any]:
    """The design, and where every search ended."""
    import numpy as np

    from ..report import Column, Table

    columns = [Column("variable", text=True), Column("value"), Column("unit", text=True)]
    rows = [[n, *readable(v, found.units[n])] for n, v in found.variables.items()]
    tables = [Table(columns, rows, "design", "The design.")]
    ends, order = found.ends, found.ranking
    x = np.array(ends["x"])
    parts = [(found.objective_name, *readable(ends["objective"], found.unit))]
    parts += [(n, *readable(x[:, i], u)) for i, (n, u) in enumerate(found.units.items())]
    parts += [("KKT residual", ends["kkt_residual"], "")]
    if "infeasible" in ends["status"]:
        parts += [("violation", ends["violation"], "")]
    parts += [("evaluations", ends["evaluations"], "")]
    columns = [Column("search"), Column("status", text=True)]
    columns += [Column(name, unit) for name, _, unit in parts]
    rows = [
        [rank, ends["status"][i], *(values[i] for _, values, _ in parts)]
        for rank, i in enumerate(order, 1)
    ]
    words = "Where every search ended, best first."
    return [*tables, Table(columns, rows, "searches-table", words)]
