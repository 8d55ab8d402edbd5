"""From what the user asks to a specification: checks, path of evaluation, size of a batch."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..._errors import InputError
from ...dynamics import Model
from ...rig import Rig, law_texts, rig_text, typed_above_zero, whole_number
from ...simulation import RATE, build_model
from .._axes import SweepAxis, split_vary
from .._evaluation import (
    Drive,
    Evaluation,
    Question,
    apply,
    batch_size,
    checked_metrics,
    drive_of,
    drive_to_plain,
    evaluation_of,
)
from .._points import build_points
from .._target import read_axes
from .evaluator import BATCHES_A_CHUNK, Evaluator
from .spec import SweepSpec

MOST = 1e9  # designs; a millisecond each would take eleven days


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
    """The specification of a sweep, and why its method of evaluation was chosen."""
    names = checked_metrics(metrics)
    axes = read_axes(rig, drive, split_vary(vary))
    points = build_points(axes, sampling.sampler, sampling.samples, sampling.seed)
    if points.size > MOST:
        raise InputError(f"a sweep has {MOST:g} designs at most, but this one {points.size:g}.")
    paths = tuple(axis.path for axis in axes)
    _build(rig, numerics.model)

    def spec(how: Evaluation) -> SweepSpec:
        if how.method == "full":
            first = apply(rig, drive, paths, points.at(np.array([0]))[0])[0]
            how = how._replace(solver=_solver(first, numerics))
        return _spec(rig, drive, axes, sampling, numerics, how)

    def trial(how: Evaluation, designs: np.ndarray) -> np.ndarray:
        return Evaluator(spec(how), sampling.devices).figures(designs)

    asked = Question(
        rig, (drive,), paths, names, numerics.model, numerics.duration, True, sampling.gradient,
    )  # fmt: skip
    how, why = evaluation_of(
        asked,
        numerics.rate,
        solver=numerics.solver,
        rtol=numerics.rtol,
        max_steps=numerics.max_steps,
        trial=trial,
        ranges=axes,
    )
    return spec(how), why


def _build(rig: Rig, model: str) -> Model:
    try:
        return build_model(rig, model)
    except InputError:
        raise
    except ValueError as error:
        raise InputError(str(error)) from None


def _solver(rig: Rig, numerics: Numerics) -> str:
    """The name of the solver that `auto` means for this rig."""
    from ...simulation import choose_solver

    try:
        return choose_solver(_build(rig, numerics.model), numerics.solver)
    except InputError:
        raise
    except ValueError as error:
        raise InputError(str(error)) from None


def _spec(
    rig: Rig, drive: Drive, axes: list[SweepAxis], sampling: Sampling, numerics: Numerics,
    how: Evaluation,
) -> SweepSpec:  # fmt: skip
    chunk, columns = sampling.chunk, len(axes) if sampling.gradient else 0
    batch = batch_size(how.method, how.samples or 1, columns, sampling.devices)
    batch = min(batch, chunk) if chunk else batch
    full, fixed = how.method == "full", how.method == "fixed"
    return SweepSpec(
        rig=rig_text(rig),
        laws=tuple(law_texts(rig).items()),
        vary=tuple((axis.path, axis.unit, axis.text) for axis in axes),
        metrics=how.metrics,
        drive=drive_to_plain(drive),
        method=how.method,
        model=how.model,
        solver=how.solver if how.integrated else "",
        duration=numerics.duration,
        rate=None if numerics.duration is None else numerics.rate or RATE,
        rtol=how.rtol if full else None,
        max_steps=how.max_steps if full else None,
        substeps=how.substeps if fixed else None,
        gradient=sampling.gradient,
        sampler=sampling.sampler,
        samples=sampling.samples,
        seed=sampling.seed,
        batch=batch,
        chunk=chunk or BATCHES_A_CHUNK * batch,
    )


def read_drive(rig: Rig, speeds: Any, drive: Any) -> Drive:
    """The one drive of speeds and drive; `InputError` where it is none or does not fit the rig."""
    if (speeds is None) == (drive is None):
        raise InputError("a sweep needs either wheel speeds or another drive, and not both.")
    return drive_of(speeds if drive is None else drive, rig)


def read_numbers(sampling: Sampling, numerics: Numerics) -> tuple[Sampling, Numerics]:
    """Both with plain numbers, from NumPy's or text; `InputError` with all that are none.

    `duration` and `rate` are read before.
    """
    problems: list[str] = []

    def read(given: Any, kind: Callable[..., Any], name: str, *more: Any) -> Any:
        try:
            return None if given is None else kind(name, given, *more)
        except InputError as error:
            problems.extend(error.problems)

    counts = {"samples": sampling.samples, "chunk": sampling.chunk, "devices": sampling.devices}
    whole = {name: read(given, whole_number, name) for name, given in counts.items()}
    seed = read(sampling.seed, whole_number, "seed", 0)
    rtol = read(numerics.rtol, typed_above_zero, "rtol", "1")
    max_steps = read(numerics.max_steps, whole_number, "max_steps")
    if problems:
        raise InputError(problems)
    numbers = numerics._replace(rtol=rtol, max_steps=max_steps)
    return sampling._replace(**whole, seed=seed), numbers
