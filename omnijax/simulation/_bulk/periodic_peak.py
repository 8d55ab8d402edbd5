"""Extremes of periodic motions: a dense search, block by block, then Newton's method.

The search writes each piece as blocks of `LENGTH` samples, x_i = state . table_i, with the tables
common to all blocks, and keeps for every row i the block whose parabola through three samples is
highest (its number rides in the last 16 bits): heights of samples would rank ringing wrongly.
Neither search nor refinement is differentiated: by the envelope theorem the gradient is that of the
formula at the places found.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from .._exact import rows_of
from .contact import Poles
from .periodic import Motion, Pairing, at, slopes, value
from .pole_pair import Pair, scaled, stored_exponential, stored_sincos, times

LENGTH = 16  # samples a block
NEWTON = 5
_MASK = 0xFFFF


def _tag(x, number):
    bits = jax.lax.bitcast_convert_type(x, jnp.int64)
    return jax.lax.bitcast_convert_type((bits & ~_MASK) | number, jnp.float64)


def weighted(m: Motion, weight) -> Motion:
    """The motion with every pair's output times its `weight` (p, c)."""
    return m._replace(
        free=scaled(weight, m.free),
        still=weight * m.still,
        across=tuple(tuple(weight * x for x in waves) for waves in m.across),
        along=tuple(tuple(weight * x for x in waves) for waves in m.along),
    )


def chosen(m: Motion, pairs: np.ndarray) -> Motion:
    """Some of the pairs."""

    def waves(parts):
        return tuple(tuple(x[pairs] for x in part) for part in parts)

    return Motion(
        Poles(*(x[:, pairs] for x in m.lam)),
        Pair(*(x[:, :, pairs] for x in m.free)),
        Pair(*(x[:, :, pairs] for x in m.last)),
        m.still[:, pairs],
        waves(m.across),
        waves(m.along),
        waves(m.rate),
        m.duration[:, pairs],
        m.mean[pairs],
    )


def by_wheel(x, layout: Pairing):
    """Sum over the pairs of each wheel, (..., p, c) to (..., j, c)."""
    groups = [np.flatnonzero(np.array(layout.wheel) == j) for j in range(layout.wheels)]
    return jnp.stack([sum(x[..., p, :] for p in group) for group in groups], axis=-2)


class _Tables(NamedTuple):
    """Samples of a block, (i, ...): exponentials of each mode, cosine and sine of each wave."""

    free: Pair  # (i, m, p, c)
    waves: tuple[tuple[Array, Array], ...]  # (i, p, c)


def _tables(m: Motion, k: int, step) -> _Tables:
    E = stored_exponential(*jnp.broadcast_arrays(m.lam.u, m.lam.D, step))
    turns = [stored_sincos(nu * step) for nu in m.rate[k]]

    def on(row, _):
        y, waves = row
        ahead = [
            (x * c - z * s, z * c + x * s) for (x, z), (s, c) in zip(waves, turns, strict=True)
        ]
        return (times(y, E, m.lam.D), ahead), row

    one = jnp.ones_like(step)
    start = (Pair(jnp.ones_like(E.u), jnp.zeros_like(E.u)), [(one, 0 * one) for _ in turns])
    free, waves = jax.lax.scan(on, start, None, length=LENGTH + 2)[1]
    return _Tables(free, tuple(waves))


def _tops(x, number):
    """Height and depth of the parabolas through every three samples, as one complex array."""
    before, here, after = x[:-2], x[1:-1], x[2:]
    rise, bend = (after - before) / 2, 2 * here - before - after
    inside = jnp.abs(rise) < jnp.abs(bend)
    more = jnp.where(inside, rise * rise / jnp.where(inside, 2 * bend, 1.0), 0.0)
    high, low = here + jnp.maximum(more, 0.0), jnp.maximum(-more, 0.0) - here
    return _tag(high, number), _tag(low, number)


