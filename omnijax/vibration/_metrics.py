"""The table of vibration metrics: unit, meaning, and how a run and a steady state give each."""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.core import Tracer
from jaxtyping import Array, Float

from .._arrays import largest, smallest
from .._batch import check_single
from .._errors import did_you_mean, tell
from .._programs import kept
from .._root import root
from .._text import split_names
from ..rig import Rig, as_rig, typed_numbers, up
from ..simulation import RunChannels, SteadyFigures, Trajectory, remarks
from ..simulation import speeds as speed_drive
from ._amplitude import norm, peak, peak_to_peak, rms, smooth_peak
from ._comfort import check_even, weighted_acceleration
from ._steady import SHARPNESS, SteadyRun


class Metric(NamedTuple):
    """One figure: unit, meaning, how a run and a steady state give it, which way is better.

    `of_steady` is None where the long run has no closed form of it: that needs a `duration`.
    """

    unit: str
    meaning: str
    of_run: Callable[[Trajectory | RunChannels, Rig], Float[Array, ""]]
    of_steady: Callable[[SteadyRun | SteadyFigures], Float[Array, ""]] | None
    smaller_is_better: bool = True


def _component(i: int, axis: str) -> dict[str, Metric]:
    def part(name):
        return lambda run: getattr(run, name)[:, i : i + 1]

    dR, rate, elastic = part("dR"), part("dR_rate"), part("dR_elastic")
    return {
        f"peak_{axis}": Metric(
            "m",
            f"largest |ΔR_{axis}|",
            lambda r, _: peak(r.t, dR(r), rate(r)),
            lambda s: largest(s.extremes("dR")[:, i]),
        ),
        f"rms_{axis}": Metric(
            "m",
            f"RMS of ΔR_{axis}",
            lambda r, _: rms(r.t, dR(r)),
            lambda s: root(s.mean_square("dR")[i]),
        ),
        f"peak_to_peak_{axis}": Metric(
            "m",
            f"range of ΔR_{axis}",
            lambda r, _: peak_to_peak(dR(r)[:, 0]),
            lambda s: jnp.sum(s.extremes("dR"), axis=0)[i],
        ),
        f"elastic_rms_{axis}": Metric(
            "m",
            f"RMS of the elastic part along {axis}",
            lambda r, _: rms(r.t, elastic(r)),
            lambda s: root(s.mean_square("dR_elastic")[i]),
        ),
    }


METRICS: dict[str, Metric] = {
    "peak": Metric(
        "m",
        "largest |ΔR|",
        lambda r, _: peak(r.t, r.dR, r.dR_rate),
        lambda s: s.suprema("dR")[0],
    ),
    "rms": Metric(
        "m",
        "RMS of |ΔR|",
        lambda r, _: rms(r.t, r.dR),
        lambda s: root(jnp.sum(s.mean_square("dR"))),
    ),
    "peak_to_peak": Metric(
        "m", "range of |ΔR|", lambda r, _: peak_to_peak(norm(r.dR)), None
    ),  # its least value over independent phases has no closed form
    "smooth_peak": Metric(
        "m",
        "64-norm of |ΔR| over the time (steady: over the phases, of exp(64 |ΔR|/S) for powers)",
        lambda r, _: smooth_peak(r.t, r.dR),
        lambda s: s.smooth_peak("dR", SHARPNESS),
    ),
    "elastic_peak": Metric(
        "m",
        "largest elastic part |Σ(Δ+δ)r̂| at a sample",
        lambda r, _: peak(r.t, r.dR_elastic),
        lambda s: s.suprema("dR_elastic")[0],
    ),
    "elastic_rms": Metric(
        "m",
        "RMS of the elastic part",
        lambda r, _: rms(r.t, r.dR_elastic),
        lambda s: root(jnp.sum(s.mean_square("dR_elastic"))),
    ),
    **_component(0, "x"),
    **_component(1, "y"),
    **_component(2, "z"),
    "sphere_acceleration_rms": Metric(
        "m/s^2",
        "RMS acceleration of the sphere's centre",
        lambda r, _: rms(r.t, r.a_sphere),
        lambda s: root(jnp.sum(s.mean_square("a_sphere"))),
    ),
    "sphere_acceleration_peak": Metric(
        "m/s^2",
        "largest acceleration of the sphere's centre",
        lambda r, _: peak(r.t, r.a_sphere),
        lambda s: s.suprema("a_sphere")[0],
    ),
    "sphere_weighted_acceleration": Metric(
        "m/s^2",
        "ISO 2631-1 weighted RMS acceleration of the sphere (W_d across, W_k along gravity)",
        lambda r, rig: weighted_acceleration(r.t, r.a_sphere, up(rig)),
        lambda s: s.weighted(),
    ),
    "platform_acceleration_rms": Metric(
        "m/s^2", "RMS acceleration of the platform", lambda r, _: rms(r.t, r.a), None
    ),
    "platform_acceleration_peak": Metric(
        "m/s^2", "largest acceleration of the platform", lambda r, _: peak(r.t, r.a), None
    ),
    "slip_margin": Metric(
        "N",
        "least μN − |f| of all contacts",
        lambda r, _: smallest(r.slip_margin),
        lambda s: smallest(s.slip_margin()),
        False,
    ),
    "lift_off_margin": Metric(
        "N",
        "least normal force of all contacts",
        lambda r, _: smallest(r.normal_force),
        lambda s: smallest(s.least_normal_force()),
        False,
    ),
}

