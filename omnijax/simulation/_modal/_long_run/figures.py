"""What a table of metrics asks of the long run, and all of it for a group of designs.

`SteadyFigures` answers as `LongRun` and its kind do; which figures a table asks for is found by
asking it once.
"""

import functools
import itertools
import operator
from collections.abc import Callable
from typing import NamedTuple, Protocol, runtime_checkable

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from ...._root import root
from ..._exact import ACCELERATIONS
from .._poles import grows
from ..arithmetic import materialised
from ..gradient import Slopes, half_root
from ..lanes import Lanes
from ..system import OUTPUTS, UPRIGHT, Layout
from .curves import rows_shown
from .ends import ends_of, with_grip
from .filtered import FilterPoles, filtered_slopes, filtered_squares
from .margins import steady_margins
from .mean import mean_slopes, mean_squares, means_of
from .phases import Phases, Spot, phases_of
from .spots import AtSpots, spot_slopes, together
from .supremum import is_straight, suprema


class AskedFigure(NamedTuple):
    """A figure, by the name of what gives it, of an output."""

    figure: str
    output: str = ""


class SteadyFigures:
    """Figures of one long run, each got from `figure(asked)`."""

    def __init__(self, figure: Callable[[AskedFigure], Array]):
        self._figure = figure

    def mean_square(self, name: str) -> Float[Array, " o"]:
        """Mean square of each component, over all phases."""
        return self._figure(AskedFigure("mean_square", name))

    def extremes(self, name: str) -> Float[Array, "2 o"]:
        """Largest value of each component, and of its negative."""
        return self._figure(AskedFigure("extremes", name))

    def suprema(self, *names: str) -> list[Float[Array, ""]]:
        """Largest length of outputs that are vectors, each by itself."""
        return [self._figure(AskedFigure("supremum", name)) for name in names]

    def least_normal_force(self) -> Float[Array, " n"]:
        """Least normal force of each contact, N."""
        return self._figure(AskedFigure("least_normal_force"))

    def slip_margin(self) -> Float[Array, " n"]:
        """Least mu N - |f| of each contact, N."""
        return self._figure(AskedFigure("slip_margin"))

    def weighted(self) -> Float[Array, ""]:
        """RMS of the sphere's acceleration behind the filters of the table, m/s^2."""
        return root(jnp.sum(self._figure(AskedFigure("filtered", UPRIGHT))))


@runtime_checkable
class LongRunTable(Protocol):
    """Metrics of a long run; a pytree, whose classes belong to this package."""

    names: tuple[str, ...]
    filters: FilterPoles | None  # of what `SteadyFigures.weighted` is behind

    def metric(self, name: str, run: SteadyFigures) -> Float[Array, ""]:
        """The metric of that name."""
        ...


FORCES = ("least_normal_force", "slip_margin")


def _shape(asked: AskedFigure, wheels: int) -> tuple[int, ...]:
    forces = dict.fromkeys(FORCES, (wheels,))
    return ({"extremes": (2, 3), "supremum": ()} | forces).get(asked.figure, (3,))


def asked_by(table: LongRunTable, wheels: int) -> list[tuple[AskedFigure, ...]]:
    """What each metric of the table asks for."""

    def asked(name: str) -> tuple[AskedFigure, ...]:
        every: dict[AskedFigure, None] = {}

        def figure(asked: AskedFigure):
            every[asked] = None
            return jnp.zeros(_shape(asked, wheels))

        jax.eval_shape(lambda: table.metric(name, SteadyFigures(figure)))
        return tuple(every)

    return [asked(name) for name in table.names]


def outputs_asked(table: LongRunTable) -> tuple[str, ...]:
    """Outputs that the designs have to show, of rigs of any size."""
    own = (one.output for asked in asked_by(table, 1) for one in asked if one.output)
    return tuple(dict.fromkeys((*OUTPUTS, *own)))


def rows_asked(table: LongRunTable, layout: Layout) -> int:
    """How many rows of the outputs figures are made of, the first ones."""
    every = {one for asked in asked_by(table, layout.wheels) for one in asked}
    if all(one.output == "dR" for one in every):
        return len(layout.place("dR"))
    return len(layout.live)


class _Piece(NamedTuple):
    """Figures (f) that come together, and derivatives of their sums times (m, f, c)."""

    figures: list[AskedFigure]
    value: Float[Array, "f c"]
    slopes: Callable[[Float[Array, "m f c"]], Slopes]


