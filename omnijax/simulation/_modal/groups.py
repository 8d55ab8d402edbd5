"""A batch of designs group by group through the kernels, and back to batch first."""

from collections.abc import Callable
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp

from ..._compiling import on_cpu
from ._poles import Coincidence, Eigen, coincidence, eigen, modes_of
from .gradient import pull_back
from .lanes import LANES, Lanes
from .system import Layout, LinearDesign


def of_groups(
    some: Callable, design: LinearDesign, layout: Layout, span, *more, duration=None
) -> tuple[Any, Any, Coincidence]:
    """Figures of `some(lanes)` for all designs, what its slopes give by what these are made of, and
    what coincides in runs of a `duration` (s, see `coincidence`).

    `span` (s): over which two poles are as good as equal or not.  `some` takes `more` of each group
    too, which leads its arrays.
    """
    pairs = eigen(design.system, layout)
    last = jax.tree.map(lambda x: jnp.moveaxis(x, 0, -1), pairs)
    groups = jax.tree.map(grouped, (lanes_of(design, pairs), last))

    def one(group: tuple[tuple[Lanes, Eigen], Any]):
        values, slopes = some(group[0][0], *group[1])
        if slopes is None:
            return values, None
        system = jax.lax.map(lambda slope: pull_back(*group[0], slope, layout, span), slopes)
        none = jnp.zeros((len(slopes.direct), *group[0][0].preload.shape))
        straight = (none if x is None else x for x in (slopes.preload, slopes.friction))
        return values, LinearDesign(system, slopes.signals, *straight)

    values, bars = jax.lax.map(one, (groups, more))
    bars = jax.tree.map(lambda x: jnp.moveaxis(_flat(x), -1, 1), bars)
    at = coincidence(pairs, design.signals.rate, duration)
    return jax.tree.map(_flat, values), bars, at


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


def grouped(x):
    """(..., B) as groups of lanes, (groups, ..., lanes); away from CPUs one of all."""
    lanes = LANES if on_cpu() else x.shape[-1]
    return jnp.moveaxis(x.reshape(*x.shape[:-1], -1, lanes), -2, 0)
