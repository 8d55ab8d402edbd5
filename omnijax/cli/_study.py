"""Study files: what `check` says of them, and what a sweep or a sensitivity takes from one."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from .._errors import InputError, tell
from ._drive import Studied, studied
from ._motion import MotionOptions
from ._table import paragraph


class AskedStudy(NamedTuple):
    """Rig (a file where one was named), its drive, what varies over which levels, and metrics.

    `rtol` is that of a study file; None where it has none, and where options say all.
    """

    rig: Any
    motion: Studied
    vary: Any
    metrics: Any
    model: str
    rtol: float | None = None


def asked_of(
    kind: str, name: str, motion: MotionOptions, drive: Path | None, varied: tuple[str, list[str]],
    metric: str | None, model: str,
) -> AskedStudy:  # fmt: skip
    """What the options of `sweep` or `sensitivity` ask about a rig, or what a study file asks.

    `varied` is the option that says what varies, and its values.  Raises `InputError` where options
    were typed that stand in the study file, and for what these two commands have not.
    """
    option, vary = varied
    if kind == "study":
        typed = {option: vary, "metric": metric, "drive": drive} | vars(motion)
        return _of_study(name, typed | {"model": model != "coupled"})
    from ..rig import load_rig

    rig = load_rig(name)
    if motion.omega is not None and option == "vary":
        from ..study import refit_remarks, split_vary

        tell(refit_remarks(rig, tuple(split_vary(vary))))
    return AskedStudy(rig, studied(rig, motion, drive), vary, metric, model)


def _of_study(path: str, typed: dict[str, Any]) -> AskedStudy:
    wrong = [f"--{k} stands in the study file: give it there." for k, v in typed.items() if v]
    if wrong:
        raise InputError(wrong, path)
    from ..study import load_study

    study = load_study(path)
    if study.drives[1:]:
        raise InputError(f"takes one [[drive]] here, but has {len(study.drives)}.", path)
    if any(load.values for load in study.loads):
        raise InputError("takes no [[load]] here: put its numbers into the rig.", path)
    tables = {"[[constraint]]": study.constraints, "[tolerance]": study.tolerances}
    for table in (name for name, content in tables.items() if content):
        tell([f"{table} of the study is for `design`: left out here."])
    if any(kind != "uniform" for kind in study.distributions):
        tell(["`distribution` is for `global-sensitivity`: left out here."])
    pairs = zip(study.variables, study.levels, strict=True)
    own = {v.name: f"{'log:' * v.log}{v.low!r}:{v.high!r}:{n}" for v, n in pairs}
    drive_of = Studied(study.drives[0].drive, study.duration, study.rate)
    metrics = tuple(name for name, _ in study.weights)
    return AskedStudy(study.rig, drive_of, own, metrics, study.model, study.rtol)


def study_summary(path: str) -> dict[str, Any]:
    """What a study file varies and judges by; `InputError` with every problem at once."""
    from ..study import check_study, load_study

    study = load_study(path)
    check_study(study)
    return {
        "wheels": list(study.rig.names),
        "drives": {case.name: {case.kind: list(case.values)} for case in study.drives},
        "loads": [load.name for load in study.loads],
        "variables": {v.name: {"low": v.low, "high": v.high, "unit": v.unit}
                      for v in study.variables},
        "weights": dict(study.weights),
        "constraints": [limit.quantity for limit in study.constraints],
        "tolerances": dict(study.tolerances),
    }  # fmt: skip


def study_lines(path: str, summary: dict[str, Any]) -> Iterator[str]:
    """The same for people."""
    from .._text import quantity_text

    wheels = len(summary["wheels"])
    yield f"{path}: right. A study of a rig with {wheels} wheel{'s' * (wheels > 1)}."
    for name, drive in summary["drives"].items():
        kind, values = next(iter(drive.items()))
        unit = "rad/s" if kind == "speed" else "N m"
        told = ", ".join(quantity_text(x, unit) for x in values)
        said = name if name.startswith("drive") else f"drive {name}"
        yield paragraph(f"{said}: {kind} {told}", "  ")
    for name, v in summary["variables"].items():
        low, high = (quantity_text(v[key], v["unit"]) for key in ("low", "high"))
        yield paragraph(f"varies {name} from {low} to {high}", "  ")
    yield paragraph(f"judges by {', '.join(summary['weights'])}", "  ")
    if summary["constraints"]:
        yield paragraph(f"holds {', '.join(summary['constraints'])}", "  ")
    if summary["tolerances"]:
        pairs = (f"{k} ± {100 * v:g} %" for k, v in summary["tolerances"].items())
        yield paragraph(f"tolerances: {', '.join(pairs)}", "  ")
