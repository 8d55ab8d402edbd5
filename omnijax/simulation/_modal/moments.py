"""Means over a period in closed form: of rho, of its square, and of rho times a pole's response."""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from .arithmetic import Pair, exp_less_one, plus, product, sincos, summed, times, turned
from .phases import PhaseCycle, Wave, follows, free_starts, ones, wide
from .poles import PolePairs
from .resonance import resonance


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


def _work(m: PolePairs, u: Wave, v: Wave, both: _Overlap) -> Pair:
    """Mean of rho_u phi_v over their common period; their pieces are the same."""
    r = follows(m, v)
    free = product(m.kind, free_starts(m, v, r), _weighted(m, u))
    # rho_u times level and slope of v's sinusoids, all pieces
    level, slope = (jnp.sum(x, axis=1)[:, None] for x in turned(v.cosine, v.sine, *both))
    slope = v.rate[:, None] * slope
    works = [
        (summed(x) - summed(y)) / u.period for x, y in zip(free, r.lag(level, slope), strict=True)
    ]
    return works[0], works[1]


def _product(v: Wave, both: _Overlap):
    """Mean of rho_u rho_v over their common period; their pieces are the same."""
    return jnp.sum(v.cosine * both.cosine + v.sine * both.sine, axis=(0, 1)) / v.period


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


def moments_of(m: PolePairs, cycle: PhaseCycle) -> Moments:
    """Closed forms over the phases' periods; of plain modes."""
    m = wide(m)
    zero = jnp.zeros_like(cycle.period)
    work, level, square = (0.0 * m.l0 + zero, 0.0 * m.l0 + zero), zero, zero
    for wave in cycle.edged:
        own = _Overlap.of(wave, wave)
        work = plus(work, _work(m, wave, wave, own))
        level, square = level + _mean(wave), square + _product(wave, own)
    if len(cycle.edged) > 1:  # a damaged roller falls on one of the profile's gaps
        pitch, turn = cycle.edged
        folded = turn._replace(duration=pitch.duration)
        share = pitch.period / turn.period
        there, back = _Overlap.of(pitch, folded), _Overlap.of(folded, pitch)
        both = plus(_work(m, pitch, folded, there), _work(m, folded, pitch, back))
        work = plus(work, times(share, both))
        square = square + 2 * share * _product(folded, there)
    if cycle.endless:
        rate = cycle.endless[0].rate[0]
        half, across = _with_endless(cycle)
        cosine = sum(wave.cosine[0, 0] for wave in cycle.endless)
        level = level + jnp.where(rate == 0, cosine, 0.0)
        square = square + half + across
        gain = times(-1.0, resonance(m, rate).level)
        work = plus(work, times(half + across, gain))
    return Moments(work, level, square)


def slope_square(cycle: PhaseCycle) -> Float[Array, "s c"]:
    """Mean of the square of drho/dt over the phases' periods; rho has no jumps."""
    turned = [
        wave._replace(cosine=wave.rate[:, None] * wave.sine, sine=-wave.rate[:, None] * wave.cosine)
        for wave in cycle.edged
    ]
    square = sum(
        (_product(wave, _Overlap.of(wave, wave)) for wave in turned), jnp.zeros_like(cycle.period)
    )
    if len(turned) > 1:
        pitch, turn = turned
        folded = turn._replace(duration=pitch.duration)
        both = _Overlap.of(pitch, folded)
        square = square + 2 * pitch.period / turn.period * _product(folded, both)
    if cycle.endless:
        half, across = _with_endless(cycle)
        square = square + cycle.endless[0].rate[0] ** 2 * (half + across)
    return square


def _with_endless(cycle: PhaseCycle):
    """Means over the phases' periods of the endless signals' square, and of twice their product
    with the others.
    """
    rate, zero = cycle.endless[0].rate[0], jnp.zeros_like(cycle.period)
    cosine = sum((wave.cosine[0, 0] for wave in cycle.endless), zero)
    sine = sum((wave.sine[0, 0] for wave in cycle.endless), zero)
    lines = [_shared(wave, cycle.period, rate) for wave in cycle.edged]
    across = sum((2 * (cosine * a + sine * b) for a, b in lines), zero)
    still = rate == 0
    level = 2 * cosine * sum((_mean(w) for w in cycle.edged), zero)
    own = jnp.where(still, cosine * cosine, (cosine * cosine + sine * sine) / 2)
    return own, jnp.where(still, level, across)


def _shared(wave: Wave, period, rate):
    """`_line` over a turn: nothing where the signal repeats more than once in it."""
    once = wave.period > 0.6 * period
    cosine, sine = _line(wave, rate)
    return jnp.where(once, cosine, 0.0), jnp.where(once, sine, 0.0)
