"""`steady_state`: what a rig does in the long run at constant speeds, in closed form."""

from pathlib import Path
from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Complex, Float, Int

from ..._batch import batch_words, check_single, single_status
from ..._errors import tell
from ..._programs import kept
from ..._result import AbstractResult
from ..._root import root
from ..._status import Status
from ...rig import Rig, as_rig, typed_above_zero, typed_numbers, whole_number
from .._drives import Numbers, check_speed, check_vector
from .._drives import speeds as speed_drive
from .._exact import exact_obstacle, levels_needed, longest_passage
from .._remarks import remarks
from .long_run import LongRun
from .peak_search import bits_needed
from .show import HEADER, from_xarray, plot_orders, summary_rows, to_xarray
from .spectrum import harmonics, transfer


class SteadyState(eqx.Module, AbstractResult):
    """Long-run vibration at constant speeds, SI: scalars, (3,) a component, (g, h) a line.

    Lengths in m, `sphere_acceleration_rms` in m/s^2; of g signals h orders each, `order` and
    `transmissibility` (g, h) without unit, `spectrum` (g, h, 3) in m.

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
    elastic_rms: Float[Array, ""]  # m, of |sum (mount + contact deflection) normal|
    elastic_peak: Float[Array, ""]  # m
    sphere_acceleration_rms: Float[Array, ""]  # m/s^2, of the sphere's centre
    order: Float[Array, "g h"]
    spectrum: Complex[Array, "g h 3"]  # m
    transmissibility: Float[Array, "g h"]  # |x_i| / |rho_i| at these orders
    status: Int[Array, ""]  # a code of `Status`; all figures are NaN where it is not 0
    wheel: tuple[int, ...] = eqx.field(static=True, default=())
    names: tuple[str, ...] = eqx.field(static=True, default=())

    UNITS: ClassVar[dict[str, str]] = {
        "rms": "m",
        "peak": "m",
        "rms_component": "m",
        "peak_component": "m",
        "peak_to_peak": "m",
        "mean": "m",
        "elastic_rms": "m",
        "elastic_peak": "m",
        "sphere_acceleration_rms": "m/s^2",
        "order": "1",
        "spectrum": "m",
        "transmissibility": "1",
    }

    @property
    def ok(self) -> bool:
        """Whether the rig has a steady state; `ValueError` for a batch of `jax.vmap`."""
        return single_status(self.status) == Status.OK

    def message(self) -> str:
        """One sentence: `ok`, or why there is no steady state; a batch is counted."""
        if words := batch_words(self.status):
            return words
        ended = single_status(self.status)
        return "ok" if self.ok else f"{ended.text}: {ended.remedy}"

    file_kind: ClassVar[str] = "omnijax steady state"
    what: ClassVar[str] = "steady state"

    def sentences(self) -> list[str]:
        """RMS and peak, or why there is no steady state."""
        if batch_words(self.status) or not self.ok:
            return [f"SteadyState({self.message()})"]
        return [
            f"SteadyState(rms={float(self.rms):.6g} m, peak={float(self.peak):.6g} m, "
            f"{len(self.wheel)} signals, {self.order.shape[1] - 1} harmonics)"
        ]

    def __repr__(self) -> str:
        return AbstractResult.__repr__(self)

    def table(self):
        """The scalar figures and those of each component."""
        check_single(self.status.shape)
        return "Steady state", summary_rows(self), HEADER

    def plot_orders(self, *, ax=None):
        """Order spectrum of |dR| in micrometres; draws on `ax` or on a figure of its own."""
        check_single(self.status.shape)
        return plot_orders(self, ax=ax)

    def to_xarray(self):
        """Every figure with its unit as an `xarray.Dataset`."""
        check_single(self.status.shape)
        return to_xarray(self)

    @classmethod
    def from_xarray(cls, data):
        """The steady state of which `to_xarray` made `data`."""
        return from_xarray(cls, data)


def steady_state(
    rig: Rig | str | Path,
    speeds: Numbers,
    *,
    model: str = "coupled",
    angles: Numbers | None = None,
    harmonics: int = 32,
    grid_bits: int | None = None,
    sharpness: float | None = None,
    force: Numbers | None = None,
) -> SteadyState:
    """Long-run vibration of `rig` at constant wheel `speeds` (rad/s, any sign, zero too).

    `rig` may be a rig file or the name of a bundled rig, `speeds` (n,) text or hold texts with
    units, as for `simulate`: `steady_state("atlas", "30 rpm, 0, 10 rpm")`.

    Closed forms throughout: periodic solutions piece by piece, their second moments by doubling,
    suprema refined by Newton's method from places graded towards each edge and 2^`grid_bits` even
    ones a piece, unless stated four an oscillation of the rig, but 512 to 8192.  `angles` (rad,
    or text) matter only for wheels at rest: those of wheels that turn count as unknown, in step
    or not, so that an RMS is the mean over them and a peak the largest of all. With `sharpness`
    p > 0 the peak of |dR| is the smooth one, the p-norm over the phases, which lies below the
    supremum and has a gradient everywhere. A constant `force` on the platform (N) accelerates
    the machine as a whole and adds a constant deflection; accelerations are those of the
    inertial frame, so the common one is part of them. Where the wheels do not hold the sphere
    in every direction, or figures are not finite, `status` says so and all figures are NaN,
    inside transformations too. Warns of speeds that do not fit each other, and of an axis that
    the wheels hardly drive. Raises `InputError` for numbers that do not fit or are not finite,
    `ValueError` for a rig with laws that are not linear in the elastic state.

    Source: the paper's eqs. 32-42, periodic (`docs/theory.md`, prescribed speeds).
    """
    rig = as_rig(rig)
    speeds = jnp.asarray(typed_numbers("speeds", speeds, "rad/s"), float)
    given = jnp.zeros(rig.size) if angles is None else typed_numbers("angles", angles, "rad")
    angles = jnp.asarray(given, float)
    force = None if force is None else jnp.asarray(typed_numbers("force", force, "N"), float)
    check_vector("speeds", speeds, rig.size)
    check_speed("speeds", speeds)
    check_vector("angles", angles, rig.size)
    if force is not None:
        check_vector("force", force, 3)
    harmonics = whole_number("harmonics", harmonics, low=0)
    if grid_bits is not None:
        grid_bits = whole_number("grid_bits", grid_bits, low=0)
    if sharpness is not None:
        sharpness = typed_above_zero("sharpness", sharpness, "1")
    state = settled(
        rig, speeds, angles, model=model, harmonics=harmonics, grid_bits=grid_bits,
        sharpness=sharpness, force=force,
    )  # fmt: skip
    tell(remarks(rig, speed_drive(speeds), None, model))
    return state


def settled(
    rig: Rig,
    speeds: Float[Array, " n"],
    angles: Float[Array, " n"],
    *,
    model: str = "coupled",
    harmonics: int = 32,
    grid_bits: int | None = None,
    sharpness: float | None = None,
    force: Float[Array, "3"] | None = None,
) -> SteadyState:
    """`steady_state` of numbers that fit the rig; warns of nothing, raises `ValueError` alike."""
    reason = exact_obstacle(rig, model)
    if reason is not None:
        raise ValueError(f"no closed-form steady state: {reason}; use `simulate`.")
    passage = longest_passage(rig, speeds, angles, model)
    bits = bits_needed(passage) if grid_bits is None else grid_bits
    levels = levels_needed(passage, bits)
    return _steady(rig, speeds, angles, model, harmonics, bits, sharpness, levels, force)


@kept
def _steady(rig, speeds, angles, model, count, bits, sharpness, levels, force) -> SteadyState:
    run = LongRun(rig, speeds, angles, model, bits, levels, force)
    mean, square = run.statistics("dR")
    high, low = run.extremes("dR")
    peak, elastic_peak = run.suprema("dR", "dR_elastic")
    system, signals = run.system, run.signals
    figures = dict(
        rms=root(jnp.sum(square)),
        peak=peak if sharpness is None else run.smooth_peak("dR", sharpness),
        rms_component=root(square),
        peak_component=jnp.maximum(high, low),
        peak_to_peak=high + low,
        mean=mean,
        elastic_rms=root(jnp.sum(run.mean_square("dR_elastic"))),
        elastic_peak=elastic_peak,
        sphere_acceleration_rms=root(jnp.sum(run.mean_square("a_sphere"))),
        spectrum=harmonics(system, signals, count)["dR"],
        transmissibility=transfer(system, signals, count),
    )
    status = _ended(run.status, figures)
    figures = jax.tree.map(lambda x: jnp.where(status == Status.OK, x, jnp.nan), figures)
    order = signals.base[:, None] * jnp.arange(count + 1)
    return SteadyState(**figures, order=order, status=status, wheel=signals.wheel, names=rig.names)


def _ended(status: Int[Array, ""], figures: dict[str, Array]) -> Int[Array, ""]:
    """`status`, or `NON_FINITE` where it is `OK` against the figures."""
    finite = jnp.all(jnp.stack([jnp.all(jnp.isfinite(x)) for x in figures.values()]))
    return jnp.where((status == Status.OK) & ~finite, Status.NON_FINITE, status)
