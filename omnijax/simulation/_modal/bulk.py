"""Figures of many designs by the modal core: programs depend on kinds of input alone."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from ..._compiling import Effort
from ..._programs import kept
from ..._root import root
from ._long_run import LongRunTable, longest_period, outputs_asked, rows_asked, steady_of
from ._poles import Answer, Coincidence, answered
from ._transient import peak_sums, samples_of, slopes_of, sums_along
from .batch import for_tables, ready
from .gradient import half_root
from .groups import of_groups
from .lanes import Lanes
from .obstacles import BULK_METRICS, figures_obstacle, modal_steady_obstacle
from .system import OUTPUTS, Layout, LinearDesign, Operating

MARGINS = 2  # normal force and grip, the last ones of the figures
# XLA's best code of their gradients is slower: Atlas 205 us a design for 111, tripod 248 for 168,
# compiled in 60 s for 45
STEADY_GRADIENTS = Effort.QUICK


class ModalFigures(NamedTuple):
    """Figures of a batch, and what says how a run would have ended."""

    values: Float[np.ndarray, "B m"]
    slopes: Float[np.ndarray, "B m d"] | None
    normal: Float[np.ndarray, " B"]  # N, of the least normal force a bound of the same sign
    slip: Float[np.ndarray, " B"]  # N, the same of the least mu N - |f|; without lift-off
    held: Bool[np.ndarray, " B"]  # whether the wheels hold the sphere


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
    Raises `ValueError` where `figures_obstacle` names a reason.
    """
    every, count = jnp.asarray(step, float), jnp.asarray(round(duration / step) + 1, float)

    def figures(design: LinearDesign, layout: Layout, effort: Effort):
        return _figures(design, layout, every, count, gradient, effort=effort)

    why = partial(figures_obstacle, metrics=metrics)
    both = _batches(make, rows, model, gradient, why, figures, total)
    chosen = [BULK_METRICS.index(name) for name in metrics]
    slopes = None if both.slopes is None else both.slopes[:, chosen]
    return both._replace(values=both.values[:, chosen], slopes=slopes)


def modal_steady(
    make: Callable[[Array], Operating],
    rows: Float[Array | np.ndarray, "B d"],
    table: LongRunTable,
    *,
    model: str = "coupled",
    gradient: bool = False,
    total: int = 0,
) -> ModalFigures:
    """The table's metrics of the long run of the designs `make(row)`.

    RMS in closed form, suprema and margins refined to 1e-6 or better; else as `modal_figures`.
    Raises `ValueError` where `modal_steady_obstacle` names a reason.
    """

    def figures(design: LinearDesign, layout: Layout, effort: Effort):
        few = effort == Effort.LEAST
        layout = layout._replace(rows=rows_asked(table, layout), short=few)
        effort = for_tables(effort) if layout.tables else effort
        return _long_run(design, layout, table, gradient, effort=effort)

    return _batches(
        make, rows, model, gradient, modal_steady_obstacle, figures, total, outputs_asked(table),
        STEADY_GRADIENTS if gradient else Effort.MOST,
    )  # fmt: skip


def _batches(
    make, rows, model: str, gradient: bool, obstacle, figures, total: int,
    outputs: tuple[str, ...] = OUTPUTS, most: Effort = Effort.MOST,
) -> ModalFigures:  # fmt: skip
    """`figures(design, layout, effort)` of all designs, batch by batch."""
    parts, slopes = [], []
    for batch in ready(make, rows, model, obstacle, total, outputs, most):

        def ask(design: LinearDesign, _, batch=batch) -> tuple[Answer, Coincidence]:
            values, bars, at = figures(design, batch.layout, batch.effort)
            return Answer((values[:-MARGINS], bars), values[-MARGINS:]), at

        (values, bars), margins = answered(ask, batch.design, batch.layout, batch.count, 1)
        parts.append(np.concatenate([values, margins, batch.held()[None]]))
        if gradient:
            slopes.append(batch.back(bars))
    *values, normal, slip, holds = np.concatenate(parts, axis=1)[:, : len(rows)]
    return ModalFigures(
        np.stack(values, axis=1),
        np.concatenate(slopes, axis=1)[:, : len(rows)].swapaxes(0, 1) if gradient else None,
        normal,
        slip,
        holds > 0,
    )


@kept
def _figures(design: LinearDesign, layout: Layout, step, count, gradient: bool):
    """(4, B): figures and margins; derivatives by systems and signals, one entry a metric; and what
    coincides.
    """

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

    return of_groups(some, design, layout, step * count, duration=step * count)


@kept
def _long_run(design: LinearDesign, layout: Layout, table: LongRunTable, gradient: bool):
    """(m + 2, B): the table's metrics and margins of the long run; derivatives; and what
    coincides.
    """
    span = longest_period(design.signals, layout) if gradient else None
    return of_groups(lambda g: steady_of(g, layout, table, gradient), design, layout, span)
