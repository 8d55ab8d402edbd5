"""Figures of many designs by the modal core: programs depend on kinds of input alone."""

from collections.abc import Callable, Iterator, Sequence
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
from .._padding import room
from .blocks import LENGTH
from .decoupling import blocks_of, coupled, decoupled, turned_states
from .gradient import half_root, pull_back
from .mean_square import sums_along
from .output_sums import slopes_of
from .peak import peak_sums
from .phases import longest_period
from .poles import Eigen, eigen, modes_of
from .runs import RUN_OUTPUTS, output_rows, outputs_of, run_slopes
from .signals import series_needed
from .steady import steady_of
from .system import OUTPUTS, How, Layout, LinearDesign, Operating, designs_of
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


class _Batch(NamedTuple):
    """Designs that are ready to be asked; the last one fills up the batch."""

    make: Callable[[Array], Operating]
    rows: Float[Array, "B d"]
    count: int  # designs that are wanted
    points: Operating  # without names and laws that do not enter
    how: How
    design: LinearDesign
    layout: Layout
    turn: np.ndarray | None
    effort: Effort

    def held(self) -> Float[np.ndarray, " B"]:
        """Whether the wheels hold the sphere."""
        return np.asarray(_held(self.points.rig, self.how.model, effort=self.effort))

    def back(self, bars, rig: Rig | None = None) -> Float[np.ndarray, "m B d"]:
        """Derivatives by the rows from those by systems and signals, and by the rigs themselves."""
        at = _from_designs(self.points, bars, self.how, self.turn, effort=self.effort)
        if rig is not None:
            own = jax.tree.map(lambda x: x[None], eqx.filter(rig, eqx.is_inexact_array))
            at = at._replace(rig=jax.tree.map(jnp.add, at.rig, own))
        return np.asarray(_from_points(self.make, self.rows, at))


def _ready(
    make, rows, size: int, model: str, obstacle: Callable[[Rig, str], str | None], total: int,
    outputs: tuple[str, ...] = OUTPUTS,
) -> Iterator[_Batch]:  # fmt: skip
    """The designs `make(row)`, `size` of them at a time."""
    effort, turn = effort_for(max(len(rows), total)), None
    rows = np.asarray(rows, float)  # slices of jax's arrays are programs
    for i in range(0, len(rows), size):
        some = rows[i : i + size]
        count = len(some)
        some = jnp.asarray(np.concatenate([some, np.repeat(some[-1:], size - count, axis=0)]))
        points = _points(make, some)
        if i == 0:
            reason = obstacle(_one(points.rig), model)
            if reason is not None:
                raise ValueError(f"no figures from the modal form: {reason}.")
        force, series = bool(np.any(np.asarray(points.force))), _series(points.rig)
        plain, how = _plain(points), How(model, force, series, outputs)
        design, layout, turn = _apart(plain, turn, how, effort)
        layout = layout._replace(together=TOGETHER[effort])
        yield _Batch(make, some, count, plain, how, design, layout, turn, effort)


def _size(rows) -> int:
    """Designs a batch."""
    return SIZES[0] if len(rows) <= SIZES[0] else SIZES[-1]


def _batches(
    make, rows, metrics, model: str, gradient: bool, obstacle, figures, total: int
) -> ModalFigures:
    """`figures(design, layout, effort)` of all designs, batch by batch."""
    parts, slopes = [], []
    why = partial(obstacle, metrics=metrics)
    for batch in _ready(make, rows, _size(rows), model, why, total):
        values, bars = figures(batch.design, batch.layout, batch.effort)
        parts.append(np.concatenate([values, batch.held()[None]]))
        if gradient:
            slopes.append(batch.back(bars))
    rms, peak, normal, slip, holds = np.concatenate(parts, axis=1)[:, : len(rows)]
    values, chosen = {"rms": rms, "peak": peak}, [BULK_METRICS.index(name) for name in metrics]
    return ModalFigures(
        np.stack([values[name] for name in metrics], axis=1),
        np.concatenate(slopes, axis=1)[chosen, : len(rows)].swapaxes(0, 1) if gradient else None,
        normal,
        slip,
        holds > 0,
    )


class RunGroup(NamedTuple):
    """Outputs of a group of runs at t = 0, step, ..., and the rigs."""

    outputs: Float[Array, "c o length"]  # `RUN_OUTPUTS`; what follows the samples means nothing
    rigs: Rig  # without names and laws that do not enter; one leading axis
    wanted: int  # of these runs; the others fill up the group
    design: LinearDesign


