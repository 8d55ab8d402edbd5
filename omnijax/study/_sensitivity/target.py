"""Metrics as a function of a flat vector of parameter values."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import diffrax as dfx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..._errors import InputError
from ...rig import Rig, get_parameter, parameter_info, parameter_paths, set_parameter
from ...simulation import (
    SpeedDrive,
    Trajectory,
    exact_obstacle,
    propagate,
    simulate,
    simulate_fixed,
)
from ...vibration import STEADY_METRICS, SteadyRun, evaluate, metric_problem
from .._drive import is_constant

RATE = 500.0  # samples per s of a run


class Evaluation(NamedTuple):
    """How the metrics of one rig under one drive are computed."""

    drive: Any
    metrics: tuple[str, ...]
    way: str  # steady, propagation, fixed or full
    times: Any = None  # s, of the samples
    model: str = "coupled"
    rtol: float = 1e-8
    substeps: int = 1  # of fixed steps

    def __call__(self, rig: Rig) -> Float[Array, " m"]:
        """The metrics; NaN for a run that failed."""
        return self.of(self.run(rig), rig)

    def run(self, rig: Rig) -> SteadyRun | Trajectory:
        """What the metrics are read from: the periodic solution, or a run."""
        if self.way == "steady":
            given = self.drive.initial_angle
            angles = jnp.zeros(rig.size) if given is None else given
            return SteadyRun(rig, self.drive.speed.values[0], angles, self.model)
        ts = jnp.asarray(self.times)
        if self.way == "propagation":
            return propagate(rig, self.drive, ts, model=self.model)
        if self.way == "fixed":
            return simulate_fixed(rig, self.drive, ts, self.model, self.substeps)
        return simulate(
            rig, self.drive, ts, model=self.model, rtol=self.rtol, adjoint=dfx.ForwardMode()
        )

    def of(self, run: SteadyRun | Trajectory, rig: Rig) -> Float[Array, " m"]:
        """The metrics of `run`; NaN where it failed."""
        if isinstance(run, SteadyRun):
            return jnp.stack([run.metric(name) for name in self.metrics])
        found = evaluate(run, rig, self.metrics)
        values = jnp.stack([found[name] for name in self.metrics])
        return jnp.where(run.status == 0, values, jnp.nan)

    @property
    def precision(self) -> float:
        """Relative precision of the figures: rounding of the closed forms, or the solver's."""
        return 10 * self.rtol if self.way == "full" else 1e-12


def evaluation(
    rig: Rig, drive: Any, metrics: Sequence[str], duration: float | None, model: str,
    rate: float | None = None, rtol: float = 1e-8,
) -> Evaluation:  # fmt: skip
    """The cheapest exact way that the rig, the drive and the metrics allow."""
    metrics = checked_metrics(metrics)
    prescribed = isinstance(drive, SpeedDrive)
    reason = exact_obstacle(rig, model) if prescribed else "motor torques drive the wheels"
    if prescribed and reason is None and not is_constant(drive.speed):
        reason = "the drive changes in time"
    if duration is not None:
        if not duration > 0:
            raise InputError(f"`duration` must be above 0, but is {duration:g}.")
        count = max(2, round(duration * (rate or RATE)) + 1)
        times = np.linspace(0.0, duration, count)
        return Evaluation(drive, metrics, "full" if reason else "propagation", times, model, rtol)
    missing = [name for name in metrics if name not in STEADY_METRICS]
    if reason is None and missing:
        reason = f"the steady state does not give {', '.join(missing)}"
    if reason:
        raise InputError(f"this study needs a `duration`: {reason}, so there is no steady state.")
    return Evaluation(drive, metrics, "steady", None, model)


def checked_metrics(metrics: Sequence[str] | str) -> tuple[str, ...]:
    """`metrics` as a tuple; `InputError` with the nearest names for unknown ones."""
    listed = metrics.split(",") if isinstance(metrics, str) else metrics
    names = tuple(name.strip() for name in listed)
    problems = [problem for name in names if (problem := metric_problem(name))]
    problems += [] if names else ["a study needs at least one metric."]
    if problems:
        raise InputError(problems)
    return tuple(dict.fromkeys(names))


def scalar_parameters(rig: Rig) -> tuple[str, ...]:
    """Paths of every parameter that is one number of one body, one wheel or one effect."""
    return tuple(
        info.path for info in parameter_paths(rig) if info.shape == () and not _of_all(info.path)
    )


def _of_all(path: str) -> bool:
    return path.split(".", maxsplit=1)[0] in {"contact", "mount", "closure"}


def speaks_of_all(rig: Rig, path: str) -> bool:
    """Whether `path` names a parameter of all wheels at once."""
    head, second, *_ = path.split(".")
    return _of_all(path) or (head == "wheel" and second not in rig.names)


def checked_parameters(rig: Rig, paths: Sequence[str]) -> tuple[str, ...]:
    """Paths of single numbers; a path that speaks of all wheels becomes one path a wheel."""
    found: list[str] = []
    for path in paths:
        info = parameter_info(rig, path)
        if info.shape == ():
            found.append(path)
        elif speaks_of_all(rig, path) and info.shape == (rig.size,):
            key = path.removeprefix("wheel.")
            found += [f"wheel.{name}.{key}" for name in rig.names]
        else:
            raise InputError(f"`{path}` is no single number (shape {info.shape}).")
    return tuple(dict.fromkeys(found))


def with_values(rig: Rig, paths: Sequence[str], values) -> Rig:
    """`rig` with `values` (p,), traced or not, at `paths`."""
    for i, path in enumerate(paths):
        rig = set_parameter(rig, path, values[i])
    return rig


def values_of(rig: Rig, paths: Sequence[str]) -> np.ndarray:
    """Values at `paths`, SI."""
    return np.array([float(get_parameter(rig, path)) for path in paths])


def target(
    rig: Rig, paths: tuple[str, ...], figures: Callable[[Rig], Array]
) -> Callable[[Float[Array, " p"]], Float[Array, " m"]]:
    """The pure function parameter values -> metrics."""
    return lambda values: figures(with_values(rig, paths, values))


def group_of(path: str) -> str:
    """The path without the wheel's name: `wheel.w1.contact.stiffness` -> `contact.stiffness`."""
    head, _, rest = path.partition(".")
    if head != "wheel":
        return path
    key = rest.partition(".")[2]
    return key if "." in key else f"wheel.{key}"
