"""`omnijax sweep`: metrics of many designs."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Parameter

from .._errors import InputError
from .._files import claim, writing
from .._interrupts import resumable
from ._inputs import (
    PICTURES,
    Json,
    MaybeWhole,
    MotionOptions,
    NumericsOptions,
    Overwrite,
    Whole,
    check_ending,
    command_line,
    emit,
    file_kind,
    refuse,
    sweep_axis,
)
from ._studies import AskedStudy, Switch, asked_of
from ._sweep_summary import show, summarise


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class SamplingOptions:
    """Which designs."""

    sampler: Literal["grid", "lhs", "sobol"] = "grid"
    """Grid, Latin hypercube (lhs) or Sobol points."""
    samples: MaybeWhole = None
    """Number of designs of lhs and sobol."""
    seed: Whole = 0
    """Seed of lhs and sobol."""
    gradient: Switch = False
    """Also store the derivative of each metric to each varied parameter."""


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class PlaceOptions:
    """Where the designs are computed and kept."""

    out: Path | None = None
    """Folder of the zarr store; without it nothing is kept."""
    resume: Switch = False
    """Continue the store in --out; with none there it begins from the start."""
    chunk: MaybeWhole = None
    """Designs stored together: what a kill can lose."""
    devices: Whole = 1
    """Local devices to spread each batch over."""
    workers: MaybeWhole = None
    """Processes of a local Dask cluster."""
    scheduler: str | None = None
    """Address of a running Dask scheduler (tcp://host:8786)."""


def sweep(
    rig: str,
    /,
    *,
    vary: Annotated[list[str], Parameter(negative="", show_default=False)] = [],  # noqa: B006
    metric: str | None = None,
    motion: MotionOptions = MotionOptions(),
    drive: Path | None = None,
    sampling: SamplingOptions = SamplingOptions(),
    numerics: NumericsOptions = NumericsOptions(),
    place: PlaceOptions = PlaceOptions(),
    plot: Path | None = None,
    report: Path | None = None,
    overwrite: Overwrite = False,
    json: Json = False,
) -> int:
    """Compute metrics of many designs: a grid, a list, or samples of ranges.

    Example: omnijax sweep atlas --vary wheel.roundness=0.1:0.6:50 --vary
    contact.stiffness=log:5e4:1e6:40 --metric peak,rms --speed 0.1,1.2,0.3 --out sweep.zarr

    Example: omnijax sweep study.toml --plot sweep.png

    Without --duration the figures are those of the steady state. A killed or interrupted sweep
    goes on with the same command and --resume; omnijax sweep-status shows it from elsewhere.

    Parameters
    ----------
    rig
        A rig file, the name of a bundled rig, or a study file (its drive, metrics and [[variable]]
        with levels); or a machine file of an axis.
    drive
        A table of wheel speeds or a recording, as for simulate. Of a machine file: the log under
        whose inputs it moves; metrics are then rms, mae and peak of measured less simulated
        position, and --out is a .nc file.
    vary
        PATH=low:high:count, PATH=log:low:high:count, PATH=a,b,c, or PATH=low:high for samples;
        once for each parameter. PATH is a rig parameter, speed.WHEEL, speed.scale or force.x.
    metric
        Metrics, with commas between; peak,rms where not given, of a machine rms.
    plot
        Picture of the first metric: a heat map, or lines (.svg, .png, .pdf).
    report
        Folder for a page of the sweep (index.html) with its figures and numbers.
    """
    check_ending(plot, *PICTURES)
    kind = file_kind(rig)
    if not vary and kind != "study":
        raise InputError("give what varies: --vary PATH=low:high:count, once for each parameter.")
    if kind == "machine":
        kept = {k: getattr(place, k) for k in ("resume", "chunk", "workers", "scheduler")}
        kept |= {"plot": plot, "report": report, "gradient": sampling.gradient}
        kept |= {"model": numerics.model != "coupled", "solver": numerics.solver != "auto"}
        kept |= {"rtol": numerics.rtol, "max-steps": numerics.max_steps}
        kept |= {"devices": place.devices != 1}
        refuse(kept | vars(motion), "sweep")
        return sweep_axis(rig, drive, vary, metric or "rms", sampling, place.out, overwrite, json)
    asked = asked_of(kind, rig, motion, drive, ("vary", vary), metric, numerics.model)
    if asked.rtol is not None and numerics.rtol is not None:
        raise InputError("--rtol stands in the study file: give it there.", rig)
    claim([plot], [report], force=overwrite)
    result, seconds = _run(rig if kind == "rig" else asked.rig, asked, sampling, numerics, place)
    with resumable(result.store.kept):
        summary = summarise(result) | {"seconds": seconds}
        if plot is not None:
            summary["plot"] = str(_plot(result, plot))
        if report is not None:
            from ..report import sweep_page

            summary["report"] = str(sweep_page(result).write(report))
    emit(json, summary, lambda: show(result, summary))
    return 0


def _run(
    rig: Any,
    asked: AskedStudy,
    sampling: SamplingOptions,
    numerics: NumericsOptions,
    place: PlaceOptions,
) -> tuple[Any, float]:
    """The sweep, and how long it took in s."""
    import dataclasses
    import time

    from ..study import Bar
    from ..study import sweep as evaluate

    began, own = time.monotonic(), {"model": asked.model, "rtol": asked.rtol or numerics.rtol}
    numerics = dataclasses.replace(numerics.checked(), **own)
    metrics = "peak,rms" if asked.metrics is None else asked.metrics
    with Bar() as advance:
        result = evaluate(
            rig, asked.vary, metrics, **asked.motion._asdict(),
            **vars(numerics), **vars(sampling), **vars(place),
            report=advance, command=command_line(),
        )  # fmt: skip
    return result, time.monotonic() - began


def _plot(result: Any, file: Path) -> Path:
    from ..report import style, sweep_figure

    fig = sweep_figure(result, result.spec.metrics[0])
    with writing(file) as part, style():
        fig.savefig(part, dpi=150)
    return file
