"""One design in, its figures and how it ended out, by a method chosen beforehand."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from ..._errors import InputError, not_above_zero
from ..._status import FAILED, Status
from ..._text import split_names
from ...rig import Rig, typed_above_zero
from ...simulation import (
    EXPONENTIAL,
    MAX_STEPS,
    RATE,
    RTOL,
    SpeedDrive,
    TorqueDrive,
    Trajectory,
    propagated,
    sample_times,
    simulate_fixed,
    simulated,
    without_sensors,
)
from ...vibration import SteadyRun, evaluate, metric_problem, steady_metric
from .._batches import Order
from .drives import Drive


class Figures(NamedTuple):
    """Metrics of one design, NaN where it or one of them failed, and its `Status`."""

    values: Float[Array, " m"]
    status: Int[Array, ""]


class Evaluation(NamedTuple):
    """How the metrics of one rig under one drive are computed."""

    method: str  # of `METHODS`
    metrics: tuple[str, ...]
    model: str = "coupled"
    times: Any = None  # s, of the samples; none for the steady state
    solver: str = "auto"  # of full simulations, as are the tolerance and the limit of steps; or
    # of fixed steps, one of `fixed_methods`: exponential where it is auto
    rtol: float = RTOL
    max_steps: int = MAX_STEPS
    forward: bool = True  # whether a full simulation is differentiated, forwards
    substeps: Any = 1  # of fixed steps
    gathered: bool = False  # whether runs in bulk are not read from samples: see `gathers`

    def __call__(self, rig: Rig, drive: Drive) -> Figures:
        """Figures and status of one design."""
        run = self.run(rig, drive)
        return Figures(*without_failed(self._read(run, rig), self._ended(run)))

    def values(self, rig: Rig, drive: Drive) -> Float[Array, " m"]:
        """The metrics of one design, NaN where it failed."""
        return self.of(self.run(rig, drive), rig)

    def of(self, run: SteadyRun | Trajectory, rig: Rig) -> Float[Array, " m"]:
        """The metrics of `run`, NaN where it failed."""
        return without_failed(self._read(run, rig), run.status)[0]

    def run(self, rig: Rig, drive: Drive) -> SteadyRun | Trajectory:
        """What the metrics are read from: the periodic solution, or a run.

        Raises `ValueError` for a method that evaluates no single design.
        """
        runs = {
            "steady": self._steady, "propagation": self._propagated, "fixed": self._by_fixed_steps,
            "full": self._in_full,
        }  # fmt: skip
        if self.method not in runs:
            raise ValueError(f"`{self.method}` evaluates no single design, but {', '.join(runs)}.")
        return runs[self.method](rig, drive)

    def _steady(self, rig: Rig, drive: SpeedDrive) -> SteadyRun:
        given = drive.initial_angle
        angles = jnp.zeros(rig.size) if given is None else given
        speeds, force = drive.speed.values[0], drive.force.values[0]
        return SteadyRun(rig, speeds, angles, self.model, force=force)

    def _propagated(self, rig: Rig, drive: SpeedDrive) -> Trajectory:
        return propagated(rig, drive, jnp.asarray(self.times), model=self.model)

    def _by_fixed_steps(self, rig: Rig, drive: TorqueDrive) -> Trajectory:
        ts, how = jnp.asarray(self.times), EXPONENTIAL if self.solver == "auto" else self.solver
        return simulate_fixed(rig, drive, ts, self.model, self.substeps, how)

    def _in_full(self, rig: Rig, drive: Drive) -> Trajectory:
        from diffrax import ForwardMode  # slow to import: only where time is stepped

        adjoint = ForwardMode() if self.forward else None
        moving, ts = without_sensors(rig), jnp.asarray(self.times)  # no metric reads a sensor
        return simulated(
            moving, drive, ts, model=self.model, solver=self.solver,
            rtol=self.rtol, max_steps=self.max_steps, adjoint=adjoint,
        )  # fmt: skip

    def _read(self, run: SteadyRun | Trajectory, rig: Rig) -> Float[Array, " m"]:
        if isinstance(run, SteadyRun):
            return jnp.stack([steady_metric(run, name) for name in self.metrics])
        by_name = evaluate(run, rig, self.metrics)
        return jnp.stack([by_name[name] for name in self.metrics])

    def _ended(self, run: SteadyRun | Trajectory) -> Int[Array, ""]:
        """The run's own status, else whether a contact lifts off or slips."""
        if isinstance(run, SteadyRun):
            load = run.load()
            margin = margin_status(jnp.min(load.least), jnp.min(load.slip_margin))
        else:
            margin = margin_status(jnp.min(run.normal_force), jnp.min(run.slip_margin))
        return jnp.where(run.status == Status.OK, margin, run.status)

    @property
    def samples(self) -> int | None:
        """How many samples a run has; None of the steady state."""
        return None if self.times is None else len(self.times)

    @property
    def integrated(self) -> bool:
        """Whether every figure is an integrated run."""
        return self.method in ("fixed", "full")

    @property
    def order(self) -> Order:
        """How many designs are evaluated: see `each`."""
        if self.method == "fixed":
            return "batch last"
        return "side by side" if self.integrated else "in turn"

    @property
    def precision(self) -> float:
        """Relative precision of the figures: rounding of the closed forms, or the solver's."""
        return 10 * self.rtol if self.method == "full" else 1e-12


