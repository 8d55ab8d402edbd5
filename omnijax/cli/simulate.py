"""`omnijax simulate`: one run of a rig."""

from pathlib import Path
from typing import Any, Literal

from ._options import Json, emit, number, numbers

PICTURES = (".png", ".svg", ".pdf")
LONGEST = 5_000_000  # samples; more is a misread unit


def simulate(
    rig: str,
    /,
    *,
    speed: str | None = None,
    torque: str | None = None,
    drive: Path | None = None,
    force: str | None = None,
    duration: str | None = None,
    rate: str | None = None,
    out: Path | None = None,
    plot: Path | None = None,
    model: Literal["coupled", "paper"] = "coupled",
    solver: Literal["auto", "exact", "exponential", "dopri8", "tsit5", "kvaerno5"] = "auto",
    rtol: float = 1e-8,
    max_steps: int = 200_000,
    resume: bool = False,
    json: Json = False,
) -> int:
    """Simulate one run: prescribed wheel speeds, motor torques, or the inputs of a recording.

    Example: omnijax simulate atlas --speed 0.1,1.2,0.3 --duration 8s --out run.nc

    Example: omnijax simulate rig.toml --drive run-1.csv.gz --out run.csv.gz --plot run.png

    Parameters
    ----------
    rig
        A rig file, or the name of a bundled rig.
    speed
        Wheel speeds in rad/s, one a wheel; or with units (30 rpm,0,10 rpm).
    torque
        Motor torques in N m, one a wheel, instead of speeds.
    drive
        A recording: its torques, force and first wheel angles; the run is sampled at its times.
    force
        Force on the platform in N: x,y,z.
    duration
        Length of the run (2, 2s, 500ms).
    rate
        Samples per s (500, 500Hz, 1kHz).
    out
        File of the run: .nc (every channel), or .csv, .csv.gz, .parquet (a recording).
    plot
        Picture of the run (.png, .svg, .pdf).
    model
        Translation model.
    solver
        `auto` takes the exact propagation where speeds are constant and the rig linear, else a
        solver that fits the rig's stiffness.
    rtol
        Relative tolerance of the solvers.
    max_steps
        Most steps before the run stops with the status `step limit`.
    resume
        Go on with the interrupted run in --out (.nc); the other options must be the same.
    """
    import os
    import sys

    # a failed check inside the compiled solve then gives NaN, hence a status, and needs no call
    # back to Python: without one, JAX keeps the program for the next process
    os.environ.setdefault("EQX_ON_ERROR", "nan")
    from ..rig import load_rig
    from ..simulate import save_trajectory
    from ._simulate_run import interrupted_run, perform

    _check_files(out, plot)
    machine = load_rig(rig)
    imposed, times, faults = _drive(machine, speed, torque, drive, force, duration, rate)
    for fault in faults:
        print(f"warning: {fault}", file=sys.stderr)
    before = interrupted_run(out, machine, model, _command()) if resume else None
    numerics = {"model": model, "solver": solver, "rtol": rtol, "max_steps": max_steps}
    run, end = perform(machine, imposed, times, before, **numerics)
    summary = _summary(run, machine) | {"rig": rig, "faults": [str(fault) for fault in faults]}
    if out is not None:
        beside = _rig_file(rig, machine, out)
        summary["out"] = str(save_trajectory(run, out, machine, beside, _command(), end))
    if plot is not None:
        summary["plot"] = str(_plot(run, rig, plot))
    emit(json, summary, lambda: _print(summary))
    return _code(run, out)


def _command() -> str:
    """This command; resumed, it is still the same."""
    import shlex
    import sys

    return shlex.join(["omnijax", *(a for a in sys.argv[1:] if a != "--resume")])


def _code(run: Any, out: Path | None) -> int:
    """The exit code, and on stderr what to do about a run that did not reach its end."""
    import sys

    from ..simulate._trajectory import STATUS
    from ._frame import FAILED, INTERRUPTED, OK

    if run.ok:
        return OK
    print(run.message(), file=sys.stderr)
    if STATUS[int(run.status)] != "interrupted":
        return FAILED
    if out is not None and out.name.endswith(".nc"):
        print(f"Go on with: {_command()} --resume", file=sys.stderr)
    return INTERRUPTED


def _check_files(out: Path | None, plot: Path | None) -> None:
    from .._errors import InputError

    if out is not None:
        from ..simulate._files import check_suffix

        check_suffix(out)
    if plot is not None and plot.suffix.lower() not in PICTURES:
        raise InputError(f"`{plot.name}` must end in one of {', '.join(PICTURES)}.")


