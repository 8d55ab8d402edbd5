"""Exact propagation at constant speeds: any time is reached in a few products.

The response is a sum over signals.  Each signal's forced curve from rest over one period is known
(`expm.py`); states at the starts of later periods follow from powers of the period's affine map;
what the start leaves over decays freely:

    s(t) = sum_g [c_g(u) + exp(A tau(u)) S_g,j] + exp(A (t - t0)) (s0 - sum_g c_g(u0))

with u the angle in the period, j the period's number and S_g,j the j-th power applied to rest.
"""

from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from ...laws import piece_at, value
from ...rig import Rig
from .expm import advance_all, advance_pieces, points, squarings
from .forcing import (
    Forcing,
    ForcingSignal,
    PeriodicSignal,
    forcing_signals,
    like_groups,
    stacked,
)
from .period_map import Passages, passages, piece_maps, prefix_maps, with_terms
from .system import ForcedSystem, balanced, forced_system, with_integrals

GRID_BITS = 7  # of the forced curves' grid
PERIODS = 48  # bits of the number of periods, of which those above the largest cost nothing


class Response(NamedTuple):
    """Elastic state and integrals at the samples, in SI units."""

    state: Float[Array, "t m"]
    position: Float[Array, "t 3"]  # m, X
    drift: Float[Array, "t 3"]  # m/s, U
    shape: Float[Array, "t n"]  # m, rho of the wheels
    integral: Float[Array, "t n"]  # m s, of rho
    second: Float[Array, "t n"]  # m s^2, of that


def _powers(period: Float[Array, "a a"], count: Array, most: Array) -> Float[Array, "t a"]:
    """period^count applied to rest (0, 1), for many counts; none is above `most`, unbatched."""
    rest = jnp.zeros((len(count), period.shape[0])).at[:, -1].set(1.0)

    def climb(carry, j):
        def on(M, z):
            return M @ M, jnp.where(((count >> j) & 1)[:, None] == 1, z @ M.T, z)

        return jax.lax.cond(most >> j > 0, on, lambda M, z: (M, z), *carry), None

    return jax.lax.scan(climb, (period, rest), jnp.arange(PERIODS))[0][1]


def _places(cycle: PeriodicSignal, elapsed):
    """Number of the period, piece, v and angle in the period at times since the start."""
    angle = cycle.start + cycle.speed * elapsed
    period = cycle.period
    number = jax.lax.stop_gradient(jnp.floor(angle / period))
    inside = angle - number * period
    index, v = jax.vmap(lambda a: piece_at(cycle.pieces, a))(inside)
    return number.astype(int), index, jnp.clip(v, 0.0, 1.0), inside


class Decay(NamedTuple):
    """Free motion over one period of each signal, on a ladder (`expm.squarings`)."""

    generator: Float[Array, "g m m"]
    levels: Float[Array, "g L m m"]
    scale: Int[Array, " g"]


def _decays(system: ForcedSystem, levels: int, cycle: PeriodicSignal) -> Decay:
    duration = (cycle.period / cycle.speed)[:, None, None]
    F = system.A * duration
    return Decay(F, *jax.vmap(lambda F: squarings(F, len(system.A), 0, levels))(F))


def _top(scale) -> Int[Array, ""]:
    """Above every bit of a place on the ladders (v = 1 has the one at `scale`)."""
    return jnp.max(scale) + 1


def _signal(tops, m: int, cycle: PeriodicSignal, cycles: Passages, decay: Decay, places):
    """Forced response of one signal from a virtual rest at its period's start; rho beside it."""
    before, period = prefix_maps(piece_maps(cycles.pieces, m))
    starts = with_terms(before[:, :m, m], cycles.pieces)
    Z = jax.vmap(lambda piece, z: points(piece, z, GRID_BITS))(cycles.pieces, starts)
    number, index, v, inside = places
    curve = advance_pieces(cycles.pieces, tops[0], Z, index, v)[:, :m]
    earlier = _powers(period, number, tops[2])[:, :m]
    free = advance_all(*decay, tops[1], earlier, inside / cycle.period)
    shape = jax.vmap(lambda k, v: value(cycle.pieces, k, v))(index, v)
    return curve + free, shape


