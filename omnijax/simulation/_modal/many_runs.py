"""Runs of many designs for whatever is read from their samples."""

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from ..._compiling import Effort
from ..._programs import kept
from ...rig import Rig
from .._padding import room
from ._poles import Answer, answered, coincidence, eigen
from ._tables import (
    TableLanes,
    TableSums,
    table_lanes,
    table_outputs,
    table_slopes,
    table_sums,
)
from ._transient import LENGTH
from .batch import DesignBatch, for_tables, ready
from .groups import grouped, lanes_of, of_groups
from .lanes import LANES, Lanes
from .obstacles import modal_obstacle
from .runs import RUN_OUTPUTS, outputs_of, run_slopes
from .system import Layout, LinearDesign, Operating, output_rows

SHORT = 2048  # samples of short runs: 22 MB of 64 designs with three wheels


class RunGroup(NamedTuple):
    """Outputs of a group of runs at t = 0, step, ..., and the rigs."""

    # `RUN_OUTPUTS`; what follows the samples means nothing
    outputs: Float[Array | np.ndarray, "c o length"]
    rigs: Rig  # without names and laws that do not enter; one leading axis
    wanted: int  # of these runs; the others fill up the group
    design: LinearDesign


class ModalRuns:
    """Some designs' runs, group by group, and the way back from derivatives of what they show."""

    def __init__(self, batch: DesignBatch, step: Array, samples: int):
        layout = batch.layout._replace(rows=batch.design.system.C.shape[1])
        self._batch = batch._replace(layout=layout)
        self.step, self.samples, self.size = step, samples, batch.count
        self.effort = batch.effort  # what programs of all designs are worth to the compiler
        self._given = layout, step, jnp.asarray(samples, float)
        self._known: tuple[LinearDesign, Any] | None = None

    def __iter__(self) -> Iterator[RunGroup]:
        """The groups that hold wanted designs."""
        b, length = self._batch, self._length()
        for first in range(0, b.count, LANES):
            part = slice(first, first + LANES)
            design, rigs = jax.tree.map(
                lambda x, s=part: np.asarray(x)[s], (b.design, b.points.rig)
            )
            wanted = min(b.count - first, LANES)

            def ask(design: LinearDesign, _):
                plain = _without_tables(design)
                outputs, at = _outputs(plain, *self._given, length, effort=b.effort)
                if b.layout.tables:
                    lanes, _ = self._lanes_of(design)
                    outputs = _with_tables(outputs, lanes, *self._given, effort=self._for_tables)
                return Answer(outputs), at

            outputs = answered(ask, design, b.layout, wanted, 0).smooth
            yield RunGroup(outputs, rigs, wanted, design)

    def _length(self) -> int:
        """Room for the samples and a block; of few designs one length for all short runs.

        Each length is a program, which costs more than the room that few designs leave empty.
        """
        samples = self.samples + LENGTH
        tables = self._batch.layout.tables  # each sample of which costs more
        few = self.effort == Effort.LEAST and samples <= SHORT and not tables
        return SHORT if few else room(samples, 4)

    @property
    def _for_tables(self) -> Effort:
        return for_tables(self.effort)

    def held(self) -> Bool[np.ndarray, " B"]:
        """Whether the wheels hold the sphere, of the wanted designs."""
        return self._batch.held()[: self.size]

    def bars(self, group: RunGroup, weights: Float[Array, "c o length"]) -> LinearDesign:
        """Derivatives by the designs' arrays from those by the outputs of a group.

        Only outputs that move the figure in any run are asked.
        """
        layout, *samples = self._given
        moving, every = np.asarray(_moving(weights)), np.arange(layout.rows)
        parts = [every[rows] for rows in output_rows(RUN_OUTPUTS, layout.wheels).values()]
        rows = np.concatenate([part for part in parts if moving[part].any()] or parts[:1])
        few = layout._replace(
            rows=len(rows),
            tables=(),
            tabled=(),
            live=tuple(layout.live[row] for row in rows),
            waves=tuple(layout.waves[row] for row in rows),
        )
        s = group.design.system
        part = s._replace(C=s.C[:, rows], direct=s.direct[:, :, rows], rate=s.rate[:, :, rows])
        given = np.asarray(weights)[:, rows]

        def ask(design: LinearDesign, numbers):
            plain = _without_tables(design)
            bars, at = _run_slopes(plain, few, *samples, given[numbers], effort=self.effort)
            return Answer(bars), at

        bars = answered(ask, group.design._replace(system=part), few, group.wanted, 1).smooth

        def placed(x, axis: int) -> np.ndarray:
            whole = np.zeros(np.insert(np.delete(x.shape, axis), axis, layout.rows))
            np.moveaxis(whole, axis, 0)[rows] = np.moveaxis(np.asarray(x), axis, 0)
            return whole

        system = bars.system
        C, direct, rate = placed(system.C, 2), placed(system.direct, 3), placed(system.rate, 3)
        bars = bars._replace(system=system._replace(C=C, direct=direct, rate=rate))
        if not layout.tables:
            return bars
        also = self._table_bars(group, np.asarray(weights))
        every = jax.tree.map(np.add, bars, _without_tables(also))
        return every._replace(signals=every.signals._replace(tables=also.signals.tables))

    def _lanes_of(self, design: LinearDesign):
        """What tables need to know of designs, and what coincides: once for all metrics."""
        if self._known is None or self._known[0] is not design:
            self._known = design, _table_lanes(design, *self._given, effort=self.effort)
        return self._known[1]

    def _table_bars(self, group: RunGroup, weights: Float[np.ndarray, "c o length"]):
        """What tables add to `bars`; one program serves all figures."""
        layout, *samples = self._given
        alone, told = layout._replace(kinds=()), {"effort": self.effort}

        def ask(design: LinearDesign, numbers):
            lanes, at = self._lanes_of(design)
            sums = _table_sums(lanes, alone, *samples, weights[numbers], effort=self._for_tables)
            return Answer(_table_slopes(design, alone, *samples, sums, **told)), at

        return answered(ask, group.design, layout, group.wanted, 1).smooth

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
    for batch in ready(make, rows, model, modal_obstacle, total, RUN_OUTPUTS):
        yield ModalRuns(batch, every, samples)


