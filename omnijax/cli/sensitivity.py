"""`omnijax sensitivity`: what each parameter does to the vibration."""

from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Parameter

from .._files import claim
from ._inputs import (
    Json,
    MotionOptions,
    Overwrite,
    Whole,
    check_ending,
    file_kind,
    refuse,
    sensitivity_axis,
)
from ._studies import Switch, asked_of, deliver, made_by_rig


def sensitivity(
    rig: str,
    /,
    *,
    motion: MotionOptions = MotionOptions(),
    metric: str | None = None,
    drive: Path | None = None,
    parameter: Annotated[list[str], Parameter(negative="", show_default=False)] = [],  # noqa: B006
    model: Literal["coupled", "paper"] = "coupled",
    check: Switch = False,
    per_wheel: Switch = False,
    top: Whole = 12,
    out: Path | None = None,
    report: Path | None = None,
    overwrite: Overwrite = False,
    json: Json = False,
) -> int:
    """Rank the parameters by what they do to vibration: exact derivatives, % per %.

    Example: omnijax sensitivity atlas --speed 3,5,7 --metric rms,peak --check

    With --duration a run is differentiated, without it the steady state; torques need one.

    Parameters
    ----------
    rig
        A rig file, the name of a bundled rig, or a study file (its drive, metrics and, where it
        has any, [[variable]] paths); or a machine file of an axis.
    metric
        Metrics, with commas between; rms,peak where not given.
    drive
        A table of wheel speeds or a recording, as for simulate. Of a machine file: the log under
        whose inputs it moves; metrics are then rms, mae and peak of measured less simulated
        position.
    parameter
        Only this parameter (may be given again); contact.stiffness means that of every wheel.
    model
        The coupled model, or the paper's.
    check
        Compare with finite differences and print the worst relative error.
    per_wheel
        Rank each wheel's parameters by themselves instead of all wheels together.
    top
        How many parameters are listed.
    out
        A netCDF file for the result.
    report
        A folder for a page with the tornado figures.
    """
    from .._errors import InputError

    if top < 1:
        raise InputError(f"`top` must be at least 1, but is {top}.")
    check_ending(out, ".nc")
    kind = file_kind(rig)
    if kind == "machine":
        refuse({"model": model != "coupled", "check": check} | vars(motion), "sensitivity")
        claim([out], [report], force=overwrite)
        result, made = sensitivity_axis(rig, drive, metric or "rms,peak", parameter)
    else:
        asked = asked_of(kind, rig, motion, drive, ("parameter", parameter), metric, model)
        from ..study import sensitivity as run

        claim([out], [report], force=overwrite)
        metrics = "rms,peak" if asked.metrics is None else asked.metrics
        result = run(
            asked.rig, metrics=metrics, parameters=list(asked.vary) or None, model=asked.model,
            rtol=asked.rtol, check=check, **asked.motion._asdict(),
        )  # fmt: skip

        def made():
            return made_by_rig(asked.rig)

    deliver(
        result,
        out,
        report,
        made,
        json,
        _plain(result),
        lambda: _print(result, per_wheel, top),
    )
    return 0


def _plain(result: Any) -> dict[str, Any]:
    return {
        "method": result.method,
        "metrics": {
            name: {
                "value": float(result.figures[m]),
                "unit": result.metric_units[m],
                "relative": result.column(name),
                "together": result.together(name),
                "raw": dict(zip(result.parameters, result.raw[m].tolist(), strict=True)),
            }
            for m, name in enumerate(result.metrics)
        },
        "without_influence": list(result.without_influence()),
        "check": None if result.check is None else result.check.worst,
    }


def _print(result: Any, per_wheel: bool, top: int) -> None:
    from rich.console import Console
    from rich.table import Table

    from .._text import quantity_text
    from ._console import paragraph

    console = Console(markup=False, highlight=False)
    console.print(f"{result.how}; change of the metric in % per % of the parameter")
    for m, name in enumerate(result.metrics):
        console.print(
            f"\n{name} = {quantity_text(float(result.figures[m]), result.metric_units[m])}"
        )
        table = Table("parameter", "% per %", box=None, padding=(0, 2))
        pairs = result.column(name) if per_wheel else result.together(name)
        for path, value in list(pairs.items())[:top]:
            if value != 0:
                table.add_row(path, f"{value:+.4g}")
        console.print(table)
    for line in result.sentences():
        console.print(f"\n{paragraph(line)}")
    if result.check is not None:
        console.print(f"worst relative error against finite differences: {result.check.worst:.2g}")
