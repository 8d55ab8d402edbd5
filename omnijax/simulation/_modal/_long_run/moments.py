"""Means over a period in closed form: of rho, of its square, and of rho times a pole's response."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from .._poles import PolePairs
from ..arithmetic import Pair, exp_less_one, plus, product, sincos, summed, times, turned
from ..resonance import resonance
from .phases import PhaseCycle, Wave, follows, free_starts, ones
from .table_wave import table_level, table_line, table_square, table_work


class Moments(NamedTuple):
    """What the mean square asks of phases of like kinds."""

    work: Pair  # (p, s, c), R: mean of rho phi
    level: Float[Array, "s c"]  # mean of rho
    square: Float[Array, "s c"]  # mean of rho^2


def _integrals(x, time):
    """Integrals of cos(x t) and sin(x t) over [0, T]."""
    half = x * time / 2
    near = jnp.abs(half) < 5e-5
    s, c = sincos(half)
    over = jnp.where(near, time / 2 * (1 - half * half / 6), s / jnp.where(near, 1.0, x))
    return 2 * over * c, 2 * x * over * over


class _Overlap(NamedTuple):
    """Integrals of u times every cosine and sine of v, piece by piece, (w, k, s, c)."""

    cosine: Array
    sine: Array

    @classmethod
    def of(cls, u: Wave, v: Wave) -> "_Overlap":
        """Of sinusoids whose pieces are the same."""
        nu, mu = u.rate[:, None, None], v.rate[None, :, None]
        cosines, sines = _integrals(jnp.stack([nu - mu, nu + mu]), u.duration)
        (less, more), (low, high) = cosines / 2, sines / 2
        A, B = u.cosine[:, None], u.sine[:, None]
        cosine = A * (less + more) + B * (high + low)
        return cls(jnp.sum(cosine, axis=0), jnp.sum(A * (high - low) + B * (less - more), axis=0))


def _weighted(m: PolePairs, u: Wave) -> Pair:
    """Integral of rho_u exp(lambda tau) over every piece, (k, p, s, c)."""
    pole = m.l0, m.l1
    time, rate = u.duration[:, None], u.rate[:, None, None]
    less = exp_less_one(m.kind, (pole[0] * time, pole[1] * time))
    E = [(x + y)[None] for x, y in zip(less, ones(m), strict=True)]
    half, lead = (x[:, :, None] for x in sincos(u.rate[:, None] * u.duration / 2))
    s, off = 2 * half * lead, -2 * half * half  # sin, and cos - 1
    unit, share = ones(m), [x[:, None] for x in follows(m, u).slope]  # (w, 1, p, s, c)
    near = [x[None] + off * y for x, y in zip(less, E, strict=True)]  # E cos - 1
    near = product(m.kind, near, pole)
    over = [x + rate * s * y for x, y in zip(near, E, strict=True)]
    cosine = product(m.kind, over, share)
    lag = [rate * (y - x * (1 + off)) for x, y in zip(E, unit, strict=True)]
    lead = product(m.kind, E, pole)
    sine = product(m.kind, [x + s * y for x, y in zip(lag, lead, strict=True)], share)
    A, B = u.cosine[:, :, None], u.sine[:, :, None]
    first, second = (jnp.sum(A * x + B * y, axis=0) for x, y in zip(cosine, sine, strict=True))
    return first, second


def _work(m: PolePairs, u: Wave, both: _Overlap) -> Pair:
    """Mean of rho phi over the period; `both`: of the signal with itself."""
    r = follows(m, u)
    free = product(m.kind, free_starts(m, u, r), _weighted(m, u))
    # rho times level and slope of its sinusoids, all pieces
    level, slope = (jnp.sum(x, axis=1)[:, None] for x in turned(u.cosine, u.sine, *both))
    slope = u.rate[:, None] * slope
    works = [
        (summed(x) - summed(y)) / u.period for x, y in zip(free, r.lag(level, slope), strict=True)
    ]
    return works[0], works[1]


def _product(u: Wave, both: _Overlap):
    """Mean of rho^2 over the period; `both`: of the signal with itself."""
    return jnp.sum(u.cosine * both.cosine + u.sine * both.sine, axis=(0, 1)) / u.period


def _mean(u: Wave):
    """Mean of rho over the period."""
    cosine, sine = _integrals(u.rate[:, None], u.duration[None])
    return jnp.sum(u.cosine * cosine + u.sine * sine, axis=(0, 1)) / u.period


def _line(u: Wave, rate):
    """Mean over the period of rho cos(rate t) and of rho sin(rate t); t as in the signals."""
    still = Wave(u.duration, u.place, rate[None], u.cosine[:1], u.sine[:1])
    cosine, sine = (x[0] for x in _Overlap.of(u, still))
    s, c = sincos(rate * (u.begin - u.place))
    period = u.period
    return (
        jnp.sum(cosine * c - sine * s, axis=0) / period,
        jnp.sum(cosine * s + sine * c, axis=0) / period,
    )


class _Squares(NamedTuple):
    """Signals with edges whose means of quadratic forms add up to those of the phases' own."""

    wave: Wave  # of as many phases, or of three times as many
    share: Float[Array, "s c"] | None  # how much of a turn a pitch is, where there are both

    @classmethod
    def of(cls, cycle: PhaseCycle) -> "_Squares":
        """A damaged roller, which comes once a turn, falls on one of the profile's gaps.

        Twice its means with the profile's own are those of both together, less those of each.
        """
        if len(cycle.edged) == 1:
            return cls(cycle.edged[0], None)
        pitch, turn = cycle.edged
        share = pitch.period / turn.period
        both = [x + share * y for x, y in zip(pitch[-2:], turn[-2:], strict=True)]
        folded = pitch._replace(cosine=turn.cosine, sine=turn.sine)
        return cls(_side_by_side(Wave(*pitch[:-2], *both), folded, turn), share)

    def modes(self, m: PolePairs) -> PolePairs:
        """The modes of each of the signals, from those of all phases or of each."""
        if self.share is None or m.l0.shape[-2] == 1:
            return m
        l0, l1 = (jnp.concatenate([x] * 3, axis=-2) for x in (m.l0, m.l1))
        return m._replace(l0=l0, l1=l1)

    def total(self, x: Float[Array, "... s c"]) -> Float[Array, "... s c"]:
        """Of the phases, from what each of the signals has."""
        if self.share is None:
            return x
        both, folded, turn = jnp.split(x, 3, axis=-2)
        return both - self.share * self.share * folded + turn


