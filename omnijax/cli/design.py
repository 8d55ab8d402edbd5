"""`omnijax design`: the best rig of a study."""

import dataclasses
from pathlib import Path
from typing import Any

from ._options import Json
from ._progress import bar
from ._study_page import Switch, deliver, kept, write_page


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
    from ..rig import save_rig
    from ..study import design as run
    from ..study import designed_rig, load_study

    asked = load_study(study)
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
        lambda folder: _page(folder, found, asked),
        json,
        dataclasses.asdict(found),
    )
    return 0 if found.optimal else 1


def _page(folder: Path, found: Any, asked: Any) -> None:
    from ..report import Column, Table
    from ..rig import rig_text
    from ..study import scaled

    names = list(found.variables)
    factor, unit = scaled(found.objective, found.unit)
    columns = [Column("variable", text=True), Column("value"), Column("unit", text=True)]
    rows = [[name, value, found.units[name]] for name, value in found.variables.items()]
    tables = [Table(columns, rows, "design", "The design.")]
    columns = [Column("search"), Column("status", text=True), Column(found.objective_name, unit)]
    columns += [Column(name, found.units[name]) for name in names]
    columns += [Column("KKT residual"), Column("evaluations")]
    ends, order = found.ends, found.ranking
    rows = [
        [rank, ends["status"][i], factor * ends["objective"][i], *ends["x"][i],
         ends["kkt_residual"][i], ends["evaluations"][i]]
        for rank, i in enumerate(order, 1)
    ]  # fmt: skip
    tables.append(Table(columns, rows, "searches-table", "Where every search ended, best first."))
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
    write_page(
        folder, "Design", "Which design vibrates least?", found.sentences(), figures, tables,
        rig_text(asked.rig), asked.seed,
    )  # fmt: skip