class ModalRuns:
    """Some designs' runs, group by group, and the way back from derivatives of what they show."""

    def __init__(self, batch: _Batch, step: Array, samples: int):
        layout = batch.layout._replace(rows=batch.design.system.C.shape[1])
        self._batch = batch._replace(layout=layout)
        self.step, self.samples, self.size = step, samples, batch.count
        self.effort = batch.effort  # what programs of all designs are worth to the compiler
        self._given = layout, step, jnp.asarray(samples, float)

    def __iter__(self) -> Iterator[RunGroup]:
        """The groups that hold wanted designs."""
        b, length = self._batch, room(self.samples + LENGTH, 4)
        for first in range(0, b.count, LANES):
            part = slice(first, first + LANES)
            design, rigs = jax.tree.map(
                lambda x, s=part: np.asarray(x)[s], (b.design, b.points.rig)
            )
            outputs = _outputs(design, *self._given, length, effort=b.effort)
            yield RunGroup(outputs, rigs, min(b.count - first, LANES), design)

    def held(self) -> Float[np.ndarray, " B"]:
        """Whether the wheels hold the sphere, of the wanted designs."""
        return self._batch.held()[: self.size]

    def bars(self, group: RunGroup, weights: Float[Array, "c o length"]) -> Any:
        """Derivatives by systems and signals from those by the outputs of a group.

        Only outputs that move the figure in any run are asked.
        """
        layout, *samples = self._given
        moving, every = np.asarray(_moving(weights)), np.arange(layout.rows)
        parts = [every[rows] for rows in output_rows(layout.wheels).values()]
        rows = np.concatenate([part for part in parts if moving[part].any()] or parts[:1])
        few = layout._replace(
            rows=len(rows),
            live=tuple(layout.live[row] for row in rows),
            waves=tuple(layout.waves[row] for row in rows),
        )
        s = group.design.system
        part = s._replace(C=s.C[:, rows], direct=s.direct[:, :, rows], rate=s.rate[:, :, rows])
        system, signals = _run_slopes(
            group.design._replace(system=part), few, *samples, np.asarray(weights)[:, rows],
            effort=self.effort,
        )  # fmt: skip

        def placed(x, axis: int) -> np.ndarray:
            whole = np.zeros(np.insert(np.delete(x.shape, axis), axis, layout.rows))
            np.moveaxis(whole, axis, 0)[rows] = np.moveaxis(np.asarray(x), axis, 0)
            return whole

        system = system._replace(
            C=placed(system.C, 2), direct=placed(system.direct, 3), rate=placed(system.rate, 3)
        )
        return system, signals

    def slopes(self, bars: list, rigs: list[Rig]) -> Float[np.ndarray, "B d"]:
        """Derivatives by the wanted rows from `bars` of all groups and those by the rigs."""
        missing = len(self._batch.rows) // LANES - len(bars)

        def joined(parts: list, axis: int):
            every = [*parts, *[parts[-1]] * missing]
            return jax.tree.map(lambda *xs: np.concatenate(xs, axis=axis), *every)

        return self._batch.back(joined(bars, 1), joined(rigs, 0))[0, : self.size]


def modal_runs(
    make: Callable[[Array], Operating],
    rows: Float[Array | np.ndarray, "B d"],
    *,
    duration: float,
    step: float,
    model: str = "coupled",
    total: int = 0,
) -> Iterator[ModalRuns]:
    """Runs of the designs `make(row)`, some of them at a time, for whatever is read from a run.

    As `modal_figures`.
    """
    samples, every = round(duration / step) + 1, jnp.asarray(step, float)
    for batch in _ready(make, rows, _size(rows), model, modal_obstacle, total, RUN_OUTPUTS):
        yield ModalRuns(batch, every, samples)


def _apart(points: Operating, turn: np.ndarray | None, how: How, effort: Effort):
    """Designs with their states along directions that decouple them, where any do, and those.

    `turn`: the directions of the batch before, which mostly do for this one too.
    """
    design, layout = _designs(points, how, turn, effort=effort)
    coupling = coupled(design.system)
    if turn is not None and len(blocks_of(coupling)) == 1:
        design, turn = _designs(points, how, effort=effort)[0], None
        coupling = coupled(design.system)
    if turn is None and len(blocks_of(coupling)) == 1:
        turn = turned_states(points.rig, design.system)
        if turn is not None:
            design, layout = _designs(points, how, turn, effort=effort)
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
def _designs(points: Operating, how: How, turn: Any = None) -> tuple[LinearDesign, Layout]:
    return designs_of(points, how, turn)


@kept
def _from_designs(points: Operating, bars, how: How, turn: Any = None) -> Operating:
    """Derivatives by every number of the points, one entry a metric, from those by the designs."""
    moving, still = eqx.partition(points, eqx.is_inexact_array)

    def designs(moving):
        design = designs_of(eqx.combine(moving, still), how, turn)[0]
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
        also = sums_along(g, layout, step) if gradient else None
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


@jax.jit
def _moving(weights):
    """Which outputs any run's figure depends on, (o,)."""
    return jnp.any(weights != 0, axis=(0, 2))


@kept
def _outputs(design: LinearDesign, layout: Layout, step, count, length: int):
    """(B, o, length): the outputs at the samples, and room for a block after them."""
    groups = jax.tree.map(_grouped, lanes_of(design, eigen(design.system, layout)))
    runs = jax.lax.map(lambda g: outputs_of(g, layout, step, count, length), groups)
    return runs.reshape(-1, *runs.shape[2:])


@kept
def _run_slopes(design: LinearDesign, layout: Layout, step, count, weights):
    """Derivatives by systems and signals from those by the outputs, (B, o, length)."""

    def some(g: Lanes, weights):
        slopes = run_slopes(g, layout, step, count, weights)
        return None, jax.tree.map(lambda x: x[None], slopes)

    groups = weights.reshape(-1, LANES, *weights.shape[1:])
    return _of_groups(some, design, layout, step * count, groups)[1]


def _of_groups(some: Callable, design: LinearDesign, layout: Layout, span, *more):
    """Figures of `some(lanes)` for all designs, and what its slopes give by systems and signals.

    `span` (s): over which two poles are as good as equal or not.  `some` takes `more` of each group
    too, which leads its arrays.
    """
    pairs = eigen(design.system, layout)
    last = jax.tree.map(lambda x: jnp.moveaxis(x, 0, -1), pairs)
    groups = jax.tree.map(_grouped, (lanes_of(design, pairs), last))

    def one(group: tuple[tuple[Lanes, Eigen], Any]):
        values, slopes = some(group[0][0], *group[1])
        if slopes is None:
            return values, None
        system = jax.lax.map(lambda slope: pull_back(*group[0], slope, layout, span), slopes)
        return values, (system, slopes.signals)

    values, bars = jax.lax.map(one, (groups, more))
    bars = jax.tree.map(lambda x: jnp.moveaxis(_flat(x), -1, 1), bars)
    return jax.tree.map(_flat, values), bars


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
