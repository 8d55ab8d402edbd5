"""Study files: what to vary, what to judge by, under which drives and loads; TOML -> `Study`."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..._errors import InputError, tell
from ..._reading import read_toml
from ...rig import Rig, bundled_rigs, kind_of, load_rig
from .._evaluation import drive_quantities, without_run
from .._parameters import joint_problems, overlap_problems, overlaps, refit_remarks
from .._problem import check_variables
from .cases import cases, variables
from .goals import constraint, objective, search, tolerances
from .problems import checked
from .reach import reach, tolerance_problems
from .read import Reader
from .study import Study

NO_RIG = "`rig` is missing: name a rig file beside the study, or a bundled rig ({})."


def load_study(path: str | Path) -> Study:
    """The study of a TOML file; its numbers are SI.

    Raises `InputError` with every problem of the file at once.
    """
    file = Path(path)
    try:
        data = read_toml(file)
    except OSError as error:
        raise InputError(f"the study file cannot be read: {error.strerror}.", path) from None
    return parse_study(data, file)


def parse_study(data: Mapping[str, Any], path: str | Path | None = None) -> Study:
    """The study of tables as `tomllib` gives them; `rig` is relative to the folder of `path`.

    Its numbers are SI.  Raises `InputError` with every problem of the tables at once.
    """
    if kind_of(data) == "machine":
        raise InputError("is a machine file (of an axis), not a study file.", path)
    if {"sphere", "wheel"} <= set(data):
        raise InputError(
            f'is a rig file, not a study file: a study names it with rig = "{path}".', path
        )
    top, problems, dropped = checked(data)
    read = Reader(problems, dropped)
    if not top.rig:  # its numbers speak of no machine
        missing = [] if "rig" in data else [NO_RIG.format(", ".join(bundled_rigs()))]
        raise InputError(missing + read.problems, path)
    rig = _rig(top.rig, path)
    fields: dict[str, Any] = {
        "rig": rig, "model": top.model, "duration": top.duration, "rate": top.rate,
        "rtol": top.rtol,
    }  # fmt: skip
    fields |= cases(read, rig, top)
    fields |= variables(read, rig, fields["drives"], top)
    fields |= objective(read, top.objective)
    fields |= tolerances(read, rig, top.tolerance)
    fields |= search(read, top)
    limits = (constraint(read, block) for block in top.constraint)
    fields["constraints"] = tuple(limit for limit in limits if limit is not None)
    read.problems += without_run(top.duration, rate=top.rate, rtol=top.rtol)
    if not read.problems:
        read.problems += _overlaps(rig, fields)
    if not read.problems:
        read.problems += _out_of_reach(rig, fields)
    if not read.problems and fields["variables"]:
        try:
            check_variables(fields["variables"])
        except InputError as error:
            read.problems += error.problems
    if read.problems:
        raise InputError(read.problems, path)
    if any(block.omega for block in top.drive):
        loads = [name for load in fields["loads"] for name, _ in load.values]
        paths = dict.fromkeys([*(v.name for v in fields["variables"]), *loads])
        tell(refit_remarks(rig, tuple(paths)))
    return Study(**fields)


def _overlaps(rig: Rig, fields: Mapping[str, Any]) -> list[str]:
    """Parameters that two entries would both set: variables, loads, both."""
    of_drive = drive_quantities(fields["drives"][0].drive, rig.names)
    varied = list(dict.fromkeys(v.name for v in fields["variables"]))
    problems = [f"`variable`: {told}" for told in overlap_problems(rig, varied, of_drive)]
    for load in fields["loads"]:
        paths = [path for path, _ in load.values]
        problems += [f"load `{load.name}`: {told}" for told in overlap_problems(rig, paths)]
        problems += [
            f"`{name}` is a variable, but load `{load.name}` sets it as well."
            for name in varied
            if name not in of_drive and any(overlaps(rig, [path, name]) for path in paths)
        ]
    return problems


def _out_of_reach(rig: Rig, fields: Mapping[str, Any]) -> list[str]:
    """Parameters that variables, loads and tolerances together take where they cannot be."""
    of_drive = drive_quantities(fields["drives"][0].drive, rig.names)
    own = [v for v in fields["variables"] if v.name not in of_drive]
    reached = reach(rig, own, fields["loads"])
    return tolerance_problems(rig, fields["tolerances"], reached) or joint_problems(rig, reached)


def _rig(name: str, path: str | Path | None) -> Rig:
    beside = Path("." if path is None else Path(path).parent) / name
    if not beside.exists() and not Path(name).exists() and name not in bundled_rigs():
        rigs = ", ".join(bundled_rigs())
        raise InputError(f'rig = "{name}": there is no such file; bundled rigs: {rigs}.', path)
    return load_rig(beside if beside.exists() else name)


def study_of(study: "str | Path | Mapping | Study") -> Study:
    """A study from a file, from tables, or as it is."""
    if isinstance(study, Study):
        return study
    return parse_study(study) if isinstance(study, Mapping) else load_study(study)
