"""Runs of many designs for whatever is read from their samples."""

from collections.abc import Callable, Iterator
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from ..._compiling import Effort
from ..._programs import kept
from ...rig import Rig
from .._padding import room
from ._poles import Answer, answered, coincidence, eigen
from ._transient import LENGTH
from .batch import DesignBatch, ready
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
                outputs, at = _outputs(design, *self._given, length, effort=b.effort)
                return Answer(outputs), at

            outputs = answered(ask, design, b.layout, wanted, 0).smooth
            yield RunGroup(outputs, rigs, wanted, design)

    def _length(self) -> int:
        """Room for the samples and a block; of few designs one length for all short runs.

        Each length is a program, which costs more than the room that few designs leave empty.
        """
        samples = self.samples + LENGTH
        few = self.effort == Effort.LEAST and samples <= SHORT
        return SHORT if few else room(samples, 4)

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
            live=tuple(layout.live[row] for row in rows),
            waves=tuple(layout.waves[row] for row in rows),
        )
        s = group.design.system
        part = s._replace(C=s.C[:, rows], direct=s.direct[:, :, rows], rate=s.rate[:, :, rows])
        given = np.asarray(weights)[:, rows]

        def ask(design: LinearDesign, numbers):
            bars, at = _run_slopes(design, few, *samples, given[numbers], effort=self.effort)
            return Answer(bars), at

        bars = answered(ask, group.design._replace(system=part), few, group.wanted, 1).smooth

        def placed(x, axis: int) -> np.ndarray:
            whole = np.zeros(np.insert(np.delete(x.shape, axis), axis, layout.rows))
            np.moveaxis(whole, axis, 0)[rows] = np.moveaxis(np.asarray(x), axis, 0)
            return whole

        system = bars.system
        return bars._replace(
            system=system._replace(
                C=placed(system.C, 2), direct=placed(system.direct, 3), rate=placed(system.rate, 3)
            )
        )

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
def _run_slopes(design: LinearDesign, layout: Layout, step, count, weights):
    """Derivatives by the designs' arrays from those by the outputs, (B, o, length); and what
    coincides.
    """

    def some(g: Lanes, weights):
        slopes = run_slopes(g, layout, step, count, weights)
        return None, jax.tree.map(lambda x: x[None], slopes)

    groups = jnp.moveaxis(grouped(jnp.moveaxis(weights, 0, -1)), -1, 1)
    return of_groups(some, design, layout, step * count, groups, duration=step * count)[1:]
