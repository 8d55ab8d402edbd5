"""`omnijax sweep`: metrics of many designs."""

from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Parameter

from ._options import Json, emit

SHOWN = 5  # failed designs that are listed
Once = Annotated[list[str], Parameter(negative="")]
Switch = Annotated[bool, Parameter(negative="")]


def sweep(
    rig: str,
    /,
    *,
    vary: Once,
    metric: str = "peak,rms",
    speed: str | None = None,
    torque: str | None = None,
    force: str | None = None,
    duration: str | None = None,
    rate: float | None = None,
    sampler: Literal["grid", "lhs", "sobol"] = "grid",
    samples: int | None = None,
    seed: int = 0,
    gradient: Switch = False,
    model: Literal["coupled", "paper"] = "coupled",
    solver: str = "auto",
    rtol: float | None = None,
    max_steps: int | None = None,
    out: Path | None = None,
    resume: Switch = False,
    chunk: int | None = None,
    devices: int = 1,
    workers: int | None = None,
    scheduler: str | None = None,
    plot: Path | None = None,
    report: Path | None = None,
    json: Json = False,
) -> int:
    """Compute metrics of many designs: a grid, a list, or samples of ranges.

    Example: omnijax sweep atlas --vary wheel.roundness=0.1:0.6:50 --vary
    contact.stiffness=log:5e4:1e6:40 --metric peak,rms --speed 0.1,1.2,0.3 --out sweep.zarr

    Without --duration the figures are those of the steady state. A killed or interrupted sweep
    goes on with the same command and --resume; omnijax sweep-status shows it from elsewhere.

    Parameters
    ----------
    rig
        A rig file, or the name of a bundled rig.
    vary
        PATH=low:high:count, PATH=log:low:high:count, PATH=a,b,c, or PATH=low:high for samples;
        once for each parameter. PATH is a rig parameter, speed.WHEEL, speed.scale or force.x.
    metric
        Metrics, with commas between.
    speed
        Wheel speeds in rad/s, one a wheel; or with units (30 rpm,0,10 rpm).
    torque
        Motor torques in N m, one a wheel, instead of speeds.
    force
        Force on the platform in N: x,y,z.
    duration
        Length of each run in s (2, 2s, 500ms).
    rate
        Samples per s of each run (500).
    sampler
        Grid, Latin hypercube (lhs) or Sobol points.
    samples
        Number of designs of lhs and sobol.
    seed
        Seed of lhs and sobol.
    gradient
        Also store the derivative of each metric to each varied parameter.
    model
        Translation model.
    solver
        Solver of full simulations.
    rtol
        Relative tolerance of full simulations.
    max_steps
        Most steps of a full simulation before its status is `step limit`.
    out
        Folder of the zarr store; without it nothing is kept.
    resume
        Continue the store in --out.
    chunk
        Designs stored together: what a kill can lose.
    devices
        Local devices to spread each batch over.
    workers
        Processes of a local Dask cluster.
    scheduler
        Address of a running Dask scheduler (tcp://host:8786).
    plot
        Picture of the first metric: a heat map, or lines (.svg, .png, .pdf).
    report
        Folder for a page of the sweep (index.html) with its figures and numbers.
    """
    import shlex
    import sys
    import time

    from ..study import sweep as evaluate
    from ..study._sweep_progress import Bar

    began = time.monotonic()
    with Bar() as advance:
        result = evaluate(
            rig, vary, metric, drive=_drive(speed, torque, force), duration=_duration(duration),
            rate=rate, model=model, solver=solver, rtol=rtol, max_steps=max_steps,
            sampler=sampler, samples=samples, seed=seed, gradient=gradient, out=out,
            resume=resume, chunk=chunk, devices=devices, workers=workers, scheduler=scheduler,
            report=advance,
            command=shlex.join(["omnijax", *sys.argv[1:]]),
        )  # fmt: skip
    summary = summarise(result) | {"seconds": time.monotonic() - began}
    if plot is not None:
        summary["plot"] = str(_plot(result, plot))
    if report is not None:
        from ..report import sweep_page

        summary["report"] = str(sweep_page(result).write(report))
    emit(json, summary, lambda: show(result, summary))
    return 0


def _drive(speed: str | None, torque: str | None, force: str | None) -> Any:
    from .._errors import InputError
    from ..simulate import speeds, torques

    if (speed is None) == (torque is None):
        raise InputError("give either --speed or --torque, one value a wheel.")
    push = _numbers("force", force or "0,0,0", "N")
    if len(push) != 3:
        raise InputError(f"`force` must have 3 components, but has {len(push)}.")
    if speed is not None:
        return speeds(_numbers("speed", speed, "rad/s"), push)
    return torques(_numbers("torque", torque or "", "N m"), push)


def _numbers(name: str, text: str, unit: str) -> list[float]:
    from .._errors import InputError
    from ..study._axes import read_number

    try:
        return [read_number(part.strip(), unit) for part in text.split(",")]
    except ValueError as error:
        raise InputError(f"`{name}` {error}") from None


def _duration(text: str | None) -> float | None:
    return None if text is None else _numbers("duration", text, "s")[0]


def summarise(result: Any) -> dict[str, Any]:
    """What a sweep came to, for machines."""
    best = {}
    for name in result.spec.metrics:
        index = result.best(name)
        if index is not None:
            best[name] = {"design": index, "unit": result.unit(name)} | result.design(index)
            best[name]["status"] = result.status(index)
    return {
        "designs": result.size,
        "path": result.spec.path,
        "why": result.path,
        "status": result.counts(),
        "best": best,
        "failed": [{"design": i, "rerun": result.command(i)} for i in result.failed(SHOWN)],
        "out": None if result.store.folder is None else str(result.store.folder),
    }


def show(result: Any, summary: dict[str, Any]) -> None:
    """The summary for people."""
    from ..study._sweep_progress import status_text

    print(f"{summary['designs']} designs by {summary['why']}.")
    print(f"status: {status_text(summary['status'])}")
    if result.spec.path == "bulk":
        print("Lift-off and slip are not checked: add the metrics lift_off_margin,slip_margin.")
    for name, found in summary["best"].items():
        at = ", ".join(
            f"{path} = {found[path]:.6g}{'' if unit == '1' else f' {unit}'}"
            for path, unit, _ in result.spec.vary
        )
        doubt = "" if found["status"] == "ok" else f", {found['status']}"
        print(f"best {name}: {found[name]:.6g} {found['unit']} at {at} ", end="")
        print(f"(design {found['design']}{doubt})")
    for entry in summary["failed"]:
        print(f"design {entry['design']} failed; again: {entry['rerun']}")
    more = sum(summary["status"].get(k, 0) for k in ("non-finite", "step limit", "failed"))
    if more > SHOWN:
        print(f"... and {more - SHOWN} more failed designs.")
    if summary.get("plot"):
        print(f"plot: {summary['plot']}")
    if summary.get("report"):
        print(f"report: {summary['report']}")
    if summary["out"]:
        print(f"store: {summary['out']}")


def _plot(result: Any, file: Path) -> Path:
    from .._errors import InputError

    metric = result.spec.metrics[0]
    flat = len(result.shape) < 2
    ax = result.plot_lines(metric) if flat else result.plot_heatmap(metric)
    try:
        ax.figure.savefig(file, dpi=150)
    except (OSError, ValueError) as error:
        raise InputError(f"the plot cannot be written: {error}.", file) from None
    return file
