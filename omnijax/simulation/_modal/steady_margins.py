"""Least normal force and grip over all phases of the long run: bounds where those say enough."""

import functools
import operator

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .arithmetic import materialised
from .curves import Curves, along, weights
from .gradient import ROWS
from .phases import constant
from .supremum import all_curves
from .system import Layout
from .transient import Lanes


def _bound(f: Curves) -> Float[Array, "r c"]:
    """Above the size of every output, the phases' parts added up."""
    total = 0.0
    for y0, y1 in f.free:
        size = [jnp.stack([jnp.abs(x) for x in weights(f, z)]) for z in zip(y0, y1, strict=True)]
        total = total + jnp.max(jnp.sum(jnp.stack(size), axis=(1, 3)), axis=0)
    for a, b in zip(f.cosine, f.sine, strict=True):
        total = total + jnp.max(jnp.sum(jnp.sqrt(a * a + b * b), axis=1), axis=1)
    return jnp.sum(total, axis=1)


def _least(f: Curves, friction: Float[Array, "n c"]) -> Float[Array, "m c"]:
    """Least N_i, mu_i N_i - f_i and mu_i N_i + f_i, the phases' own least values added up."""
    n = len(friction)
    mu = friction[:, None]

    def gather(totals, x, _, __):
        least, size = totals
        normal, drive = x[:, :n], x[:, n:]
        y = jnp.concatenate([normal, mu * normal - drive, mu * normal + drive], axis=1)
        y = materialised(lambda y: 1.0 * y, y)
        rise, bend = y[2:] - y[:-2], y[2:] + y[:-2] - 2 * y[1:-1]
        inside = jnp.abs(rise) < 2 * bend
        less = jnp.where(inside, rise * rise / jnp.where(inside, 8 * bend, 1.0), 0.0)
        low = jnp.minimum(jnp.minimum(y[0], y[-1]), jnp.min(y[1:-1] - less, axis=0))
        return jnp.minimum(least, low), jnp.maximum(size, jnp.max(jnp.abs(x), axis=(0, 1)))

    none = jnp.full((3 * n, *f.cycle.period.shape), jnp.inf)
    start = none, jnp.zeros_like(f.cycle.period)
    return jnp.sum(along(f, gather, start, lambda t: t[1])[0], axis=1)


def steady_margins(g: Lanes, layout: Layout) -> tuple[Float[Array, " c"], Float[Array, " c"]]:
    """N, of the least normal force and of the least mu N - |f| bounds of the same sign.

    From parabolas through samples where the bounds say too little.
    """
    n = layout.wheels
    rows = slice(ROWS, ROWS + 2 * n)
    every = all_curves(g, layout, rows)
    held = constant(g.modes, layout, rows, g.direct)
    normal, drive = g.preload + held[:n], held[n:]
    swing = functools.reduce(operator.add, map(_bound, every))
    low = normal - swing[:n]
    slip = g.friction * low - jnp.abs(drive) - swing[n:]
    bounds = jnp.min(low, axis=0), jnp.min(slip, axis=0)

    def exact(_):
        part = functools.reduce(operator.add, (_least(f, g.friction) for f in every))
        grip = jnp.minimum(part[n : 2 * n] - drive, part[2 * n :] + drive)
        return jnp.min(normal + part[:n], axis=0), jnp.min(g.friction * normal + grip, axis=0)

    open_ = jnp.any((bounds[0] <= 0) | (bounds[1] < 0))
    return jax.lax.cond(open_, exact, lambda b: b, bounds)