def _side_by_side(*waves: Wave) -> Wave:
    return jax.tree.map(lambda *x: jnp.concatenate(x, axis=-2), *waves)


def moments_of(m: PolePairs, cycle: PhaseCycle) -> Moments:
    """Closed forms over the phases' periods; of `wide` modes, or of modes (p, s, c) of each."""
    zero = jnp.zeros_like(cycle.period)
    work, level, square = (0.0 * m.l0 + zero, 0.0 * m.l0 + zero), zero, zero
    if cycle.edged:
        own = _Squares.of(cycle)
        both = _Overlap.of(own.wave, own.wave)
        first, second = (own.total(x) for x in _work(own.modes(m), own.wave, both))
        work, level, square = (first, second), _level(cycle), own.total(_product(own.wave, both))
    if cycle.table is not None:
        work, level, square = table_work(m, cycle.table), _level(cycle), table_square(cycle.table)
    if cycle.endless:
        rate = cycle.endless[0].rate[0]
        half, across = _with_endless(cycle)
        cosine = sum(wave.cosine[0, 0] for wave in cycle.endless)
        level = level + jnp.where(rate == 0, cosine, 0.0)
        square = square + half + across
        gain = times(-1.0, resonance(m, rate).level)
        work = plus(work, times(half + across, gain))
    return Moments(work, level, square)


def rates_of(cycle: PhaseCycle, some: Bool[np.ndarray, "s 1"]) -> PhaseCycle:
    """With drho/dt in the place of rho, which has no jumps, of `some` of the phases.

    Phases with tables are those of wheels.
    """

    def turned(wave: Wave) -> Wave:
        rate = wave.rate[:, None]
        cosine = jnp.where(some, rate * wave.sine, wave.cosine)
        return wave._replace(cosine=cosine, sine=jnp.where(some, -rate * wave.cosine, wave.sine))

    edged, endless = (tuple(map(turned, waves)) for waves in (cycle.edged, cycle.endless))
    table = None if cycle.table is None else cycle.table.rates()
    return PhaseCycle(edged, endless, cycle.period, table)


def _level(cycle: PhaseCycle) -> Float[Array, "s c"]:
    """Mean over the phases' periods of the signals with edges, or of tables."""
    if cycle.table is not None:
        return table_level(cycle.table)
    return sum((_mean(wave) for wave in cycle.edged), jnp.zeros_like(cycle.period))


def _with_endless(cycle: PhaseCycle):
    """Means over the phases' periods of the endless signals' square, and of twice their product
    with the others.
    """
    rate, zero = cycle.endless[0].rate[0], jnp.zeros_like(cycle.period)
    cosine = sum((wave.cosine[0, 0] for wave in cycle.endless), zero)
    sine = sum((wave.sine[0, 0] for wave in cycle.endless), zero)
    across = zero
    if cycle.edged or cycle.table is not None:
        a, b = _shared(cycle, rate)
        across = 2 * (cosine * a + sine * b)
    still = rate == 0
    own = jnp.where(still, cosine * cosine, (cosine * cosine + sine * sine) / 2)
    return own, jnp.where(still, 2 * cosine * _level(cycle), across)


def _shared(cycle: PhaseCycle, rate: Float[Array, "s c"]):
    """Means of all signals with edges, or of tables, times cos(rate t) and sin(rate t).

    Over a turn: nothing of a signal that repeats more than once in it.
    """
    if cycle.table is not None:
        once = cycle.table.period > 0.6 * cycle.period
        return [jnp.where(once, x, 0.0) for x in table_line(cycle.table, rate)]
    count = len(cycle.edged)
    every, period = _side_by_side(*cycle.edged), jnp.concatenate([cycle.period] * count)
    once = every.period > 0.6 * period
    lines = _line(every, jnp.concatenate([rate] * count))
    return [summed(jnp.stack(jnp.split(jnp.where(once, x, 0.0), count))) for x in lines]
