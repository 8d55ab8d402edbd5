"""Outputs of the long run along each phase in closed form at any time."""

import functools
from collections.abc import Callable
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .arithmetic import (
    Pair,
    flushed,
    materialised,
    pair_exp,
    product,
    sincos,
    stored,
    summed,
    turned,
)
from .phases import PhaseCycle, Wave, follows, free_starts, given, wide
from .poles import PolePairs


class OutputRows(NamedTuple):
    """What some outputs show: of pairs, of each phase's rho and of its rate."""

    c0: Float[Array, "r p c"]
    c1: Float[Array, "r p c"]
    direct: Float[Array, "r s c"]
    slope: Float[Array, "r s c"]


class ModalCurves(NamedTuple):
    """Some outputs of phases of like kinds."""

    kind: Float[Array, "p 1 c"]
    pole: Pair  # (p, 1, c)
    rows: OutputRows
    cycle: PhaseCycle
    free: tuple[Pair, ...]  # of each signal with edges: (k, p, s, c) at the begin of its pieces
    cosine: tuple[Array, ...]  # of each signal: (r, w, k, s, c)
    sine: tuple[Array, ...]

    @property
    def waves(self) -> tuple[Wave, ...]:
        """All signals, those with edges first."""
        return *self.cycle.edged, *self.cycle.endless


def curves_of(
    m: PolePairs, cycle: PhaseCycle, columns: np.ndarray, rows: OutputRows
) -> ModalCurves:
    """The outputs `rows` of the phases of a cycle."""
    b, m = given(m, columns), wide(m)
    c = rows.c0[:, None, :, None], rows.c1[:, None, :, None]
    free, cosines, sines = [], [], []
    for wave in (*cycle.edged, *cycle.endless):
        r = follows(m, wave)
        if len(wave.duration) > 1:
            y = product(m.kind, free_starts(m, wave, r), b)
            free.append((flushed(y[0]), flushed(y[1])))
        level, turn = (
            gain[:, None] - summed(c[0] * z[0] + c[1] * z[1], 2)
            for gain, z in zip(
                (rows.direct, rows.slope), (product(m.kind, x, b) for x in r), strict=True
            )
        )
        level, turn = level[:, :, None], (wave.rate * turn)[:, :, None]  # (r, w, 1, s, c)
        cosine, sine = turned(wave.cosine, wave.sine, level, turn)
        cosines.append(cosine)
        sines.append(sine)
    return ModalCurves(m.kind, (m.l0, m.l1), rows, cycle, tuple(free), tuple(cosines), tuple(sines))


def weights(f: ModalCurves, z: Pair) -> Pair:
    """What the outputs show of states that move on from z (p, s, c): (r, p, s, c) each."""
    k, c0, c1 = f.kind > 0, f.rows.c0[:, :, None], f.rows.c1[:, :, None]
    return (
        c0 * z[0] + jnp.where(k, c1 * z[1], 0.0),
        c1 * jnp.where(k, z[0], z[1]) - jnp.where(k, c0 * z[1], 0.0),
    )


def values_at(f: ModalCurves, time: Float[Array, "s c"], orders: int = 1) -> list[Array]:
    """The outputs (r, s, c) at a time and their first `orders - 1` derivatives, stored."""
    return materialised(lambda f, time: _values_at(f, time, orders), f, time)


def _values_at(f: ModalCurves, time, orders: int) -> list[Array]:
    values = [jnp.zeros((len(f.rows.c0), *time.shape)) for _ in range(orders)]
    for i, wave in enumerate(f.waves):
        here, into = _piece_at(wave, time)
        s, c = stored(lambda rate, into: sincos(rate * into), wave.rate, into)
        a, b = (summed(here * x[i], 2) for x in (f.cosine, f.sine))
        value, slope = turned(a, b, c, s)
        swing = [value, slope * wave.rate, -value * wave.rate**2]
        for n in range(orders):
            values[n] = values[n] + summed(swing[n], 1)
        if i < len(f.free):
            start = [summed(here[:, None] * y) for y in f.free[i]]
            z = stored(_moved, f.kind, f.pole, into, *start)
            for n in range(orders):
                seen = f.rows.c0[:, :, None] * z[0] + f.rows.c1[:, :, None] * z[1]
                values[n] = values[n] + summed(seen, 1)
                z = product(f.kind, z, f.pole)
    return values


def _moved(kind, pole: Pair, into, *start) -> Pair:
    kind = jnp.broadcast_to(kind, start[0].shape)
    return product(kind, start, pair_exp(kind, (pole[0] * into, pole[1] * into)))


def _piece_at(wave: Wave, time):
    """A one at the piece (k, s, c) that each signal is on, and the time since it began."""
    begin = wave.begin
    if len(begin) == 1:
        return jnp.ones_like(begin), time
    local = jnp.mod(time + wave.place, wave.period)
    piece = summed(jnp.where(local >= begin[1:], 1, 0))
    here = jnp.where(jnp.arange(len(begin))[:, None, None] == piece, 1.0, 0.0)
    return here, local - summed(here * begin)


def recombined(f: ModalCurves, rows: Callable) -> ModalCurves:
    """Outputs linear in those of f: `rows(x)` of x (r, ..., c)."""
    own = f.rows._replace(c0=rows(f.rows.c0), c1=rows(f.rows.c1))
    cosine, sine = (tuple(rows(x) for x in each) for each in (f.cosine, f.sine))
    return f._replace(rows=own, cosine=cosine, sine=sine)


def towards(f: ModalCurves, d: Float[Array, "n o c"]) -> ModalCurves:
    """The outputs along directions d."""

    def rows(x):
        each = d.reshape(*d.shape[:2], *(1,) * (x.ndim - 2), -1)
        return sum(each[:, o] * x[o] for o in range(d.shape[1]))

    return recombined(f, rows)


def free_size(f: ModalCurves, w: Pair) -> Float[Array, "r p s c"]:
    """What the free parts of weights w never exceed from there on."""
    a, b = (jnp.abs(x) for x in w)
    return jnp.where(f.kind > 0, jnp.sqrt(a * a + b * b), a + b)


def size_of(f: ModalCurves) -> Float[Array, "r s c"]:
    """Above the size of every output."""
    total = jnp.zeros((1, 1, 1))
    for y in f.free:
        each = [jnp.sum(free_size(f, weights(f, z)), axis=1) for z in zip(*y, strict=True)]
        total = total + functools.reduce(jnp.maximum, each)
    for a, b in zip(f.cosine, f.sine, strict=True):
        total = total + jnp.max(jnp.sum(jnp.sqrt(a * a + b * b), axis=1), axis=1)
    return total
