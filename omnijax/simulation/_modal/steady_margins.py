"""Least normal force and grip over all phases of the long run: bounds where those say enough."""

import functools
import operator

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .arithmetic import across, materialised
from .curves import ModalCurves, recombined, size_of
from .gradient import ROWS
from .pass_along import Block, along, reach
from .phases import constant
from .supremum import all_curves
from .system import Layout
from .transient import Lanes


def _least(f: ModalCurves) -> Float[Array, "r c"]:
    """Least value of every output, the phases' own least values added up."""

    def gather(least, y, _, __):
        y = materialised(lambda y: 1.0 * y, y)
        rise, bend = y[2:] - y[:-2], y[2:] + y[:-2] - 2 * y[1:-1]
        inside = jnp.abs(rise) < 2 * bend
        less = jnp.where(inside, rise * rise / jnp.where(inside, 8 * bend, 1.0), 0.0)
        low = y - jnp.pad(less, ((1, 1), (0, 0), (0, 0), (0, 0)))
        return jnp.minimum(least, across(jnp.minimum, low))

    def idle(least, block: Block):
        return jnp.all(reach(f, block) <= -least, axis=0)

    start = jnp.full((len(f.rows.c0), *f.cycle.period.shape), jnp.inf)
    return jnp.sum(along(f, gather, start, idle), axis=1)


def steady_margins(g: Lanes, layout: Layout) -> tuple[Float[Array, " c"], Float[Array, " c"]]:
    """N, of the least normal force and of the least mu N - |f| bounds of the same sign.

    From parabolas through samples where the bounds say too little.
    """
    n = layout.wheels
    rows = slice(ROWS, ROWS + 2 * n)
    every = all_curves(g, layout, rows)
    held = constant(g.modes, layout, rows, g.direct)
    normal, drive = g.preload + held[:n], held[n:]
    swing = functools.reduce(operator.add, (jnp.sum(size_of(f), axis=1) for f in every))
    low = normal - swing[:n]
    slip = g.friction * low - jnp.abs(drive) - swing[n:]
    bounds = jnp.min(low, axis=0), jnp.min(slip, axis=0)

    def grips(x):
        """N, mu N - f and mu N + f."""
        mu = g.friction.reshape(n, *(1,) * (x.ndim - 2), -1)
        return jnp.concatenate([x[:n], mu * x[:n] - x[n:], mu * x[:n] + x[n:]])

    def exact(_):
        part = functools.reduce(operator.add, (_least(recombined(f, grips)) for f in every))
        grip = jnp.minimum(part[n : 2 * n] - drive, part[2 * n :] + drive)
        return jnp.min(normal + part[:n], axis=0), jnp.min(g.friction * normal + grip, axis=0)

    open_ = jnp.any((bounds[0] <= 0) | (bounds[1] < 0))
    return jax.lax.cond(open_, exact, lambda b: b, bounds)