def _free(system: ForcedSystem, levels: int, start, force, elapsed, until):
    """exp(A t) start and the response to a constant force from rest."""
    m = len(system.A)
    top = jnp.concatenate([system.A, (system.force @ force)[:, None]], axis=1) * until
    F = jnp.concatenate([top, jnp.zeros((1, m + 1))])
    rungs, scale = squarings(F, m, 0, levels)
    z = jnp.broadcast_to(jnp.append(start, 1.0), (len(elapsed), m + 1))
    return advance_all(F, rungs, scale, _top(scale), z, elapsed / until)[:, :m]


def _by_signal(
    system: ForcedSystem, signals: list[ForcingSignal], elapsed: Float[Array, " t"], levels: int
) -> tuple[Float[Array, "g t m"], Float[Array, "g t"]]:
    """Forced response of every signal, and rho; signals of like sizes go beside each other."""
    groups = like_groups(signals, len(system.A))
    parts = [
        _group(system.of_signals(index), stacked([signals[i] for i in index]), elapsed, levels)
        for index in groups
    ]
    if len(parts) == 1:
        return parts[0]
    place = np.argsort(np.concatenate(groups))
    s, shape = (jnp.concatenate(x)[place] for x in zip(*parts, strict=True))
    return s, shape


def _group(system: ForcedSystem, signals: Forcing, elapsed, levels: int) -> tuple[Array, Array]:
    cycles = passages(system, signals, GRID_BITS, levels)
    decays = _decays(system, levels, signals.cycle)
    places = jax.vmap(_places, in_axes=(0, None))(signals.cycle, elapsed)
    tops = (_top(cycles.pieces.scale), _top(decays.scale), jnp.max(places[0]))
    one = partial(_signal, tops, len(system.A))
    return jax.vmap(one)(signals.cycle, cycles, decays, places)


def constant_response(
    rig: Rig, speeds, angles, force, ts, model: str, start, levels: int, origin=None
) -> Response:
    """Response at times `ts` (s) to constant speeds; the run starts at `origin` (None: ts[0]).

    `start` is the elastic state there, or None for static equilibrium.
    """
    signals = forcing_signals(rig, speeds, angles)
    wheels = tuple(signal.wheel for signal in signals)
    plain = forced_system(rig, model, speeds, wheels)
    system = with_integrals(plain)
    scaled, unit = balanced(system)
    elapsed = jnp.concatenate([jnp.zeros(1), ts - (ts[0] if origin is None else origin)])
    s, shape = _by_signal(scaled, signals, elapsed, levels)
    y0 = plain.rest @ shape[:, 0] if start is None else start
    y0 = jnp.pad(y0, (0, 8)) - system.shift.T @ shape[:, 0]
    free = y0 / unit - jnp.sum(s[:, 0], axis=0)
    until = jnp.maximum(elapsed[-1], 1e-12)
    total = jnp.sum(s, axis=0) + _free(scaled, levels, free, force, elapsed, until)
    total = total * unit + jnp.einsum("gt,gm->tm", shape, system.shift)
    return _response(total[1:], s * unit, shape, elapsed, wheels, rig.size)


def _response(total, s, shape, elapsed, wheels: tuple[int, ...], n: int) -> Response:
    m = total.shape[1] - 8
    first = s[..., m + 6] - s[:, :1, m + 6]
    second = s[..., m + 7] - s[:, :1, m + 7] - s[:, :1, m + 6] * elapsed
    rows = jnp.zeros((n, len(wheels)))
    for g, i in enumerate(wheels):
        rows = rows if i < 0 else rows.at[i, g].set(1.0)
    per_wheel = [(rows @ x).T[1:] for x in (shape, first, second)]
    return Response(total[:, :m], total[:, m : m + 3], total[:, m + 3 : m + 6], *per_wheel)