def steady_of(
    g: Lanes, layout: Layout, table: LongRunTable, gradient: bool
) -> tuple[Float[Array, "figures c"], Slopes | None]:
    """The table's metrics, normal force and grip; derivatives of the metrics, stacked."""
    by_metric = asked_by(table, layout.wheels)
    asked = {one for asked in by_metric for one in asked}
    pieces, margins = _pieces(g, layout, table, asked, gradient)
    names = [one for piece in pieces for one in piece.figures]
    shapes = [_shape(one, layout.wheels) for one in names]
    ends = np.cumsum([0, *(int(np.prod(shape)) for shape in shapes)]).tolist()

    def read(figures: Float[Array, " f"]) -> Float[Array, " m"]:
        parts = jnp.split(figures, ends[1:-1])
        known = {n: x.reshape(s) for n, x, s in zip(names, parts, shapes, strict=True)}
        run = SteadyFigures(known.__getitem__)
        return jnp.stack([table.metric(name, run) for name in table.names])

    every = jnp.concatenate([piece.value for piece in pieces])
    values = jax.vmap(read, in_axes=-1, out_axes=-1)(every)
    values = jnp.where(grows(g.modes), jnp.nan, values)  # there is no long run
    values = jnp.concatenate([values, jnp.stack(margins)])
    values = jnp.where(_numbers((g.modes, g.direct, g.slope, g.signals)), values, jnp.nan)
    if not gradient:
        return values, None
    by = jax.vmap(jax.jacrev(read), in_axes=-1, out_axes=-1)(every)  # (m, f, c)
    slopes, first = [], 0
    for piece in pieces:
        own = [m for m, asked in enumerate(by_metric) if {*asked} & {*piece.figures}]
        part = slice(first, first + len(piece.value))
        slopes.append(_placed(piece.slopes(by[np.array(own), part]), own, len(by_metric)))
        first = part.stop
    return values, jax.tree.map(_added, *slopes, is_leaf=lambda x: x is None)


def _numbers(parts) -> Bool[Array, " c"]:
    """Of which designs all arrays, batch last, hold finite numbers."""
    each = (jnp.isfinite(x).reshape(-1, x.shape[-1]).all(axis=0) for x in jax.tree.leaves(parts))
    return functools.reduce(operator.and_, each)


def _placed(slopes: Slopes, numbers: list[int], count: int) -> Slopes:
    """Slopes of all metrics from those of some."""
    if len(numbers) == count:
        return slopes
    at = np.array(numbers)
    return jax.tree.map(lambda x: jnp.zeros((count, *x.shape[1:])).at[at].set(x), slopes)


def _added(*parts: Array | None) -> Array | None:
    """The sum of those that are there."""
    return functools.reduce(lambda x, y: y if x is None else x if y is None else x + y, parts)


def _pieces(
    g: Lanes, layout: Layout, table: LongRunTable, asked: set[AskedFigure], gradient: bool
) -> tuple[list[_Piece], tuple[Array, Array]]:
    """All figures asked for; and the least margins, or bounds of the same signs."""
    of = {
        figure: sorted(one for one in asked if one.figure == figure)
        for figure in ("mean_square", "filtered", "extremes", "supremum", *FORCES)
    }
    pieces = []
    for rates in (False, True):
        some = [one for one in of["mean_square"] if (one.output in ACCELERATIONS) == rates]
        if some:
            pieces.append(_mean_piece(g, layout, some, rates, gradient))
    if of["filtered"]:
        assert table.filters is not None
        pieces.append(_filtered_piece(g, layout, of["filtered"], table.filters, gradient))
    reached = _lengths(g, layout, of["extremes"], of["supremum"])
    margins = None
    if any(of[name] for name in FORCES):
        margins = _margins(g, layout)
        reached |= margins
    if reached:
        pieces.append(_spot_piece(g, layout, reached))
    if margins is None:
        return pieces, steady_margins(g, layout)
    least = tuple(jnp.min(margins[AskedFigure(name)].value, axis=0) for name in FORCES)
    return pieces, (least[0], least[1])


def _rows(layout: Layout, asked: list[AskedFigure]) -> np.ndarray:
    return np.concatenate([layout.place(one.output) for one in asked])


def _mean_piece(
    g: Lanes, layout: Layout, asked: list[AskedFigure], rates: bool, gradient: bool
) -> _Piece:
    """Of outputs that show nothing of drho/dt, or, by `rates`, of accelerations."""
    rows = _rows(layout, asked)
    means = means_of(g, layout, rates, gradient)
    mean = mean_squares(g, layout, rows, means)
    return _Piece(asked, mean.value, lambda by: mean_slopes(g, layout, rows, means, mean, by))


def _filtered_piece(
    g: Lanes, layout: Layout, asked: list[AskedFigure], filters: FilterPoles, gradient: bool
) -> _Piece:
    rows = _rows(layout, asked)
    means = means_of(g, layout, False, gradient, filters.pairs(g.modes))
    mean = mean_squares(g, layout, rows, means)
    behind = filtered_squares(mean, filters)

    def slopes(by):
        return filtered_slopes(g, layout, rows, means, mean, behind, filters, by)

    return _Piece(asked, behind.value, slopes)


def _on(rows: np.ndarray, layout: Layout, weight: Float[Array, "f r c"]) -> Float[Array, "f o c"]:
    """Weights of all outputs that figures are made of."""
    return jnp.zeros((len(weight), layout.rows, weight.shape[-1])).at[:, rows].set(weight)


