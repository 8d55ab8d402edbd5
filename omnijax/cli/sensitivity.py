"""`omnijax sensitivity`: what each parameter does to the vibration."""

from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Parameter

from .._files import claim
from ._axis import refuse, refuse_drive, sensitivity_axis
from ._kind import file_kind
from ._motion import Motion
from ._options import Json, Overwrite, Whole, check_netcdf
from ._study_page import Switch, deliver, made_by_rig


def sensitivity(
    rig: str,
    /,
    *,
    motion: Motion = Motion(),
    metric: str | None = None,
    drive: Path | None = None,
    parameter: Annotated[list[str], Parameter(negative="")] = [],  # noqa: B006
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
        A rig file, or the name of a bundled rig; or a machine file of an axis.
    metric
        Metrics, with commas between; rms,peak where not given.
    drive
        Of a machine file: the log under whose inputs it moves; metrics are then rms, mae and peak
        of measured less simulated position.
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
    from ..rig import load_rig

    if top < 1:
        raise InputError(f"`top` must be at least 1, but is {top}.")
    check_netcdf(out)
    metric = metric or "rms,peak"
    if file_kind(rig) == "machine":
        refuse({"model": model != "coupled", "check": check} | vars(motion), "sensitivity")
        claim([out], [report], force=overwrite)
        found, made = sensitivity_axis(rig, drive, metric, parameter)
    else:
        refuse_drive(drive)
        machine = load_rig(rig)
        from ..study import sensitivity as run

        claim([out], [report], force=overwrite)
        found = run(
            machine, motion.drive(machine.size), metric, parameters=parameter or None,
            duration=motion.seconds, rate=motion.hertz, model=model, check=check,
        )  # fmt: skip

        def made():
            return made_by_rig(machine)

    deliver(
        found,
        out,
        report,
        made,
        json,
        _plain(found),
        lambda: _print(found, per_wheel, top),
    )
    return 0


def _plain(found: Any) -> dict[str, Any]:
    return {
        "method": found.method,
        "metrics": {
            name: {
                "value": float(found.figures[m]),
                "unit": found.metric_units[m],
                "relative": found.column(name),
                "together": found.together(name),
                "raw": dict(zip(found.parameters, found.raw[m].tolist(), strict=True)),
            }
            for m, name in enumerate(found.metrics)
        },
        "without_influence": list(found.without_influence()),
        "check": None if found.check is None else found.check.worst,
    }


def _print(found: Any, per_wheel: bool, top: int) -> None:
    from rich.console import Console
    from rich.table import Table

    from .._text import amount
    from ._table import paragraph

    console = Console(markup=False, highlight=False)
    console.print(f"{found.how}; change of the metric in % per % of the parameter")
    for m, name in enumerate(found.metrics):
        console.print(f"\n{name} = {amount(float(found.figures[m]), found.metric_units[m])}")
        table = Table("parameter", "% per %", box=None, padding=(0, 2))
        pairs = found.column(name) if per_wheel else found.together(name)
        for path, value in list(pairs.items())[:top]:
            if value != 0:
                table.add_row(path, f"{value:+.4g}")
        console.print(table)
    for line in found.sentences():
        console.print(f"\n{paragraph(line)}")
    if found.check is not None:
        console.print(f"worst relative error against finite differences: {found.check.worst:.2g}")