def _without_tables(design: LinearDesign) -> LinearDesign:
    """The design, or derivatives by one, without its tables, on whose sizes programs depend."""
    return design._replace(signals=design.signals._replace(tables=None))


@jax.jit
def _moving(weights):
    """Which outputs any run's figure depends on, (o,)."""
    return jnp.any(weights != 0, axis=(0, 2))


@kept
def _outputs(design: LinearDesign, layout: Layout, step, count, length: int):
    """(B, o, length): the outputs at the samples, and room for a block after them; and what
    coincides.
    """
    pairs = eigen(design.system, layout)
    groups = jax.tree.map(grouped, lanes_of(design, pairs))
    runs = jax.lax.map(lambda g: outputs_of(g, layout, step, count, length), groups)
    at = coincidence(pairs, design.signals.rate, step * count)
    return runs.reshape(-1, *runs.shape[2:]), at


@kept
def _table_lanes(design: LinearDesign, layout: Layout, step, count):
    """What tables need to know of the designs; and what coincides."""
    pairs = eigen(design.system, layout)
    at = coincidence(pairs, design.signals.rate, step * count)
    return table_lanes(lanes_of(design, pairs), layout), at


@kept
def _with_tables(outputs, lanes: TableLanes, layout: Layout, step, count):
    """The outputs with what tables add to them."""
    return outputs + table_outputs(lanes, layout, _times(outputs, step, count))


def _times(outputs, step, count):
    """Of the samples, s; what follows them repeats the last."""
    return step * jnp.minimum(jnp.arange(outputs.shape[-1]), count - 1)


@kept
def _run_slopes(design: LinearDesign, layout: Layout, step, count, weights):
    """Derivatives by the designs' arrays from those by the outputs, (B, o, length); and what
    coincides.
    """

    def some(g: Lanes, weights):
        slopes = run_slopes(g, layout, step, count, weights)
        return None, jax.tree.map(lambda x: x[None], slopes)

    groups = jnp.moveaxis(grouped(jnp.moveaxis(weights, 0, -1)), -1, 1)
    return of_groups(some, design, layout, step * count, groups, duration=step * count)[1:]


@kept
def _table_sums(lanes: TableLanes, layout: Layout, step, count, weights) -> TableSums:
    """Sums over the samples of a figure with such derivatives by the outputs, batch first."""
    own = jnp.where(jnp.arange(weights.shape[-1]) < count, weights, 0.0)
    return table_sums(lanes, layout, _times(weights, step, count), own)


@kept
def _table_slopes(design: LinearDesign, layout: Layout, step, count, sums: TableSums):
    """What tables add to `_run_slopes`."""

    def some(g: Lanes, sums: TableSums):
        return None, jax.tree.map(lambda x: x[None], table_slopes(g, layout, sums))

    groups = jax.tree.map(lambda x: grouped(jnp.moveaxis(x, 0, -1)), sums)
    return of_groups(some, design, layout, step * count, groups)[1]
