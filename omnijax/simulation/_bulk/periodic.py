"""The periodic motion of contacts under periodic shapes, in closed form for many designs at once.

A pair is one wheel's shape acting along one direction.  On a piece of the wheel's period, t s in,

    x = sum_modes (free exp((u + j) t)).v + still + sum_w across cos(rate t) + along sin(rate t)

(`_ring` says what u + j is).  The free states follow from continuity: what the particular solution
jumps by from piece to piece, carried once around the period, comes back to where it began.
"""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._exact import rows_of
from .contact import Contact, Poles, approach, poles, residues
from .materialise import stage
from .pole_pair import Pair, inverse, plus, scaled, stored_exponential, stored_sincos, times
from .waveform import Waveform


class Pairing(NamedTuple):
    """What is static: which wheel acts along which direction, and the waves of each piece."""

    axis: tuple[int, ...]  # direction of each pair
    wheel: tuple[int, ...]  # wheel of each pair
    directions: int
    wheels: int
    sets: tuple[int, ...]  # of each direction: its row of contact parameters
    waves: tuple[int, ...]  # of each piece


class Shaken(NamedTuple):
    """Contacts and wheels of a batch of designs (last axis c)."""

    contact: Contact  # (sets, c)
    shape: Waveform
    own: Float[Array, "p c"]  # 1 where the pair is a contact and its own wheel
    coupling: Float[Array, "p c"]  # drive force along the direction per drho/dt, N s/m


class Motion(NamedTuple):
    """The periodic motion; pieces k, modes m, waves w, pairs p."""

    lam: Poles  # (m, p, c)
    free: Pair  # (k, m, p, c): at the start of each piece
    last: Pair  # (k, m, p, c): at its end
    still: Float[Array, "k p c"]  # m
    across: tuple[tuple[Array, ...], ...]  # [k][w]: (p, c), m
    along: tuple[tuple[Array, ...], ...]
    rate: tuple[tuple[Array, ...], ...]  # rad/s
    duration: Float[Array, "k p c"]  # s
    mean: Float[Array, "p c"]  # m, over the period


def _negative(a: Pair) -> Pair:
    return scaled(-1.0, a)


def _total(pairs: list[Pair]) -> Pair:
    total = pairs[0]
    for pair in pairs[1:]:
        total = plus(total, pair)
    return total


def _weights(contact: Contact, own, coupling, row: np.ndarray, numerator):
    """Poles and residues of each pair, and its mean response to a mean shape."""
    roots = poles(contact)
    lam = Poles(rows_of(roots.u, row), rows_of(roots.D, row))
    r = residues(lam, numerator(Contact(*(rows_of(x, row) for x in contact)), own, coupling))
    below = inverse(Pair(lam.u, jnp.ones_like(lam.u)), lam.D)
    return lam, r, _negative(times(r, below, lam.D))


def _particular(lam: Poles, r: Pair, still: Pair, waves):
    """Particular solution at both ends of a piece, and its output's amplitudes.

    z = r/(lam^2 + nu^2) (nu (a sin - b cos) - lam (a cos + b sin)) answers a cos + b sin.
    """
    root = Pair(lam.u, jnp.ones_like(lam.u))
    square = times(root, root, lam.D)
    begin, end, across, along = still, still, [], []
    for a, b, nu, s, c in waves:
        g = times(r, inverse(Pair(square.u + nu**2, square.v), lam.D), lam.D)
        G = times(g, root, lam.D)
        first = plus(scaled(-a, G), scaled(-b * nu, g))  # of the cosine
        second = plus(scaled(-b, G), scaled(a * nu, g))  # of the sine
        begin = plus(begin, first)
        end = _total([end, scaled(c, first), scaled(s, second)])
        across.append(jnp.sum(first.v, axis=0))
        along.append(jnp.sum(second.v, axis=0))
    return begin, end, tuple(across), tuple(along)


def _closed(lam: Poles, E: Pair, jumps: list[Pair]) -> tuple[Pair, Pair]:
    """Free states at both ends of each piece: y' = E y + jump, the same after a whole period."""
    whole, carried = Pair(E.u[0], E.v[0]), jumps[0]
    for k in range(1, len(jumps)):
        here = Pair(E.u[k], E.v[k])
        whole, carried = times(whole, here, lam.D), plus(times(carried, here, lam.D), jumps[k])
    y = times(carried, inverse(Pair(1 - whole.u, -whole.v), lam.D), lam.D)
    first, last = [], []
    for k, jump in enumerate(jumps):
        first.append(y)
        last.append(times(y, Pair(E.u[k], E.v[k]), lam.D))
        y = plus(last[k], jump)
    stacked = [Pair(*(jnp.stack(x) for x in zip(*s, strict=True))) for s in (first, last)]
    return stacked[0], stacked[1]


