"""`omnijax design`: the best rig of a study."""

import dataclasses
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from ._inputs import check_ending
from ._studies import Results, finish, worked


def design(
    study: Path,
    /,
    *,
    results: Results = Results(),
    rig: Path | None = None,
) -> int:
    """Search the best design of a study: bounds, constraints, drives, loads and tolerances.

    Example: omnijax design study.toml --rig best.toml --report page

    Exits with 1 where no design is optimal (what was found is printed with the reason), and
    with 2 where no design meets all constraints.

    Parameters
    ----------
    study
        A study file.
    rig
        A rig file for the design: the study's rig with the design's values. Loads of the study
        are not in it, nor variables of its drive.
    """

    def run(asked: Any, **how: Any) -> Any:
        from ..study import design

        return design(asked, **how)

    def files(asked: Any) -> Iterable[Path]:
        from ..rig import files_of_rig

        return () if rig is None else files_of_rig(asked.rig, rig)

    check_ending(rig, ".toml")
    asked, result = worked(study, results, "searches", run, files)
    if result.status == "infeasible":
        from .._errors import InputError

        raise InputError(f"{result.reason}.", study)
    if rig is not None:
        from ..rig import save_rig
        from ..study import designed_rig

        save_rig(designed_rig(asked, result), rig)
    finish(study, results, asked, result, dataclasses.asdict(result))
    return 0 if result.optimal else 1
