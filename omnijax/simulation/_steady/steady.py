"""`steady_state`: what a rig does in the long run at constant speeds, in closed form."""

from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Complex, Float

from ..._programs import kept
from ..._root import root
from ...rig import Rig
from .._exact import exact_obstacle, is_traced, levels_needed, longest_passage
from .long_run import LongRun
from .peak_search import bits_needed
from .show import html, plot_orders, to_xarray
from .spectrum import harmonics, transfer


class SteadyState(eqx.Module):
    """Long-run vibration at constant speeds.

    The signals of the wheels run independently of each other (incommensurate speeds, or start
    angles that are not known): RMS values average over all their phases, peaks are the suprema
    over them.  `spectrum` holds, for each signal, amplitudes of dR at `order` (multiples of the
    wheel's rotation): dR = mean + Re sum amplitude exp(i order |omega| t).
    """

    rms: Float[Array, ""]  # m, of |dR|
    peak: Float[Array, ""]  # m, long-run supremum of |dR|
    rms_component: Float[Array, "3"]  # m
    peak_component: Float[Array, "3"]  # m, of the absolute value
    peak_to_peak: Float[Array, "3"]  # m
    mean: Float[Array, "3"]  # m
    rms_elastic: Float[Array, ""]  # m, of |sum (mount + contact deflection) normal|
    peak_elastic: Float[Array, ""]  # m
    rms_acceleration: Float[Array, ""]  # m/s^2, of the sphere's centre
    order: Float[Array, "g h"]
    spectrum: Complex[Array, "g h 3"]  # m
    transmissibility: Float[Array, "g h"]  # |x_i| / |rho_i| at these orders
    wheel: tuple[int, ...] = eqx.field(static=True, default=())
    names: tuple[str, ...] = eqx.field(static=True, default=())

    UNITS: ClassVar[dict[str, str]] = {
        "rms": "m",
        "peak": "m",
        "rms_component": "m",
        "peak_component": "m",
        "peak_to_peak": "m",
        "mean": "m",
        "rms_elastic": "m",
        "peak_elastic": "m",
        "rms_acceleration": "m/s^2",
        "order": "1",
        "spectrum": "m",
        "transmissibility": "1",
    }

    def __repr__(self) -> str:
        return (
            f"SteadyState(rms={_text(self.rms)} m, peak={_text(self.peak)} m, "
            f"{len(self.wheel)} signals, {self.order.shape[1] - 1} harmonics)"
        )

    def _repr_html_(self) -> str:
        return html(self)

    def plot_orders(self, *, ax=None):
        """Order spectrum of |dR| in micrometres; draws on `ax` or on a figure of its own."""
        return plot_orders(self, ax=ax)

    def to_xarray(self):
        """Every figure with its unit as an `xarray.Dataset`."""
        return to_xarray(self)


def _text(x) -> str:
    return "traced" if is_traced(x) else f"{float(x):.6g}"


def steady_state(
    rig: Rig,
    speeds: Float[Array, " n"],
    *,
    model: str = "coupled",
    angles: Float[Array, " n"] | None = None,
    harmonics: int = 32,
    grid_bits: int | None = None,
    sharpness: float | None = None,
    force: Float[Array, "3"] | None = None,
) -> SteadyState:
    """Long-run vibration of `rig` at constant wheel `speeds` (rad/s, any sign, zero too).

    Closed forms throughout: periodic solutions piece by piece, their second moments by doubling,
    suprema refined by Newton's method from places graded towards each edge and 2^`grid_bits` even
    ones a piece, unless stated four an oscillation of the rig, but 512 to 8192.  `angles` (rad)
    matter only for wheels at rest.  With `sharpness` p the peak of |dR| is the smooth one, the
    p-norm over the phases, which lies below the supremum and has a gradient everywhere.  A constant
    `force` on the platform (N) accelerates the machine as a whole and adds a constant deflection;
    accelerations are those of the inertial frame, so the common one is part of them.  Raises
    `ValueError` for a rig with laws that are not linear in the elastic state.
    """
    reason = exact_obstacle(rig, model)
    if reason is not None:
        raise ValueError(f"no closed-form steady state: {reason}; use `simulate`.")
    speeds = jnp.asarray(speeds, float)
    if speeds.shape != (rig.size,):
        raise ValueError(f"`speeds` must have {rig.size} entries, but has shape {speeds.shape}.")
    angles = jnp.zeros(rig.size) if angles is None else jnp.asarray(angles, float)
    passage = longest_passage(rig, speeds, angles, model)
    bits = bits_needed(passage) if grid_bits is None else grid_bits
    levels = levels_needed(passage, bits)
    force = None if force is None else jnp.asarray(force, float)
    return _steady(rig, speeds, angles, model, harmonics, bits, sharpness, levels, force)


@kept
def _steady(rig, speeds, angles, model, count, bits, sharpness, levels, force) -> SteadyState:
    run = LongRun(rig, speeds, angles, model, bits, levels, force)
    mean, square = run.statistics("dR")
    high, low = run.extremes("dR")
    peak, peak_elastic = run.suprema("dR", "dR_elastic")
    system, signals = run.system, run.signals
    return SteadyState(
        rms=root(jnp.sum(square)),
        peak=peak if sharpness is None else run.smooth_peak("dR", sharpness),
        rms_component=root(square),
        peak_component=jnp.maximum(high, low),
        peak_to_peak=high + low,
        mean=mean,
        rms_elastic=root(jnp.sum(run.mean_square("dR_elastic"))),
        peak_elastic=peak_elastic,
        rms_acceleration=root(jnp.sum(run.mean_square("a_sphere"))),
        order=signals.base[:, None] * jnp.arange(count + 1),
        spectrum=harmonics(system, signals, count)["dR"],
        transmissibility=transfer(system, signals, count),
        wheel=signals.wheel,
        names=rig.names,
    )
