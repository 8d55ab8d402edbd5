"""Samples of every output of many runs, and derivatives of whatever is made of them.

A figure of a run has derivatives g_o(t) by the samples of its outputs; sums of these against what a
run is made of (`OutputSums`) give its derivatives by poles, residues and signals.
"""

from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from ..._compiling import on_cpu
from ...rig import Rig
from ._transient import (
    LENGTH,
    BlockTables,
    OutputParts,
    Walk,
    WalkState,
    Weights,
    shown_by,
    slopes_of,
    stored_forced,
    sums_along,
)
from .arithmetic import materialised
from .gradient import Slopes
from .lanes import Lanes
from .system import Layout, output_rows

RUN_OUTPUTS = ("dR", "dR_rate", "dR_elastic", "a_sphere", "a", "normal_force", "drive_force")
TOGETHER = 3  # outputs that one loop works out, as vectors have


class RunChannels(NamedTuple):
    """What figures are read from: the channels of a `Trajectory` of these names, one row a sample.

    Those of the attitude and of the place are not among them.
    """

    t: Float[Array, " t"]
    dR: Float[Array, "t 3"]
    dR_rate: Float[Array, "t 3"]
    dR_elastic: Float[Array, "t 3"]
    a_sphere: Float[Array, "t 3"]
    a: Float[Array, "t 3"]
    normal_force: Float[Array, "t n"]
    slip_margin: Float[Array, "t n"]


def channels_of(outputs: Float[Array, "o t"], rig: Rig, step) -> RunChannels:
    """The channels of one run from samples of `RUN_OUTPUTS` every `step` s from t = 0 on."""
    part = {name: outputs[rows].T for name, rows in output_rows(RUN_OUTPUTS, rig.size).items()}
    normal = rig.wheels.closure.preload + part.pop("normal_force")
    drive = part.pop("drive_force")
    margin = rig.wheels.contact.friction * normal - jnp.abs(drive)
    return RunChannels(step * jnp.arange(outputs.shape[1]), **part, normal_force=normal,
                       slip_margin=margin)  # fmt: skip


def _walk(g: Lanes, layout: Layout, step, count) -> tuple[Walk, OutputParts]:
    """The runs of a group, and what their outputs show."""
    parts = stored_forced(g.modes, g.signals, g.direct, g.slope, layout)
    walk = Walk(g.modes, g.signals, parts, layout, step, count)
    return walk, shown_by(range(layout.rows), g.modes, parts, layout)


def outputs_of(g: Lanes, layout: Layout, step, count, length: int) -> Float[Array, "c o t"]:
    """The outputs at t = 0, step, ..., `count` samples; the rest of `length` means nothing.

    What tables add is not among them.  There has to be room for a block after the last sample.
    """
    walk, shown = _walk(g, layout, step, count)
    groups = [range(o, min(o + TOGETHER, layout.rows)) for o in range(0, layout.rows, TOGETHER)]

    def samples(some: Sequence[int], w: Weights, t: BlockTables) -> Array:
        return jnp.stack([shown.samples(w, t, layout, o) for o in some])

    def gather(runs, s: WalkState, t: BlockTables, turn):
        w = shown.weights(s.free, s.piece, turn, layout)
        each = [materialised(lambda w, t, o=o: samples(o, w, t), w, t) for o in groups]
        block = jnp.transpose(jnp.concatenate(each), (2, 0, 1))
        return _put(runs, block, s.done.astype(int))

    lanes = g.modes.l0.shape[-1]
    return walk.run(gather, jnp.zeros((lanes, layout.rows, length)))


def _put(runs: Float[Array, "c o t"], block: Float[Array, "c o k"], first: Int[Array, " c"]):
    """The runs with their blocks; one after the other on a CPU, where that is no scatter."""
    if not on_cpu():
        each = jax.vmap(lambda run, x, at: jax.lax.dynamic_update_slice(run, x, (0, at)))
        return each(runs, block, first)

    def put(i, runs):
        x = jax.lax.dynamic_slice_in_dim(block, i, 1)
        return jax.lax.dynamic_update_slice(runs, x, (i, 0, first[i]))

    return jax.lax.fori_loop(0, len(runs), put, runs)


def run_slopes(g: Lanes, layout: Layout, step, count, weights: Float[Array, "c o t"]) -> Slopes:
    """Derivatives of a figure of every run whose derivatives by the samples are `weights`.

    They have the room that `outputs_of` asks for.
    """
    walk, shown = _walk(g, layout, step, count)
    along = sums_along(g, layout, step)

    def gather(totals, s: WalkState, t: BlockTables, turn):
        w = shown.weights(s.free, s.piece, turn, layout)
        here = jax.vmap(_taken)(weights, s.done.astype(int))
        here = jnp.where(jnp.arange(LENGTH)[:, None] < s.count, jnp.transpose(here, (1, 2, 0)), 0.0)
        return along.gather(totals, here, w, t, s, turn)

    sums = walk.run(gather, along.totals, along.follow, along.carried)
    return slopes_of(g, layout, sums)


def _taken(weights: Float[Array, "o t"], first):
    return jax.lax.dynamic_slice(weights, (0, first), (len(weights), LENGTH))
