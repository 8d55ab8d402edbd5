"""`omnijax design`: the best rig of a study."""

import dataclasses
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from ._options import Json, emit

Switch = Annotated[bool, Parameter(negative="")]


def design(
    study: Path,
    /,
    *,
    store: Path | None = None,
    resume: Switch = False,
    out: Path | None = None,
    rig: Path | None = None,
    report: Path | None = None,
    json: Json = False,
) -> int:
    """Search the best design of a study: bounds, constraints, drives, loads and tolerances.

    Example: omnijax design study.toml --rig best.toml --report page

    Exits with 1 where no design is optimal: what was found is printed with the reason.

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
    from ..rig import save_rig
    from ..study import design as run
    from ..study import designed_rig, load_study
    from ._study_page import deliver, progress

    asked = load_study(study)
    found = run(asked, out=store, resume=resume, report=progress("searches"))
    deliver(found, out)
    if rig is not None:
        save_rig(designed_rig(asked, found), rig)
    if report is not None:
        _page(report, found, asked)
    emit(json, dataclasses.asdict(found), lambda: print("\n".join(found.sentences())))
    return 0 if found.optimal else 1


def _page(folder: Path, found: Any, asked: Any) -> None:
    from ..report import Column, Table
    from ..rig import rig_text
    from ..study._design_plot import cases, searches
    from ._study_page import write_page

    names = list(found.variables)
    columns = [Column("variable", text=True), Column("value"), Column("unit", text=True)]
    rows = [[name, value, found.units[name]] for name, value in found.variables.items()]
    tables = [Table(columns, rows, "design", "The design.")]
    columns = [Column("status", text=True), Column(found.objective_name, found.unit)]
    columns += [Column(name, found.units[name]) for name in names]
    columns += [Column("KKT residual"), Column("evaluations")]
    ends = found.ends
    rows = [
        [ends["status"][i], ends["objective"][i], *ends["x"][i], ends["kkt_residual"][i],
         ends["evaluations"][i]]
        for i in range(len(ends["status"]))
    ]  # fmt: skip
    tables.append(Table(columns, rows, "searches", "Where every search ended."))
    figures = [
        ("searches", "Where every search ended.", lambda: searches(found),
         {f"objective / {found.unit}": ends["objective"]}),
    ]  # fmt: skip
    if len(found.cases) > 1:
        figures.append(("cases", "The objective in every case.", lambda: cases(found), {}))
    write_page(
        folder, "Design", "Which design vibrates least?", found.sentences(), figures, tables,
        rig_text(asked.rig), asked.seed,
    )  # fmt: skip
