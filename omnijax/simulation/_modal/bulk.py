"""Figures of many designs by the modal core: programs depend on kinds of input alone."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from ..._compiling import Effort
from ..._programs import kept
from ..._root import root
from ...dynamics import held, hold_obstacle
from ...laws import ContinuousSine, DamagedRoller, GatedSine, HalfSine, Rollers
from ...rig import Placed, Rig
from .._exact import exact_obstacle
from .decoupling import blocks_of, coupled, decoupled, turned_states
from .gradient import half_root, pull_back
from .mean_square import square_sums
from .output_sums import slopes_of
from .peak import peak_sums
from .phases import longest_period
from .poles import Eigen, eigen, modes_of
from .signals import series_needed
from .steady import steady_of
from .system import Layout, LinearDesign, Operating, designs_of
from .transient import LANES, Lanes, samples_of

BULK_METRICS = ("rms", "peak")
FEW = 1024  # designs up to which the slowest code costs less than the second that compiling better
# code takes (see `PLAIN`): 0.15 s more for values, 0.8 s with gradients, at every call
MANY = 500_000  # designs that repay the best code: a tenth faster, or a fifth with gradients, and
# compiled in 5 or 35 s more of CPU time on one machine (three unlike wheels)
# samples worked out beside each other, the more the shorter the program; 4 makes the fastest
TOGETHER = {Effort.LEAST: 32, Effort.QUICK: 8, Effort.MOST: 4}


def effort_for(designs: int) -> Effort:
    """What programs that run on so many designs are worth to the compiler."""
    if designs <= FEW:
        return Effort.LEAST
    return Effort.QUICK if designs < MANY else Effort.MOST


class ModalFigures(NamedTuple):
    """Figures of a batch, and what says how a run would have ended."""

    values: Float[np.ndarray, "B m"]
    slopes: Float[np.ndarray, "B m d"] | None
    normal: Float[np.ndarray, " B"]  # N, of the least normal force a bound of the same sign
    slip: Float[np.ndarray, " B"]  # N, the same of the least mu N - |f|; without lift-off
    held: Bool[np.ndarray, " B"]  # whether the wheels hold the sphere


def modal_obstacle(
    rig: Rig, model: str = "coupled", metrics: Sequence[str] = BULK_METRICS
) -> str | None:
    """Why the modal core does not give these figures of the rig, in words; None where it does."""
    reason = exact_obstacle(rig, model) or hold_obstacle(rig, model)
    if reason is not None:
        return reason
    others = [name for name in metrics if name not in BULK_METRICS]
    if others:
        return f"the modal core does not give {', '.join(others)}"
    for name, profile in zip(rig.names, rig.profiles, strict=True):
        if not isinstance(profile, GatedSine | HalfSine | ContinuousSine | Rollers):
            return f"wheel {name}'s profile `{profile.id}` is no sum of sinusoids"
    return None


def modal_steady_obstacle(
    rig: Rig, model: str = "coupled", metrics: Sequence[str] = BULK_METRICS
) -> str | None:
    """The same of steady states."""
    reason = modal_obstacle(rig, model, metrics)
    if reason is not None:
        return reason
    laws = [(placed.law, placed.wheels) for placed in rig.at("shape")]
    for i, name in enumerate(rig.names):
        if sum(i in wheels for law, wheels in laws if isinstance(law, DamagedRoller)) > 1:
            return f"wheel {name} has more than one damaged roller"
    return None


SIZES = (LANES, 8 * LANES)  # designs a call of the compiled programs
# whose laws enter the linear model and what it moves by
_PORTS = ("radius", "shape", "contact", "platform", "kinematics")


def modal_figures(
    make: Callable[[Array], Operating],
    rows: Float[Array | np.ndarray, "B d"],
    metrics: Sequence[str] = BULK_METRICS,
    *,
    duration: float,
    step: float,
    model: str = "coupled",
    gradient: bool = False,
    total: int = 0,
) -> ModalFigures:
    """Figures of the designs `make(row)` over the samples t = 0, step, ... , duration (s).

    `metrics` may hold `rms` and `peak`, as `vibration.METRICS` defines them; with `gradient` also
    their derivatives by the numbers in the rows.  The compiled programs depend on the rig's kinds
    of wheels and laws, not on numbers, paths or the closure `make`; the more designs there are in
    all (the rows, or `total` that they belong to), the more the compiler does for the programs.
    Raises `ValueError` where `modal_obstacle` names a reason.
    """
    every, count = jnp.asarray(step, float), jnp.asarray(round(duration / step) + 1, float)

    def figures(design: LinearDesign, layout: Layout, effort: Effort):
        return _figures(design, layout, every, count, gradient, effort=effort)

    return _batches(make, rows, metrics, model, gradient, modal_obstacle, figures, total)


def modal_steady(
    make: Callable[[Array], Operating],
    rows: Float[Array | np.ndarray, "B d"],
    metrics: Sequence[str] = BULK_METRICS,
    *,
    model: str = "coupled",
    gradient: bool = False,
    total: int = 0,
) -> ModalFigures:
    """Figures of the long run of the designs `make(row)`, as `steady_state` defines them.

    RMS in closed form, suprema refined to 1e-6 or better; else as `modal_figures`.  Raises
    `ValueError` where `modal_steady_obstacle` names a reason.
    """

    def figures(design: LinearDesign, layout: Layout, effort: Effort):
        return _long_run(design, layout, gradient, effort=effort)

    return _batches(make, rows, metrics, model, gradient, modal_steady_obstacle, figures, total)


def _batches(
    make, rows, metrics, model: str, gradient: bool, obstacle, figures, total: int
) -> ModalFigures:
    """`figures(design, layout, effort)` of all designs, batch by batch."""
    effort = effort_for(max(len(rows), total))
    parts, slopes, turn = [], [], None
    size = SIZES[0] if len(rows) <= SIZES[0] else SIZES[-1]
    rows = np.asarray(rows, float)  # slices of jax's arrays are programs
    for i in range(0, len(rows), size):
        some = rows[i : i + size]
        some = jnp.asarray(np.concatenate([some, np.repeat(some[-1:], size - len(some), axis=0)]))
        points = _points(make, some)
        if i == 0:
            reason = obstacle(_one(points.rig), model, metrics)
            if reason is not None:
                raise ValueError(f"no figures from the modal form: {reason}.")
        force, series = bool(np.any(np.asarray(points.force))), _series(points.rig)
        plain = _plain(points)
        design, layout, turn = _apart(plain, turn, (model, force, series), effort)
        layout = layout._replace(together=TOGETHER[effort])
        values, bars = figures(design, layout, effort)
        holds = np.asarray(_held(plain.rig, model, effort=effort))
        parts.append(np.concatenate([values, holds[None]]))
        if gradient:
            back = _from_designs(plain, bars, model, force, series, turn, effort=effort)
            slopes.append(np.asarray(_from_points(make, some, back)))
    rms, peak, normal, slip, holds = np.concatenate(parts, axis=1)[:, : len(rows)]
    values, chosen = {"rms": rms, "peak": peak}, [BULK_METRICS.index(name) for name in metrics]
    return ModalFigures(
        np.stack([values[name] for name in metrics], axis=1),
        np.concatenate(slopes, axis=1)[chosen, : len(rows)].swapaxes(0, 1) if gradient else None,
        normal,
        slip,
        holds > 0,
    )


def _apart(points: Operating, turn: np.ndarray | None, how: tuple, effort: Effort):
    """Designs with their states along directions that decouple them, where any do, and those.

    `turn`: the directions of the batch before, which mostly do for this one too.
    """
    design, layout = _designs(points, *how, turn, effort=effort)
    coupling = coupled(design.system)
    if turn is not None and len(blocks_of(coupling)) == 1:
        design, turn = _designs(points, *how, effort=effort)[0], None
        coupling = coupled(design.system)
    if turn is None and len(blocks_of(coupling)) == 1:
        turn = turned_states(points.rig, design.system)
        if turn is not None:
            design, layout = _designs(points, *how, turn, effort=effort)
            coupling = coupled(design.system)
    return design, decoupled(design.system, layout, coupling), turn


@kept
def _held(rigs: Rig, model: str):
    return jax.vmap(lambda rig: held(rig, model))(rigs)


def _one(rigs: Rig) -> Rig:
    """The rig of a batch whose centre of mass is farthest off."""
    offset = np.abs(np.asarray(rigs.sphere.centre_of_mass)).sum(axis=1)
    return jax.tree.map(lambda x: np.asarray(x)[np.argmax(offset)], rigs)


@eqx.filter_jit
def _points(make, rows) -> Operating:
    return jax.vmap(make)(rows)


def _plain(points: Operating) -> Operating:
    """The points without names and laws that do not enter, so that rigs share their programs."""
    rig = points.rig
    effects = tuple(
        Placed(placed.law, "", placed.wheels) for placed in rig.effects if placed.law.port in _PORTS
    )
    names = tuple(str(i) for i in range(rig.size))
    plain = Rig(rig.sphere, rig.platform, rig.wheels, rig.profiles, effects, names)
    return points._replace(rig=plain)


def _series(rig: Rig) -> int:
    """Terms that `rollers` need anywhere in the batch; 1 where no wheel has them."""
    if not any(isinstance(profile, Rollers) for profile in rig.profiles):
        return 1
    share = jax.vmap(lambda one: one.wheel_radius / one.sphere.radius)(rig)
    return series_needed(float(jnp.max(share)))


@kept
def _designs(
    points: Operating, model: str, force: bool, series: int, turn: Any = None
) -> tuple[LinearDesign, Layout]:
    return designs_of(points, model, force, series, turn)


@kept
def _from_designs(
    points: Operating, bars, model: str, force: bool, series: int, turn: Any = None
) -> Operating:
    """Derivatives by every number of the points, one entry a metric, from those by the designs."""
    moving, still = eqx.partition(points, eqx.is_inexact_array)

    def designs(moving):
        design = designs_of(eqx.combine(moving, still), model, force, series, turn)[0]
        return design.system, design.signals

    back = jax.vjp(designs, moving)[1]
    return jax.vmap(lambda bar: back(bar)[0])(bars)


@eqx.filter_jit
def _from_points(make, rows, bars: Operating):
    """Derivatives (metrics, B, d) by the rows from those by the plain points."""

    def plain(row) -> Operating:
        return _plain(make(row))

    back = jax.vjp(jax.vmap(plain), rows)[1]
    return jax.vmap(lambda bar: back(bar)[0])(bars)


@kept
def _figures(design: LinearDesign, layout: Layout, step, count, gradient: bool):
    """(4, B): figures and margins; and derivatives by systems and signals, one entry a metric."""

    def some(g: Lanes):
        also = square_sums(g, layout, step) if gradient else None
        samples, by_square = samples_of(g, layout, step, count, also)
        if not gradient:
            squares, slopes = (samples.total / count, samples.near.peak(step)), None
        else:
            peak, by_peak = peak_sums(g, layout, samples.near, step)
            squares = samples.total / count, peak
            both = jax.tree.map(lambda *x: jnp.concatenate(x, axis=-1), by_square, by_peak)
            slopes = slopes_of(jax.tree.map(lambda x: jnp.concatenate([x, x], -1), g), layout, both)
            scale = jnp.concatenate([2 / count * half_root(squares[0]), half_root(peak)])
            slopes = jax.tree.map(lambda x: jnp.stack(jnp.split(scale * x, 2, axis=-1)), slopes)
        figures = [root(square) for square in squares]
        return jnp.stack([*figures, samples.normal, samples.slip]), slopes

    return _of_groups(some, design, layout, step * count)


@kept
def _long_run(design: LinearDesign, layout: Layout, gradient: bool):
    """The same of the long run."""
    span = longest_period(design.signals, layout) if gradient else None
    return _of_groups(lambda g: steady_of(g, layout, gradient), design, layout, span)


def _of_groups(some: Callable, design: LinearDesign, layout: Layout, span):
    """Figures of `some(lanes)` for all designs, and what its slopes give by systems and signals.

    `span` (s): over which two poles are as good as equal or not.
    """
    pairs = eigen(design.system, layout)
    last = jax.tree.map(lambda x: jnp.moveaxis(x, 0, -1), pairs)
    groups = jax.tree.map(_grouped, (lanes_of(design, pairs), last))

    def one(group: tuple[Lanes, Eigen]):
        values, slopes = some(group[0])
        if slopes is None:
            return values, None
        system = jax.lax.map(lambda slope: pull_back(*group, slope, layout, span), slopes)
        return values, (system, slopes.signals)

    values, bars = jax.lax.map(one, groups)
    return _flat(values), jax.tree.map(lambda x: jnp.moveaxis(_flat(x), -1, 1), bars)


def _flat(x):
    """(groups, ..., lanes) as (..., B)."""
    x = jnp.moveaxis(x, 0, -2)
    return x.reshape(*x.shape[:-2], -1)


def lanes_of(design: LinearDesign, pairs: Eigen) -> Lanes:
    """Designs as the kernel takes them: batch last."""
    last = partial(jax.tree.map, lambda x: jnp.moveaxis(x, 0, -1))
    system = design.system
    return Lanes(
        modes_of(pairs),
        last(design.signals),
        *last((system.direct, system.rate, design.preload, design.friction)),
    )


def _grouped(x):
    """(..., B) as groups of lanes, (groups, ..., lanes)."""
    return jnp.moveaxis(x.reshape(*x.shape[:-1], -1, LANES), -2, 0)