def _drive(rig: Any, speed, torque, recording, force, duration, rate) -> tuple[Any, Any, list]:
    """The drive, the sample times in s, and what is wrong with the recording."""
    from .._errors import InputError
    from ..recording import read_recording
    from ..simulate import drive_from_recording, speeds, torques

    given = [x for x in (speed, torque, recording) if x is not None]
    if len(given) != 1:
        raise InputError("give one of --speed, --torque and --drive.")
    if recording is not None:
        if force is not None or duration is not None or rate is not None:
            raise InputError("--drive brings its own force and times: leave out the other options.")
        run = read_recording(recording, rig)
        return drive_from_recording(run), run.time, run.faults
    push = numbers("force", force or "0,0,0", "N", 3, "components")
    times = _times(duration, rate)
    if speed is not None:
        return speeds(numbers("speed", speed, "rad/s", rig.size), push), times, []
    return torques(numbers("torque", torque, "N m", rig.size), push), times, []


def _times(duration: str | None, rate: str | None) -> Any:
    import numpy as np

    from .._errors import InputError

    length = number("duration", duration or "8", "s")
    frequency = number("rate", rate or "500", "Hz")
    for name, value, unit in (("duration", length, "s"), ("rate", frequency, "Hz")):
        if value <= 0:
            raise InputError(f"`{name}` must lie in (0, inf) {unit}, but is {value:g}.")
    count = round(length * frequency)
    if not 1 <= count <= LONGEST:
        raise InputError(
            f"`duration` times `rate` must give 1 to {LONGEST} samples, but gives {count}."
        )
    return np.arange(count + 1) / frequency


def _rig_file(name: str, rig: Any, out: Path) -> Path | None:
    """The rig file that NAME.toml of a recording names; of a bundled rig, a copy beside the run."""
    from ..rig import bundled_rigs, rig_path, save_rig

    if out.name.endswith(".nc") or rig_path(name) != bundled_rigs().get(name):
        return rig_path(name)
    out.parent.mkdir(parents=True, exist_ok=True)
    return save_rig(rig, out.with_name(f"{out.name.split('.')[0]}-rig.toml"))


def _summary(run: Any, rig: Any) -> dict[str, Any]:
    """How the run ended, and its main figures as far as it got."""
    import numpy as np

    from ..simulate._trajectory import STATUS

    good = np.isfinite(np.asarray(run.dR)).all(axis=1)
    dR, elastic, a = (np.asarray(x)[good] for x in (run.dR, run.dR_elastic, run.a))
    figures = {"peak": dR, "elastic_peak": elastic}
    length = {name: np.linalg.norm(x, axis=1) for name, x in figures.items()}
    peak = {name: float(x.max()) if len(x) else None for name, x in length.items()}
    rms = {
        name: float(np.sqrt(np.mean(np.sum(x**2, axis=1)))) if len(x) else None
        for name, x in (("rms", dR), ("elastic_rms", elastic), ("acceleration_rms", a))
    }
    normal, margin = (np.asarray(x)[good] for x in (run.normal_force, run.slip_margin))
    return {
        "status": STATUS[int(run.status)],
        "message": run.message(),
        "time_reached": run.time_reached if len(dR) else None,
        "samples": int(good.sum()),
        "steps": int(run.steps),
        "method": run.method,
        **peak,
        **rms,
        "smallest_normal_force": float(normal.min()) if len(dR) else None,
        "smallest_slip_margin": float(margin.min()) if len(dR) else None,
        "effects": [{"id": placed.law.id, "place": placed.place} for placed in rig.effects],
    }


def _plot(run: Any, name: str, path: Path) -> Path:
    from ..report import figure, style
    from ..simulate._plots import plot_run

    path.parent.mkdir(parents=True, exist_ok=True)
    with style():
        picture, axes = figure(4)
        plot_run(run, axes)
        axes[0].set_title(Path(name).stem if run.ok else f"{Path(name).stem}: {run.message()}")
        picture.savefig(path, dpi=150)
    return path


def _print(summary: dict[str, Any]) -> None:
    print(summary["message"])
    if summary["samples"]:
        print(f"|ΔR|            peak {_micro(summary['peak'])}, RMS {_micro(summary['rms'])}")
        peak, rms = _micro(summary["elastic_peak"]), _micro(summary["elastic_rms"])
        print(f"elastic part    peak {peak}, RMS {rms}")
        print(f"acceleration    RMS {summary['acceleration_rms']:.4g} m/s²")
        normal, margin = summary["smallest_normal_force"], summary["smallest_slip_margin"]
        print(f"normal force    at least {normal:.4g} N{' (lift-off)' * (normal < 0)}")
        print(f"slip margin     at least {margin:.4g} N{' (slip)' * (margin < 0)}")
    for key in ("out", "plot"):
        if key in summary:
            print(f"{key:15s} {summary[key]}")


def _micro(value: float) -> str:
    return f"{1e6 * value:.4g} µm"
