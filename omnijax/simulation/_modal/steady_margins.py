"""Least normal force and grip over all phases of the long run: bounds where those say enough."""

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
        every = materialised(
            lambda x: [jnp.concatenate([y[:n], mu * y[:n] - y[n:], mu * y[:n] + y[n:]]) for y in x],
            x,
        )
        for before, y, after in zip(every, every[1:], every[2:], strict=False):
            rise, bend = after - before, after + before - 2 * y
            inside = jnp.abs(rise) < 2 * bend
            less = jnp.where(inside, rise * rise / jnp.where(inside, 8 * bend, 1.0), 0.0)
            least = jnp.minimum(least, y - less)
        for y in (every[0], every[-1]):
            least = jnp.minimum(least, y)
        for y in x:
            size = jnp.maximum(size, jnp.max(jnp.abs(y), axis=0))
        return least, size

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
    swing = sum(_bound(f) for f in every)
    low = normal - swing[:n]
    slip = g.friction * low - jnp.abs(drive) - swing[n:]
    bounds = jnp.min(low, axis=0), jnp.min(slip, axis=0)

    def exact(_):
        part = sum(_least(f, g.friction) for f in every)
        grip = jnp.minimum(part[n : 2 * n] - drive, part[2 * n :] + drive)
        return jnp.min(normal + part[:n], axis=0), jnp.min(g.friction * normal + grip, axis=0)

    open_ = jnp.any((bounds[0] <= 0) | (bounds[1] < 0))
    return jax.lax.cond(open_, exact, lambda b: b, bounds)
