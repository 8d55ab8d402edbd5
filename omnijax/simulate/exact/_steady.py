"""`steady_state`: what a rig does in the long run at constant speeds, in closed form."""

from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float

from ..._programs import kept
from ...rig import Rig
from ._cycles import Forcing, forcing, is_traced
from ._ladder import basis_generator, basis_row, levels_needed, second_moments
from ._passage import Passages, longest_passage, passages, periodic_starts
from ._peaks import Curves, bits_needed, component_places, grid, present, supremum_places, values_at
from ._show import html, plot_orders, to_xarray
from ._spectrum import harmonics as dr_harmonics
from ._spectrum import transfer
from ._system import Forced, balanced, exact_obstacle, forced_system


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
) -> SteadyState:
    """Long-run vibration of `rig` at constant wheel `speeds` (rad/s, any sign, zero too).

    Closed forms throughout: periodic solutions piece by piece, their second moments by doubling,
    suprema refined by Newton's method from 2^`grid_bits` points a piece, unless stated two an
    oscillation of the rig, but 512 to 4096.  `angles` (rad) matter only for wheels at rest.
    With `sharpness` p the peak of |dR| is the smooth one, the p-norm over the phases, which lies
    below the supremum and has a gradient everywhere.  Raises `ValueError` for a rig with laws that
    are not linear in the elastic state.
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
    return _steady(rig, speeds, angles, model, harmonics, bits, sharpness, levels)


@kept
def _steady(rig, speeds, angles, model, count, bits, sharpness, levels) -> SteadyState:
    signals = forcing(rig, speeds, angles)
    system, _ = balanced(forced_system(rig, model, speeds, signals.wheel))
    cycles = passages(system, signals, bits, levels)
    starts = periodic_starts(cycles, system.A.shape[0])
    moments = jax.vmap(jax.vmap(second_moments))(cycles.pieces, starts)
    weight = cycles.width / jnp.sum(cycles.width, axis=1, keepdims=True)

    def curves(name):
        return Curves(cycles, starts, output_rows(system, signals, cycles, name))

    dR, elastic = curves("dR"), curves("dR_elastic")
    mean, square = _statistics(dR, moments, weight, system.A.shape[0])
    _, elastic_square = _statistics(elastic, moments, weight, system.A.shape[0])
    _, acceleration = _statistics(curves("a_sphere"), moments, weight, system.A.shape[0])
    high, low = _extremes(dR, bits)
    both = jnp.stack([dR.rows, elastic.rows])
    suprema = jax.vmap(lambda rows: _supremum(dR._replace(rows=rows), bits))(both)
    lines = dr_harmonics(system, signals, count)
    return SteadyState(
        rms=_root(jnp.sum(square)),
        peak=suprema[0] if sharpness is None else _smooth(dR, bits, sharpness),
        rms_component=_root(square),
        peak_component=jnp.maximum(high, -low),
        peak_to_peak=high - low,
        mean=mean,
        rms_elastic=_root(jnp.sum(elastic_square)),
        peak_elastic=suprema[1],
        rms_acceleration=_root(jnp.sum(acceleration)),
        order=signals.base[:, None] * jnp.arange(count + 1),
        spectrum=lines["dR"],
        transmissibility=transfer(system, signals, count),
        wheel=signals.wheel,
        names=rig.names,
    )


def _root(x):
    """Square root with a zero gradient at zero (a round wheel does not vibrate)."""
    return jnp.where(x > 0, jnp.sqrt(jnp.where(x > 0, x, 1.0)), 0.0)


def output_rows(system: Forced, signals: Forcing, cycles: Passages, name: str):
    """One output as rows over z = (s, w): (C, direct row + rate row G/duration), (g, k, o, N)."""

    def one(direct, rate, pieces, duration):
        row, G = basis_row(pieces), basis_generator(pieces)
        moving = duration > 0
        slope = row @ G * jnp.where(moving, 1 / jnp.where(moving, duration, 1.0), 0.0)
        terms = jnp.outer(direct, row) + jnp.outer(rate, slope)
        return jnp.concatenate([system.state[name], terms], axis=1)

    per_signal = jax.vmap(one, in_axes=(None, None, 0, 0))
    return jax.vmap(per_signal)(
        system.direct[name], system.rate[name], signals.cycle.pieces, cycles.duration
    )


def _statistics(curves: Curves, moments, weight, m: int):
    """Mean and mean square of each component of the sum of independent signals."""
    means = jnp.einsum("gk,gkoN,gkN->go", weight, curves.rows, moments[..., m])
    squares = jnp.einsum("gk,gkoN,gkNM,gkoM->go", weight, curves.rows, moments, curves.rows)
    mean = jnp.sum(means, axis=0)
    return mean, jnp.sum(squares - means**2, axis=0) + mean**2


def _supremum(curves: Curves, bits: int):
    total = jnp.sum(values_at(curves, supremum_places(curves, bits)), axis=0)
    return _root(jnp.sum(total**2))


def _extremes(curves: Curves, bits: int):
    """Largest and smallest value of each component."""
    size = curves.rows.shape[-2]

    def one(row):
        return jnp.sum(values_at(curves, component_places(curves, row, bits)) @ row)

    axes = jnp.asarray(np.concatenate([np.eye(size), -np.eye(size)]))
    values = jax.vmap(one)(axes)
    return values[:size], -values[size:]


def _smooth(curves: Curves, bits: int, sharpness: float):
    """(mean over directions of exp-sum supports)^(1/p): a p-norm over directions and phases."""
    values = grid(curves, bits)
    weight = jnp.where(present(curves, bits), jnp.repeat(curves.cycles.width, 2**bits, 1), 0.0)
    weight = weight / jnp.sum(weight, axis=1, keepdims=True)
    places = supremum_places(curves, bits)
    total = jax.lax.stop_gradient(jnp.sum(values_at(curves, places), axis=0))
    size = _root(jnp.sum(total**2))
    direction = total / jnp.where(size > 0, size, 1.0)
    along = values @ direction * (sharpness / jnp.where(size > 0, size, 1.0))
    soft = jax.scipy.special.logsumexp(along, axis=1, b=weight)
    return jnp.sum(soft) * size / sharpness
