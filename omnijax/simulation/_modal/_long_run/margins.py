"""Least normal force and grip over all phases of the long run: bounds where those say enough."""

import functools
import operator
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from ..arithmetic import across, materialised
from ..lanes import ROWS, Lanes
from ..system import Layout
from .curves import ModalCurves, curves_of, phase_by_phase, rows_shown, shown_rows, size_of
from .pass_along import Block, along
from .pass_tables import Interval, along_tables, highest
from .phases import constant, phases_of


class _Forces(NamedTuple):
    """Normal and then drive forces of wheels (w) that phases of like kinds move."""

    curves: ModalCurves  # (2 w) outputs
    wheels: np.ndarray  # (w, s), their numbers

    def over_phases(self, x: Float[Array, "w s c"], count: int) -> Float[Array, "n c"]:
        """Sums over the phases of what belongs to each of all wheels."""
        on = np.arange(count)[:, None, None] == self.wheels  # (n, w, s)
        return jnp.sum(jnp.where(on[..., None], x, 0.0), axis=(1, 2))


def _forces(g: Lanes, layout: Layout) -> list[_Forces]:
    """Of all phases: of one wheel each where no phase moves more, else of all."""
    n, groups = layout.wheels, phases_of(layout)
    rows = [rows_shown(layout, phases, range(ROWS, ROWS + 2 * n)) for phases in groups]
    moved = [[sorted({(row - ROWS) % n for row in own}) for own in group] for group in rows]
    alone = max(len(own) for group in moved for own in group) <= 1
    forces = []
    for phases, group in zip(groups, moved, strict=True):
        wheels = [(own or [0]) if alone else [*range(n)] for own in group]
        shown = [[ROWS + i for i in own] + [ROWS + n + i for i in own] for own in wheels]
        curves = curves_of(g, layout, phases, shown_rows(layout, shown))
        forces.append(_Forces(curves, np.array(wheels).T))
    return forces


def _least(f: ModalCurves, mu, asked: Bool[Array, "w s c"]) -> Float[Array, "3 w s c"]:
    """Least N, mu N - f and mu N + f of each phase, of the wheels that are asked for."""
    n = len(mu)

    def grips(x):
        """(..., 2 w, s, c) -> (..., 3, w, s, c)."""
        normal, drive = x[..., :n, :, :], x[..., n:, :, :]
        return jnp.stack([normal, mu * normal - drive, mu * normal + drive], axis=-4)

    def lowest(mu, x):
        y = grips(x)
        rise, bend = y[2:] - y[:-2], y[2:] + y[:-2] - 2 * y[1:-1]
        inside = jnp.abs(rise) < 2 * bend
        less = jnp.where(inside, rise * rise / jnp.where(inside, 8 * bend, 1.0), 0.0)
        low = y - jnp.pad(less, ((1, 1), *[(0, 0)] * 4))
        return across(jnp.minimum, low)

    def gather(least, x, block: Block):
        low = materialised(lowest, mu, x)
        return jnp.where(block.counts, jnp.minimum(least, low), least)

    def idle(least, above):
        normal, drive = jnp.split(above, 2)
        grip = mu * normal + drive
        over = [above <= -low for above, low in zip((normal, grip, grip), least, strict=True)]
        return functools.reduce(operator.and_, list(functools.reduce(operator.and_, over) | ~asked))

    def gather_inside(least, on: Interval):
        low = materialised(lambda mu, on: -highest(on, lambda x: -grips(x))[0], mu, on)
        return jnp.minimum(least, low)

    if f.table is not None:
        return along_tables(f, gather_inside, jnp.full((3, *asked.shape), jnp.inf))
    return along(f, gather, jnp.full((3, *asked.shape), jnp.inf), idle)


def steady_margins(g: Lanes, layout: Layout) -> tuple[Float[Array, " c"], Float[Array, " c"]]:
    """N, of the least normal force and of the least mu N - |f| bounds of the same sign.

    From parabolas through samples where the bounds of a wheel say too little.
    """
    n, every = layout.wheels, _forces(g, layout)
    held = constant(g.modes, layout, np.arange(ROWS, ROWS + 2 * n), g.direct)
    normal, drive = g.preload + held[:n], held[n:]

    def summed_up(each: list[Array]) -> Array:
        parts = (x.over_phases(y, n) for x, y in zip(every, each, strict=True))
        return functools.reduce(operator.add, parts)

    size = [jnp.split(size_of(x.curves), 2) for x in every]
    swing, pull = (summed_up([x[i] for x in size]) for i in (0, 1))
    low = normal - swing
    slip = g.friction * low - jnp.abs(drive) - pull
    asked = (low <= 0) | (slip < 0)  # (n, c)

    def exact(low, slip):
        least = [
            phase_by_phase(_least, x.curves, g.friction[x.wheels], asked[x.wheels]) for x in every
        ]
        part = [summed_up([x[i] for x in least]) for i in range(3)]
        grip = jnp.minimum(part[1] - drive, part[2] + drive)
        exact = normal + part[0], g.friction * normal + grip
        low, slip = (jnp.where(asked, x, y) for x, y in zip(exact, (low, slip), strict=True))
        return jnp.min(low, axis=0), jnp.min(slip, axis=0)

    def enough(low, slip):
        return jnp.min(low, axis=0), jnp.min(slip, axis=0)

    return jax.lax.cond(jnp.any(asked), exact, enough, low, slip)
