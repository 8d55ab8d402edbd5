"""From what the user asks to a specification: checks, path of evaluation, size of a batch."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..._errors import InputError
from ...rig import Rig, rig_text
from ...simulation import AbstractDrive, SpeedDrive, TorqueDrive, build_model, choose_solver
from .._axes import Axis, split_vary
from .._drive import Drive, drive_to_plain, is_constant, read_speeds
from .._points import PointSet, build_points
from .._target import apply, read_axes
from .evaluator import BATCHES_A_CHUNK, batch_size
from .fixed import no_fixed_steps, with_substeps
from .paths import MAX_STEPS, RTOL, check_metrics, choose_path
from .spec import SweepSpec

RATE = 500.0  # samples per s


class Sampling(NamedTuple):
    """Which designs, and how many at a time."""

    sampler: str
    samples: int | None
    seed: int
    gradient: bool
    chunk: int | None
    devices: int


class Numerics(NamedTuple):
    """How a design is evaluated; None: the default."""

    model: str
    solver: str
    duration: float | None
    rate: float | None
    rtol: float | None
    max_steps: int | None


def plan(
    rig: Rig,
    vary: Mapping[str, Any] | Sequence[str] | str,
    metrics: Sequence[str] | str,
    drive: Drive,
    sampling: Sampling,
    numerics: Numerics,
) -> tuple[SweepSpec, str]:
    """The specification of a sweep, and why its path of evaluation was chosen."""
    names = metrics.split(",") if isinstance(metrics, str) else metrics
    metrics = tuple(name.strip() for name in names)
    check_metrics(metrics)
    _check(sampling, numerics)
    axes = read_axes(rig, drive, split_vary(vary))
    points = build_points(axes, sampling.sampler, sampling.samples, sampling.seed)
    how, why = _how(rig, drive, axes, points, metrics, numerics)
    adaptive = _spec(rig, drive, axes, metrics, sampling, how)
    if how["path"] != "full":
        return adaptive, why
    chosen = numerics[-2:] != (None, None) or numerics.solver != "auto"
    against = no_fixed_steps(rig, drive, chosen, sampling.gradient)
    if against is None:
        less = {"path": "fixed", "solver": "", "rtol": None, "max_steps": None}
        spec = _spec(rig, drive, axes, metrics, sampling, how | less)
        found = with_substeps(spec, sampling.devices)
        if found is not None:
            return found
        against = "fixed steps are too coarse for a trial design"
    return adaptive, f"{why}; {against}"


def _spec(rig: Rig, drive: Drive, axes: list[Axis], metrics, sampling: Sampling, how) -> SweepSpec:
    chunk, columns = sampling.chunk, len(axes) if sampling.gradient else 0
    count = round((how["duration"] or 0) * (how["rate"] or 0)) + 1
    batch = batch_size(how["path"], count, columns, sampling.devices)
    batch = min(batch, chunk) if chunk else batch
    return SweepSpec(
        rig=rig_text(rig),
        vary=tuple((axis.path, axis.unit, axis.text) for axis in axes),
        metrics=metrics,
        drive=drive_to_plain(drive),
        gradient=sampling.gradient,
        sampler=sampling.sampler,
        samples=sampling.samples,
        seed=sampling.seed,
        batch=batch,
        chunk=chunk or BATCHES_A_CHUNK * batch,
        **how,
    )


def read_drive(rig: Rig, speeds: Any, drive: AbstractDrive | None) -> Drive:
    """The one drive of speeds and drive; `InputError` where it is none or does not fit the rig."""
    if (speeds is None) == (drive is None):
        raise InputError("a sweep needs either wheel speeds or another drive, and not both.")
    if drive is None:
        return read_speeds(speeds, rig.names)
    assert isinstance(drive, SpeedDrive | TorqueDrive)
    signal = drive.speed if isinstance(drive, SpeedDrive) else drive.torque
    if signal.size != rig.size:
        raise InputError(f"the drive has {signal.size} wheels, but the rig has {rig.size}.")
    return drive


def _check(sampling: Sampling, numerics: Numerics) -> None:
    numbers = {"chunk": sampling.chunk, "devices": sampling.devices}
    numbers |= {k: getattr(numerics, k) for k in ("duration", "rate", "rtol", "max_steps")}
    problems = [
        f"`{name}` must be above 0, but is {value:g}."
        for name, value in numbers.items()
        if value is not None and not value > 0
    ]
    if sampling.seed < 0:
        problems.append(f"`seed` must not be below 0, but is {sampling.seed}.")
    if problems:
        raise InputError(problems)


def _how(
    rig: Rig,
    drive: Drive,
    axes: list[Axis],
    points: PointSet,
    metrics,
    numerics: Numerics,
) -> tuple[dict[str, Any], str]:
    """Path of evaluation with its numerics, and why that path."""
    model, duration = numerics.model, numerics.duration
    signal = drive.speed if isinstance(drive, SpeedDrive) else drive.torque
    constant = is_constant(signal) and is_constant(drive.force)
    paths = tuple(axis.path for axis in axes)
    try:
        built = build_model(rig, model)
        path, why = choose_path(rig, drive, constant, duration, model, metrics)
        full = path == "full"
        if full:
            built = build_model(apply(rig, drive, paths, points.at(np.array([0]))[0])[0], model)
        solver = choose_solver(built, numerics.solver) if full else ""
    except InputError:
        raise
    except ValueError as error:
        raise InputError(str(error)) from None
    rate = None if duration is None else numerics.rate or RATE
    if duration is not None and rate is not None and round(duration * rate) < 2:
        raise InputError(f"`duration` {duration:g} s at `rate` {rate:g}/s gives under 2 samples.")
    how = {"path": path, "model": model, "solver": solver, "duration": duration, "rate": rate}
    limits = {
        "rtol": (numerics.rtol or RTOL) if full else None,
        "max_steps": (numerics.max_steps or MAX_STEPS) if full else None,
    }
    return how | limits, why