STEADY_METRICS = tuple(name for name, metric in METRICS.items() if metric.of_steady is not None)

_RENAMED = {  # word of version 0.1 -> what it meant
    "acceleration_rms": "sphere_acceleration_rms (platform_acceleration_rms in the summary of a "
    "run)",
    "acceleration_peak": "sphere_acceleration_peak",
    "weighted_acceleration": "sphere_weighted_acceleration",
}


def metric_problem(name: object, more: Iterable[str] = (), begins: str | None = None) -> str | None:
    """Why `name` is no metric, with the nearest one; None if it is a metric or one of `more`."""
    options = [*more, *METRICS]
    if name in options:
        return None
    if str(name) in _RENAMED:
        return f"`{name}` does not say whose acceleration it is: write {_RENAMED[str(name)]}."
    listed = f" Known are {', '.join(options)}."
    begins = begins or f"`{name}` is no metric."
    return f"{begins}{did_you_mean(str(name), options)}{listed}"


def known(name: str) -> str:
    """`name` if it is a metric; else `ValueError` with the nearest name."""
    problem = metric_problem(name)
    if problem is not None:
        raise ValueError(problem)
    return name


def evaluate(
    run: Trajectory | RunChannels, rig: Rig | str | Path, names: str | Iterable[str]
) -> dict[str, Float[Array, ""]]:
    """The named metrics of a run in SI; differentiable.

    `rig` may be a rig file or the name of a bundled rig; `names` is a list, or text with commas
    between.  Raises `ValueError` with the nearest name for an unknown one, and for a batch of runs
    or rigs: ask inside `jax.vmap`.

    A dict of scalars by name, in the unit that `METRICS` gives.

    Source: the definitions in `METRICS`; ISO 2631-1:1997 for the weighted ones.
    """
    check_single(jnp.shape(run.t)[:-1])
    rig, asked = as_rig(rig), tuple(map(known, split_names(names)))
    if any(isinstance(x, Tracer) for x in jax.tree.leaves((run, rig))):
        return dict(zip(asked, _of_run(run, rig, asked), strict=True))
    if "sphere_weighted_acceleration" in asked:
        check_even(run.t)
    return dict(zip(asked, _figures_of_run(run, rig, asked), strict=True))


def _of_run(run: Trajectory | RunChannels, rig: Rig, names: tuple[str, ...]) -> list[Array]:
    return [METRICS[name].of_run(run, rig) for name in names]


@kept
def _figures_of_run(run, rig, names) -> list[Array]:
    """The figures of `evaluate`, by one program."""
    return _of_run(run, rig, names)


def steady_metrics(
    rig: Rig,
    speeds: Float[Array, " n"],
    names: tuple[str, ...],
    *,
    model: str = "coupled",
    angles: Float[Array, " n"] | None = None,
    force: Float[Array, "3"] | None = None,
) -> dict[str, Float[Array, ""]]:
    """The named metrics of the steady state at constant `speeds` (rad/s); differentiable.

    A constant `force` on the platform (N) counts as in `steady_state`.
    Every metric of `STEADY_METRICS`; `ValueError` for others, which need a run.
    NaN where the wheels do not hold the sphere in every direction.  Warns as `steady_state` does.
    """
    for name in names:
        if known(name) not in STEADY_METRICS:
            raise ValueError(f"`{name}` has no steady-state form; give a `duration`.")
    angles = jnp.zeros(rig.size) if angles is None else angles
    speeds = jnp.asarray(typed_numbers("speeds", speeds, "rad/s"), float)
    figures = _steady_figures(rig, speeds, tuple(names), model, angles, force)
    tell(remarks(rig, speed_drive(speeds), None, model))
    return dict(zip(names, figures, strict=True))


@eqx.filter_jit
def _steady_figures(rig, speeds, names, model, angles, force) -> list[Float[Array, ""]]:
    """The figures of `steady_metrics`, by one program."""
    run = SteadyRun(rig, speeds, angles, model, force=force)
    return [steady_metric(run, name) for name in names]


def steady_metric(run: SteadyRun, name: str) -> Float[Array, ""]:
    """One of `STEADY_METRICS`, in the unit that `METRICS` gives; NaN without a steady state."""
    of_steady = METRICS[name].of_steady
    assert of_steady is not None  # who asks has refused the others
    return run.if_settled(of_steady(run))