def without_failed(values: Float[Array, " m"], status):
    """Figures of a failed run are NaN; one that is not finite is said, and the others stay."""
    bad = ~jnp.isfinite(values)
    failed = jnp.any(status == jnp.asarray(FAILED))
    status = jnp.where(jnp.any(bad) & ~failed, Status.NON_FINITE, status)
    return jnp.where(failed | bad, jnp.nan, values), status


def margin_status(normal_force, slip_margin):
    """Lift-off where a contact is without load, else slip, from the least of both (N).

    NumPy's arrays stay such: jax would compile for every number of designs.
    """
    xp = np if isinstance(normal_force, np.ndarray) else jnp
    slips = xp.where(slip_margin < 0, Status.SLIP, Status.OK)
    return xp.where(normal_force <= 0, Status.LIFT_OFF, slips)


def without_run(duration: float | None, **settings: Any) -> list[str]:
    """A sentence for each of `settings` (None: not given) of a run where no run is asked for."""
    given = [name for name, value in settings.items() if value is not None and duration is None]
    return [f"`{name}` is that of a run, which has a `duration`: give both." for name in given]


def read_run(
    duration: float | str | None, rate: float | str | None
) -> tuple[float | None, float | None]:
    """Duration (s) and rate (1/s) of a run as numbers, of text with units too; None: not given."""
    return (
        None if duration is None else typed_above_zero("duration", duration, "s"),
        None if rate is None else typed_above_zero("rate", rate, "Hz"),
    )


def samples_of(duration: float | None, rate: float | None) -> np.ndarray | None:
    """Times (s) of a run's samples, those of `simulate`; None for steady states.

    Raises `InputError` for a duration or rate that gives less than 2 of them after the start.
    """
    if wrong := without_run(duration, rate=rate):
        raise InputError(wrong)
    if duration is None:
        return None
    rate = RATE if rate is None else rate
    if wrong := not_above_zero(duration=duration, rate=rate):
        raise InputError(wrong)
    if round(duration * rate) < 2:
        raise InputError(f"`duration` {duration:g} s at `rate` {rate:g}/s gives under 2 samples.")
    return sample_times(duration, rate)


def checked_metrics(metrics: Sequence[str] | str) -> tuple[str, ...]:
    """`metrics` (a list, or words with commas between) as a tuple.

    Raises `InputError` with the nearest names for unknown ones, and for none or one named twice.
    """
    names = tuple(split_names(metrics))
    problems = [problem for name in names if (problem := metric_problem(name))]
    problems += [] if names else ["at least one metric is needed, as in peak,rms."]
    twice = dict.fromkeys(name for name in names if names.count(name) > 1)
    problems += [f"`metric` names `{name}` twice." for name in twice]
    if problems:
        raise InputError(problems)
    return names