def _lengths(
    g: Lanes, layout: Layout, extremes: list[AskedFigure], lengths: list[AskedFigure]
) -> dict[AskedFigure, AtSpots]:
    """The extremes of components, and the greatest lengths of vectors."""
    straight = [one for one in lengths if is_straight(layout, layout.place(one.output))]
    others = [one for one in lengths if one not in straight]
    reached: dict[AskedFigure, AtSpots] = {}
    tops = suprema(g, layout, [layout.place(one.output) for one in others])
    for one, top in zip(others, tops, strict=True):
        spots = jax.tree.map(lambda x: x[None], top.spots)
        reached[one] = _length(layout, layout.place(one.output), top.total, spots)
    outputs = list(dict.fromkeys(one.output for one in (*extremes, *straight)))
    if not outputs:
        return reached
    rows = [layout.place(output) for output in outputs]
    ends = ends_of(g, layout, np.concatenate(rows).tolist(), (1.0, -1.0))
    for i, (output, own) in enumerate(zip(outputs, rows, strict=True)):
        part = slice(3 * i, 3 * i + 3)
        height, spots = jax.tree.map(lambda x, part=part: x[:, part], (ends.height, ends.spots))
        if AskedFigure("extremes", output) in extremes:
            one = jnp.broadcast_to(jnp.eye(3)[:, :, None], (3, 3, height.shape[-1]))
            flat, flat_spots = jax.tree.map(lambda x: x.reshape(-1, *x.shape[2:]), (height, spots))
            weight = _on(own, layout, jnp.concatenate([one, -one]))
            reached[AskedFigure("extremes", output)] = AtSpots(flat, weight, flat_spots)
        if AskedFigure("supremum", output) in straight:
            up = height[0] >= height[1]  # all phases of an axis at their largest, or smallest
            total = jnp.where(up, height[0], -height[1])
            chosen = [
                _of_axis(layout, phases, own, up, spot)
                for phases, spot in zip(phases_of(layout), spots, strict=True)
            ]
            reached[AskedFigure("supremum", output)] = _length(layout, own, total, chosen)
    return reached


def _of_axis(layout: Layout, phases: Phases, rows: np.ndarray, up, spot: Spot) -> Spot:
    """The spot (1, s, c) of each phase at the end of the axis that it moves, of (2, 3, s, c)."""
    moved = rows_shown(layout, phases, rows.tolist())
    axis = np.array([own[0] - rows[0] if own else 0 for own in moved])
    each = np.arange(len(axis))
    return jax.tree.map(
        lambda x: jnp.where(up[axis], x[0, axis, each], x[1, axis, each])[None], spot
    )


def _length(layout: Layout, rows: np.ndarray, total: Float[Array, "o c"], spots) -> AtSpots:
    """The length of a sum of outputs."""
    square = jnp.sum(total**2, axis=0)
    weight = 2 * half_root(square) * total
    return AtSpots(materialised(root, square)[None], _on(rows, layout, weight[None]), spots)


def _margins(g: Lanes, layout: Layout) -> dict[AskedFigure, AtSpots]:
    """Least normal force and grip of every wheel, N."""
    whole, shown, grips = with_grip(g, layout)
    n, normal, drive = layout.wheels, layout.place("normal_force"), layout.place("drive_force")
    ends = ends_of(whole, shown, [*normal.tolist(), *grips], (-1.0,))
    (height,), spots = ends.height, jax.tree.map(lambda x: x[0], ends.spots)
    own, pulled, pushed = (slice(k * n, k * n + n) for k in range(3))
    over = height[pulled] >= height[pushed]  # which sense of the drive force is the worse

    def worse(x):
        flag = over.reshape(n, *[1] * (x.ndim - 2), over.shape[-1])
        return jnp.where(flag, x[pulled], x[pushed])

    eye, mu = jnp.eye(n)[:, :, None], g.friction
    one = jnp.broadcast_to(eye, (n, n, mu.shape[-1]))
    weight = _on(normal, layout, eye * mu[:, None])
    grip = weight + _on(drive, layout, eye * jnp.where(over, -1.0, 1.0)[:, None])
    least = AtSpots(
        g.preload - height[own],
        _on(normal, layout, one),
        jax.tree.map(lambda x: x[own], spots),
    )
    slip = AtSpots(mu * g.preload - worse(height), grip, jax.tree.map(worse, spots))
    return {AskedFigure("least_normal_force"): least, AskedFigure("slip_margin"): slip}


def _spot_piece(g: Lanes, layout: Layout, reached: dict[AskedFigure, AtSpots]) -> _Piece:
    every = together([*reached.values()])
    ends = np.cumsum([0, *(len(x.value) for x in reached.values())]).tolist()
    part = {one: slice(*x) for one, x in zip(reached, itertools.pairwise(ends), strict=True)}

    def slopes(by):
        slopes, outputs = spot_slopes(g, layout, every, by)
        if AskedFigure(FORCES[0]) not in part:
            return slopes
        least, slip = (by[:, part[AskedFigure(name)]] for name in FORCES)  # (m, n, c)
        wheel, normal = np.arange(layout.wheels), layout.place("normal_force")
        force = g.preload + outputs[part[AskedFigure("slip_margin")]][wheel, normal]
        return slopes._replace(preload=least + g.friction * slip, friction=slip * force)

    return _Piece([*reached], every.value, slopes)