def _mean_shape(shape: Waveform, phase, waves: tuple[int, ...]):
    """Mean of rho over the period, (j, c)."""
    area = jnp.sum(shape.level * shape.duration, axis=0)
    for k, count in enumerate(waves):
        for w in range(count):
            s, c = phase[0][k, w], phase[1][k, w]
            part = shape.cosine[k, w] * s + shape.sine[k, w] * (1 - c)
            area = area + part / shape.rate[k, w]
    return area / jnp.sum(shape.duration, axis=0)


def motion(design: Shaken, layout: Pairing, numerator=approach) -> Motion:
    """The closed form of the periodic motion of every pair; `numerator` says what of it."""
    wheel = np.array(layout.wheel)
    row = np.array(layout.sets)[np.array(layout.axis)]
    shape = design.shape

    def weigh(contact: Contact, own, coupling):
        return _weights(contact, own, coupling, row, numerator)

    lam, r, gain = stage(weigh)(design.contact, design.own, design.coupling)
    duration = rows_of(shape.duration, wheel)
    E = stored_exponential(*jnp.broadcast_arrays(lam.u, lam.D, duration[:, None]))
    phase = stored_sincos(shape.rate * shape.duration[:, None])

    def close(lam: Poles, r: Pair, gain: Pair, E: Pair, shape: Waveform, phase):
        begins, ends, across, along = [], [], [], []
        for k, count in enumerate(layout.waves):
            pick = [rows_of(x[k], wheel) for x in (shape.cosine, shape.sine, shape.rate, *phase)]
            waves = [[x[w] for x in pick] for w in range(count)]
            still = scaled(rows_of(shape.level[k], wheel), gain)
            *ends_of, x, y = _particular(lam, r, still, waves)
            begins.append(ends_of[0])
            ends.append(ends_of[1])
            across.append(x)
            along.append(y)
        jumps = [plus(a, _negative(b)) for a, b in zip(ends, begins[1:] + begins[:1], strict=True)]
        direct = jnp.sum(gain.v, axis=0)
        mean = direct * rows_of(_mean_shape(shape, phase, layout.waves), wheel)
        still = direct * rows_of(shape.level, wheel)
        return *_closed(lam, E, jumps), still, tuple(across), tuple(along), mean

    free, last, still, across, along, mean = stage(close)(lam, r, gain, E, shape, phase)
    rate = tuple(
        tuple(rows_of(shape.rate[k, w], wheel) for w in range(count))
        for k, count in enumerate(layout.waves)
    )
    return Motion(lam, free, last, still, across, along, rate, duration, mean)


class Place(NamedTuple):
    """What the motion is made of at one time of each pair."""

    lam: Poles
    free: Pair  # (m, p, c), at that time
    still: Array  # (p, c)
    waves: tuple[tuple[Array, Array, Array], ...]  # amplitudes of cos, sin as they are there; rate


def at(m: Motion, layout: Pairing, time) -> Place:
    """The motion at `time` (p, c), s from the period's start, 0 <= time <= the period."""
    ends = jnp.cumsum(m.duration, axis=0)
    index = jnp.zeros(time.shape, int)
    for k in range(len(layout.waves) - 1):
        index = index + (time >= ends[k])
    here = [index == k for k in range(len(layout.waves))]

    def chosen(values):
        total = jnp.where(here[0], values[0], 0.0)
        for k in range(1, len(here)):
            total = jnp.where(here[k], values[k], total)
        return total

    since = time - chosen(ends - m.duration)
    E = stored_exponential(*jnp.broadcast_arrays(m.lam.u, m.lam.D, since))
    start = Pair(chosen(m.free.u), chosen(m.free.v))
    waves = []
    for w in range(max(layout.waves)):
        parts = [
            chosen([part[w] if w < len(part) else jnp.full_like(since, other) for part in x])
            for x, other in ((m.across, 0.0), (m.along, 0.0), (m.rate, 1.0))
        ]
        s, c = stored_sincos(parts[2] * since)
        waves.append((parts[0] * c + parts[1] * s, parts[1] * c - parts[0] * s, parts[2]))
    return Place(m.lam, times(start, E, m.lam.D), chosen(m.still), tuple(waves))


def value(here: Place):
    """x of every pair, (p, c)."""
    return jnp.sum(here.free.v, axis=0) + here.still + sum(w[0] for w in here.waves)


def slopes(here: Place):
    """dx/dt and d^2x/dt^2 of every pair."""
    root = Pair(here.lam.u, jnp.ones_like(here.lam.u))
    first = times(here.free, root, here.lam.D)
    second = times(first, root, here.lam.D)
    rise = jnp.sum(first.v, axis=0) + sum(w[1] * w[2] for w in here.waves)
    bend = jnp.sum(second.v, axis=0) - sum(w[0] * w[2] ** 2 for w in here.waves)
    return rise, bend