def _piece(m: Motion, layout: Pairing, k: int, blocks: int, best):
    """`best` (i, j, c), the largest x and -x so far as one complex array, over one piece."""
    step = m.duration[k] / (blocks * LENGTH)
    table = _tables(m, k, step)
    still = by_wheel(m.still[k], layout)

    def block(carry, number):
        best, y, waves = carry
        x = y.v * table.free.u + y.u * table.free.v
        x = jnp.sum(x, axis=1)
        for (f, g), (c, s) in zip(waves, table.waves, strict=True):
            x = x + f * c + g * s
        x = by_wheel(x, layout) + still
        high, low = _tops(x, number)
        best = jax.lax.complex(jnp.maximum(best.real, high), jnp.maximum(best.imag, low))
        y = times(y, Pair(table.free.u[LENGTH], table.free.v[LENGTH]), m.lam.D)
        turns = [(c[LENGTH], s[LENGTH]) for c, s in table.waves]
        waves = tuple(
            (f * c + g * s, g * c - f * s) for (f, g), (c, s) in zip(waves, turns, strict=True)
        )
        return (best, y, waves), None

    waves = tuple(zip(m.across[k], m.along[k], strict=True))
    start = (best, Pair(m.free.u[k], m.free.v[k]), waves)
    numbers = jnp.arange(k * blocks, (k + 1) * blocks, dtype=jnp.int64)
    return jax.lax.scan(block, start, numbers)[0][0]


class Spots(NamedTuple):
    """Times of each wheel's largest and smallest value, s from the period's start; the spacing."""

    time: Array  # (2, j, c)
    step: Array


def heights(m: Motion, layout: Pairing, blocks: int):
    """Largest x and -x of each wheel's pairs over each row of a block, (2, i, j, c), tagged."""
    size = m.duration.shape[-1]
    nothing = jnp.full((LENGTH, layout.wheels, size), -jnp.inf)
    best = jax.lax.complex(nothing, nothing)
    for k in range(len(layout.waves)):
        best = _piece(m, layout, k, blocks, best)
    return jnp.stack([best.real, best.imag])


def search(m: Motion, layout: Pairing, blocks: int) -> Spots:
    """Sample of the largest and the smallest sum of each wheel's pairs."""
    both = heights(m, layout, blocks)
    row = jnp.argmax(both, axis=1)
    top = jnp.take_along_axis(both, row[:, None], axis=1)[:, 0]
    number = (jax.lax.bitcast_convert_type(top, jnp.int64) & _MASK).astype(int)
    piece, inside = number // blocks, number % blocks * LENGTH + row + 1
    duration = m.duration[:, _firsts(layout)]
    begin = jnp.cumsum(duration, axis=0) - duration
    width, before = jnp.zeros(top.shape), jnp.zeros(top.shape)
    for k in range(len(layout.waves)):
        width = jnp.where(piece == k, duration[k], width)
        before = jnp.where(piece == k, begin[k], before)
    step = width / (blocks * LENGTH)
    return Spots(before + inside * step, step)


def refine(m: Motion, layout: Pairing, start: Spots, sign, rounds: int = NEWTON) -> Array:
    """Times (s, j, c) near `start` of the largest sign x, by Newton's method; never worse."""
    period = jnp.sum(m.duration, axis=0)[_firsts(layout)]
    sign = jnp.asarray(sign)[:, None, None]

    def look(time):
        here = jax.vmap(lambda t: at(m, layout, rows_of(t, layout.wheel)))(time)
        parts = (jax.vmap(value)(here), *jax.vmap(slopes)(here))
        return tuple(sign * by_wheel(part, layout) for part in parts)

    def improve(carry, _):
        moved, best, top = carry
        x, rise, bend = look(jnp.mod(start.time + moved, period))
        better = x > top
        best, top = jnp.where(better, moved, best), jnp.where(better, x, top)
        newton = -rise / jnp.where(bend < 0, bend, -1.0)
        step = jnp.where(bend < 0, newton, jnp.sign(rise) * start.step / 2)
        moved = jnp.clip(moved + step, -start.step, start.step)
        return (moved, best, top), None

    zero = jnp.zeros_like(start.time)
    begin = (zero, zero, jnp.full_like(zero, -jnp.inf))
    best = jax.lax.scan(improve, begin, None, length=rounds + 1)[0][1]
    return jnp.mod(start.time + best, period)


def _firsts(layout: Pairing) -> np.ndarray:
    """The first pair of each wheel."""
    return np.array([layout.wheel.index(j) for j in range(layout.wheels)])
