"""The table of vibration metrics: name -> unit, meaning, and a function of a run and its rig."""

from collections.abc import Callable
from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from ..rig import Rig
from ..simulation import Trajectory
from ._amplitude import norm, peak, peak_to_peak, rms, smooth_peak
from ._comfort import weighted_acceleration


class Metric(NamedTuple):
    """One figure of a run: its unit, its meaning, how it is computed, and which way is better."""

    unit: str
    meaning: str
    of: Callable[[Trajectory, Rig], Float[Array, ""]]
    smaller_is_better: bool = True


def up(rig: Rig) -> Float[Array, "3"]:
    """Unit vector against gravity; +z where the rig has none."""
    size = jnp.sqrt(jnp.sum(rig.platform.gravity**2))
    safe = jnp.where(size > 0, size, 1.0)
    return jnp.where(size > 0, -rig.platform.gravity / safe, jnp.array([0.0, 0.0, 1.0]))


def _component(i: int, axis: str) -> dict[str, Metric]:
    def part(name):
        return lambda run: getattr(run, name)[:, i : i + 1]

    dR, rate, elastic = part("dR"), part("dR_rate"), part("dR_elastic")
    return {
        f"peak_{axis}": Metric("m", f"largest |ΔR_{axis}|", lambda r, _: peak(r.t, dR(r), rate(r))),
        f"rms_{axis}": Metric("m", f"RMS of ΔR_{axis}", lambda r, _: rms(dR(r))),
        f"peak_to_peak_{axis}": Metric(
            "m", f"range of ΔR_{axis}", lambda r, _: peak_to_peak(dR(r)[:, 0])
        ),
        f"elastic_rms_{axis}": Metric(
            "m", f"RMS of the elastic part along {axis}", lambda r, _: rms(elastic(r))
        ),
    }


METRICS: dict[str, Metric] = {
    "peak": Metric("m", "largest |ΔR|", lambda r, _: peak(r.t, r.dR, r.dR_rate)),
    "rms": Metric("m", "RMS of |ΔR|", lambda r, _: rms(r.dR)),
    "peak_to_peak": Metric("m", "range of |ΔR|", lambda r, _: peak_to_peak(norm(r.dR))),
    "smooth_peak": Metric("m", "64-norm of |ΔR| over the samples", lambda r, _: smooth_peak(r.dR)),
    "elastic_peak": Metric(
        "m", "largest elastic part |Σ(Δ+δ)r̂| at a sample", lambda r, _: peak(r.t, r.dR_elastic)
    ),
    "elastic_rms": Metric("m", "RMS of the elastic part", lambda r, _: rms(r.dR_elastic)),
    **_component(0, "x"),
    **_component(1, "y"),
    **_component(2, "z"),
    "acceleration_rms": Metric(
        "m/s^2", "RMS acceleration of the sphere's centre", lambda r, _: rms(r.a_sphere)
    ),
    "acceleration_peak": Metric(
        "m/s^2", "largest acceleration of the sphere's centre", lambda r, _: peak(r.t, r.a_sphere)
    ),
    "weighted_acceleration": Metric(
        "m/s^2",
        "ISO 2631-1 weighted RMS acceleration (W_d across, W_k along gravity)",
        lambda r, rig: weighted_acceleration(r.t, r.a_sphere, up(rig)),
    ),
    "slip_margin": Metric(
        "N", "least μN − |f| of all contacts", lambda r, _: jnp.min(r.slip_margin), False
    ),
    "lift_off_margin": Metric(
        "N", "least normal force of all contacts", lambda r, _: jnp.min(r.normal_force), False
    ),
}


def evaluate(run: Trajectory, rig: Rig, names: tuple[str, ...]) -> dict[str, Float[Array, ""]]:
    """The named metrics of a run; `ValueError` with the nearest name for an unknown one."""
    return {name: METRICS[known(name)].of(run, rig) for name in names}


def known(name: str) -> str:
    """`name` if it is a metric."""
    if name not in METRICS:
        import difflib

        near = difflib.get_close_matches(name, METRICS, 1)
        hint = f" Did you mean `{near[0]}`?" if near else ""
        raise ValueError(f"`{name}` is no metric.{hint} Metrics: {', '.join(METRICS)}.")
    return name
