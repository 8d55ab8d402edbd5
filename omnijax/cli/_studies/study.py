"""Study files: what `check` says of them, and what a sweep or a sensitivity takes from one."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from ..._errors import InputError, tell
from .._console import paragraph
from .._inputs import MotionOptions, Studied, studied


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
    from ...rig import load_rig

    rig = load_rig(name)
    if motion.omega is not None and option == "vary":
        from ...study import refit_remarks, split_vary

        tell(refit_remarks(rig, tuple(split_vary(vary))))
    return AskedStudy(rig, studied(rig, motion, drive), vary, metric, model)


def _of_study(path: str, typed: dict[str, Any]) -> AskedStudy:
    wrong = [f"--{k} stands in the study file: give it there." for k, v in typed.items() if v]
    if wrong:
        raise InputError(wrong, path)
    from ...study import load_study

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
    """What `design` would take a study file for; `InputError` with every problem at once."""
    from ...rig import parameter_info
    from ...study import check_study, load_study, objective_text
    from ...vibration import METRICS

    study = load_study(path)
    check_study(study)
    limit = study.limit
    return {
        "wheels": list(study.rig.names),
        "model": study.model,
        "duration": study.duration,
        "rate": study.rate,
        "rtol": study.rtol,
        "drives": {case.name: {case.kind: list(case.values)} for case in study.drives},
        "forces": {case.name: list(case.force) for case in study.drives},
        "loads": {load.name: dict(load.values) for load in study.loads},
        "variables": {v.name: {"low": v.low, "high": v.high, "unit": v.unit}
                      for v in study.variables},
        "objective": objective_text(study)[0],
        "weights": dict(study.weights),
        "over": study.over,
        "constraints": [side.text for wanted in study.constraints for side in wanted.sides],
        "tolerances": dict(study.tolerances),
        "spread": study.spread,
        "draws": study.draws,
        "pareto": list(study.pareto),
        "limit": None if limit is None else dict(
            zip(("metric", "max", "rise", "unit"), (*limit, METRICS[limit[0]].unit), strict=True)
        ),
        "units": {p: parameter_info(study.rig, p).unit for x in study.loads for p, _ in x.values},
    }  # fmt: skip


def study_lines(path: str, summary: dict[str, Any]) -> Iterator[str]:
    """The same for people."""
    wheels = len(summary["wheels"])
    yield f"{path}: right. A study of a rig with {wheels} wheel{'s' * (wheels > 1)}."
    for line in (*_cases(summary), *_goals(summary)):
        yield paragraph(line, "  ")


def _cases(summary: dict[str, Any]) -> Iterator[str]:
    """Drives and loads, for how long, and what varies."""
    from ..._text import quantity_text

    for name, drive in summary["drives"].items():
        kind, values = next(iter(drive.items()))
        unit = "rad/s" if kind == "speed" else "N m"
        told = ", ".join(quantity_text(x, unit) for x in values)
        force = summary["forces"][name]
        pushed = f"; force {', '.join(quantity_text(x, 'N') for x in force)}" if any(force) else ""
        yield f"{_named('drive', name)}: {kind} {told}{pushed}"
    for name, values in summary["loads"].items():
        told = [f"{p} {quantity_text(x, summary['units'][p])}" for p, x in values.items()]
        if told or len(summary["loads"]) > 1:
            yield f"{_named('load', name)}: {', '.join(told) or 'the rig as it is'}"
    yield _length(summary)
    for name, v in summary["variables"].items():
        low, high = (quantity_text(v[key], v["unit"]) for key in ("low", "high"))
        yield f"varies {name} from {low} to {high}"


def _named(kind: str, name: str) -> str:
    """A case's name with its kind, which names given by the reader hold already."""
    return name if name.startswith(kind) else f"{kind} {name}"


def _length(summary: dict[str, Any]) -> str:
    """The steady state, or runs of what length."""
    from ..._text import quantity_text
    from ...simulation import RATE

    model = "" if summary["model"] == "coupled" else f", {summary['model']} model"
    if summary["duration"] is None:
        return f"of the steady state: no duration is given{model}"
    rate = f"{summary['rate'] or RATE:g} samples a second"
    rtol = "" if summary["rtol"] is None else f", rtol {summary['rtol']:g}"
    return f"of runs of {quantity_text(summary['duration'], 's')}, {rate}{rtol}{model}"


def _goals(summary: dict[str, Any]) -> Iterator[str]:
    """What designs are judged by and held to."""
    from ..._text import quantity_text

    cases = len(summary["drives"]) * len(summary["loads"])
    yield f"judges by {summary['objective']}{f' of {cases} cases' if cases > 1 else ''}"
    if summary["constraints"]:
        yield f"holds {', '.join(summary['constraints'])}"
    if summary["tolerances"]:
        pairs = (f"{k} ± {100 * v:g} %" for k, v in summary["tolerances"].items())
        yield f"tolerances: {', '.join(pairs)}; {summary['draws']} draws, {summary['spread']}"
    if summary["pareto"]:
        yield f"front of {', '.join(summary['pareto'])}"
    if limit := summary["limit"]:
        most = (
            f"over {100 * limit['rise']:g} % above the nominal rig's"
            if limit["max"] is None
            else f"over {quantity_text(limit['max'], limit['unit'])}"
        )
        yield f"limit of tolerances: {limit['metric']} not {most}"
