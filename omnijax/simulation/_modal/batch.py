"""Designs made ready for the modal core, and the way from their derivatives back to the rows."""

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from ..._arrays import on_device
from ..._compiling import Effort, on_cpu
from ..._programs import kept
from ...dynamics import held
from ...laws import Rollers, TableShape
from ...rig import Placed, Rig
from ._poles import blocks_of, coupled, decoupled, turned_states
from .lanes import LANES
from .signals import series_needed
from .system import OUTPUTS, How, Layout, LinearDesign, Operating, design_of, designs_of
from .table_signals import with_room

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


def for_tables(effort: Effort) -> Effort:
    """What the programs of tables are worth: the slowest code takes ten times as long."""
    return max(effort, Effort.QUICK)


SIZES = (LANES, 16 * LANES)  # designs a call of the compiled programs
WIDE = (128 * LANES, 512 * LANES)  # beside these where all go in step, as on a GPU
BACK = 128  # designs whose matrices' derivatives are worked out together: more leave the cache
# whose laws enter the linear model and what it moves by
_PORTS = ("radius", "shape", "contact", "mount", "platform", "kinematics")


class DesignBatch(NamedTuple):
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

    def held(self) -> Bool[np.ndarray, " B"]:
        """Whether the wheels hold the sphere."""
        return np.asarray(_held(self.points.rig, self.how.model, effort=self.effort))

    def back(self, bars: LinearDesign, rig: Rig | None = None) -> Float[np.ndarray, "m B d"]:
        """Derivatives by the rows from those by the designs' arrays, and by the rigs themselves."""
        at = _from_designs(self.points, bars, self.how, self.turn, effort=self.effort)
        if rig is not None:
            own = jax.tree.map(lambda x: x[None], eqx.filter(rig, eqx.is_inexact_array))
            at = at._replace(rig=jax.tree.map(jnp.add, at.rig, own))
        return np.asarray(_from_points(self.make, self.rows, at))


def ready(
    make, rows, model: str, obstacle: Callable[[Rig, str], str | None], total: int,
    outputs: tuple[str, ...] = OUTPUTS, most: Effort = Effort.MOST,
) -> Iterator[DesignBatch]:  # fmt: skip
    """The designs `make(row)`, some of them at a time; `outputs` are what they show.

    Their programs are worth `most` to the compiler, however many there are.
    Raises `ValueError` where the `obstacle` names a reason.
    """
    effort, turn = min(effort_for(max(len(rows), total)), most), None
    size = _size(len(rows), effort)
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
        layout = layout._replace(
            together=TOGETHER[effort], in_step=effort == Effort.MOST or not on_cpu()
        )
        yield DesignBatch(make, some, count, plain, how, design, layout, turn, effort)


def _size(designs: int, effort: Effort) -> int:
    """Designs a call."""
    if on_cpu() and effort == Effort.LEAST:
        return SIZES[0]  # another size is another program to compile
    sizes = SIZES if on_cpu() else (*SIZES, *WIDE)
    return next((size for size in sizes if designs <= size), sizes[-1])


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
    shown = design.system
    if np.any(still := _always_at_rest(points)):  # what they would drive is part of the program
        moved = points._replace(speeds=on_device(np.where(still, 1.0, points.speeds)))
        shown = _designs(moved, how, turn, effort=effort)[0].system
    return design, decoupled(shown, layout, coupling), turn


def _always_at_rest(points: Operating) -> Bool[np.ndarray, " n"]:
    """Which wheels stand still in every design."""
    return np.all(np.asarray(points.speeds) == 0, axis=0)


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
    """The points without names and laws that do not enter, with room for more knots of tables, so
    that rigs share their programs.
    """
    rig = points.rig
    effects = tuple(
        Placed(placed.law, "", placed.wheels) for placed in rig.effects if placed.law.port in _PORTS
    )
    names = tuple(str(i) for i in range(rig.size))
    profiles = tuple(with_room(p) if isinstance(p, TableShape) else p for p in rig.profiles)
    plain = Rig(rig.sphere, rig.platform, rig.wheels, profiles, effects, names)
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

    def one(point_and_bars):
        point, bars = point_and_bars
        moving, still = eqx.partition(point, eqx.is_inexact_array)
        back = jax.vjp(lambda x: design_of(eqx.combine(x, still), how, turn)[0], moving)[1]
        return jax.vmap(lambda bar: back(bar)[0])(bars)

    bars = jax.tree.map(lambda x: jnp.moveaxis(x, 0, 1), bars)
    each = jax.lax.map(one, (points, bars), batch_size=BACK if on_cpu() else len(points.speeds))
    return jax.tree.map(lambda x: jnp.moveaxis(x, 1, 0), each)


@eqx.filter_jit
def _from_points(make, rows, bars: Operating):
    """Derivatives (metrics, B, d) by the rows from those by the plain points."""

    def plain(row) -> Operating:
        return _plain(make(row))

    back = jax.vjp(jax.vmap(plain), rows)[1]
    return jax.vmap(lambda bar: back(bar)[0])(bars)
