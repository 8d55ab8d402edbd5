"""The periodic response of pairs of poles to measured tables, piece by piece of their splines.

On a piece of T s with rho = sum_j rho_j v^j/j! a time v after its begin (see `_tables.response`)

    z(T) = exp(lambda T) z + sum_j rho_j F_j,    F_j = T^(j + 1) phi_(j + 1)(lambda T)

The response is z one period later, so it begins with what a period forces from rest over
1 - exp(lambda P).  With Z_n the n-fold integral of z from the piece's begin on,

    int rho z dv = sum_i rho_i sum_l (-1)^l T^(i - l)/(i - l)! Z_(l + 1)(T)
    Z_n(T) = T^n phi_n(lambda T) z + sum_j rho_j T^(j + 1 + n) phi_(j + 1 + n)(lambda T)

Nothing cancels however slow or fast a pole is.  Derivatives by durations are those by time.
"""

import functools
import itertools
import math
import operator
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._poles import PolePairs
from .._tables import forced_on, moved, phis, rate_of
from ..arithmetic import Pair, exp_less_one, materialised, plus, product, quotient, sincos, times
from ..table_signals import DEGREE, TableSignals, moved_on

POWERS = DEGREE + 1
MOST = 2 * POWERS  # the highest phi that means of products ask for


class TableWave(NamedTuple):
    """The table of each phase, pieces (k) in the order in which the wheel passes them."""

    duration: Float[Array, "k s c"]  # s
    rho: Float[Array, "k 4 s c"]  # m, m/s, ...: rho and its derivatives by time as pieces begin

    @classmethod
    def of(cls, tables: TableSignals, numbers: tuple[int, ...]) -> "TableWave":
        """The tables of these numbers."""
        index = np.array(numbers)
        duration, rho = tables.duration[index], tables.rho[index]
        return cls(jnp.swapaxes(duration, 0, 1), jnp.transpose(rho, (2, 1, 0, 3)))

    @property
    def period(self) -> Float[Array, "s c"]:
        """s."""
        return jnp.sum(self.duration, axis=0)

    @property
    def begin(self) -> Float[Array, "k s c"]:
        """s, of each piece."""
        return jnp.cumsum(self.duration, axis=0) - self.duration

    def rates(self) -> "TableWave":
        """drho/dt in the place of rho."""
        rho = jnp.concatenate([self.rho[:, 1:], jnp.zeros_like(self.rho[:, :1])], axis=1)
        return TableWave(self.duration, rho)


class TablePlace(NamedTuple):
    """What is on at a time, and how long after the begin of its piece that is."""

    piece: Array  # (s, c)
    into: Float[Array, "s c"]  # s

    @classmethod
    def at(cls, wave: TableWave, time: Float[Array, "s c"]) -> "TablePlace":
        """That time; its derivative is that of a time since the last period's begin."""
        period = jax.lax.stop_gradient(wave.period)
        local = time - jnp.floor(jax.lax.stop_gradient(time) / period) * period
        begin = wave.begin
        last = jnp.maximum(jnp.sum(begin <= local, axis=0), 1) - 1
        return cls(last, local - at_piece(begin, last))


def at_piece(x: Float[Array, "k ... s c"], piece) -> Float[Array, "... s c"]:
    """x of the piece (s, c) that each is on."""
    middle = tuple(range(1, x.ndim - 2))
    return jnp.take_along_axis(x, jnp.expand_dims(piece[None], middle), axis=0)[0]


def _powers(v, count: int) -> list[Array]:
    """v, v^2, ..., v^count."""
    return list(itertools.accumulate([v] * count, operator.mul))


def _with_time(x: Pair, v, rate: Pair) -> Pair:
    """x with its derivative by v, which it was worked out without."""
    still = jax.lax.stop_gradient
    more = v - still(v)
    return x[0] + more * still(rate[0]), x[1] + more * still(rate[1])


def passed(kind, pole: Pair, z: Pair, v, rho: Float[Array, "4 s c"]) -> Pair:
    """z a time v later on a piece that has rho at first."""
    end, _ = moved(kind, *pole, z, jax.lax.stop_gradient(v), rho)
    return _with_time(end, v, rate_of(kind, pole, end, moved_on(rho, v)[0]))


def starts_of(m: PolePairs, wave: TableWave) -> Pair:
    """z of the periodic response where every piece begins, (k, p, s, c), for a unit of rho.

    Of `wide` modes, or of modes (p, s, c) of each phase.
    """
    kind, pole = m.kind, (m.l0, m.l1)
    none = 0.0 * m.l0 + jnp.zeros_like(wave.period)

    @jax.checkpoint
    def onward(state, piece):
        z, decayed = state
        v, rho = piece

        def both(*x):
            return [jax.lax.complex(*y) for y in moved(*x)]

        end, over = (
            (x.real, x.imag)
            for x in materialised(both, kind, *pole, z, jax.lax.stop_gradient(v), rho)
        )
        end = _with_time(end, v, rate_of(kind, pole, end, moved_on(rho, v)[0]))
        over = _with_time(over, v, product(kind, pole, over))
        return (end, product(kind, decayed, over)), state

    rest = (none, none), (none + 1.0, jnp.where(kind > 0, 0.0, none + 1.0))
    (end, _), (z, decayed) = jax.lax.scan(onward, rest, (wave.duration, wave.rho))
    less = exp_less_one(kind, times(wave.period, pole))
    first = quotient(kind, end, times(-1.0, less))
    return plus(z, product(kind, decayed, first))


def table_level(wave: TableWave) -> Float[Array, "s c"]:
    """Mean of rho."""
    each = zip(jnp.swapaxes(wave.rho, 0, 1), _powers(wave.duration, POWERS), strict=True)
    terms = (rho * x / math.factorial(j + 1) for j, (rho, x) in enumerate(each))
    return jnp.sum(functools.reduce(operator.add, terms), axis=0) / wave.period


def _square(v, rho) -> Float[Array, "s c"]:
    """Integral of the square of sum_j rho_j v^j/j!."""
    powers, each = _powers(v, 2 * len(rho) - 1), []
    for i, x in enumerate(rho):
        for j, y in enumerate(rho):
            n = math.factorial(i) * math.factorial(j) * (i + j + 1)
            each.append(x * y * powers[i + j] / n)
    return functools.reduce(operator.add, each)


def _work(kind, pole: Pair, z: Pair, v, rho) -> Pair:
    """Integral of rho times the response over a piece that begins with z."""
    still = jax.lax.stop_gradient(v)
    phi, powers = phis(kind, times(still, pole), MOST), _powers(still, MOST)

    def force(n: int) -> Pair:
        return times(powers[n - 1], phi[n])

    def integral(n: int) -> Pair:
        terms = (times(r, force(j + 1 + n)) for j, r in enumerate(rho))
        return functools.reduce(plus, terms, product(kind, force(n), z))

    Z = [integral(n) for n in range(1, POWERS + 1)]
    ones = [jnp.ones_like(v), *powers]
    # sum_i rho_i (-1)^l T^(i - l)/(i - l)!, of each l
    share = [
        (-1) ** n
        * functools.reduce(
            operator.add, (rho[i] * ones[i - n] / math.factorial(i - n) for i in range(n, POWERS))
        )
        for n in range(POWERS)
    ]
    total = functools.reduce(plus, (times(x, y) for x, y in zip(share, Z, strict=True)))
    end = forced_on(kind, z, phi[0], [force(n) for n in range(1, POWERS + 1)], rho)
    return _with_time(total, v, times(moved_on(rho, v)[0], end))


def table_work(m: PolePairs, wave: TableWave) -> Pair:
    """Mean of rho times the response, (p, s, c).

    Of `wide` modes, or of modes (p, s, c) of each phase.
    """
    kind, pole = m.kind, (m.l0, m.l1)

    @jax.checkpoint
    def one(total, piece):
        z, v, rho = piece
        return plus(total, _work(kind, pole, z, v, rho)), None

    none = 0.0 * m.l0 + jnp.zeros_like(wave.period)
    each = starts_of(m, wave), wave.duration, wave.rho
    work, _ = jax.lax.scan(one, (none, none), each)
    return times(1 / wave.period, work)


def table_square(wave: TableWave) -> Float[Array, "s c"]:
    """Mean of the square of rho."""
    square = jnp.sum(_square(wave.duration, jnp.swapaxes(wave.rho, 0, 1)), axis=0)
    return square / wave.period


def table_line(wave: TableWave, rate: Float[Array, "s c"]) -> list[Array]:
    """Means over the period of rho cos(rate t) and rho sin(rate t)."""
    kind = jnp.ones_like(wave.duration)
    phi = phis(kind, (0.0 * wave.duration, wave.duration * rate))
    powers, rho = _powers(wave.duration, POWERS), jnp.swapaxes(wave.rho, 0, 1)
    s, c = sincos(wave.begin * rate)
    total = (0.0 * wave.duration, 0.0 * wave.duration)
    for i, r in enumerate(rho):  # of s^i/i! exp(a s) over [0, 1]: sum_l (-1)^l phi_(l + 1)/(i - l)!
        for n in range(i + 1):
            share = (-1) ** n * r * powers[i] / math.factorial(i - n)
            total = plus(total, times(share, phi[n + 1]))
    first, second = product(kind, total, (c, s))
    return [jnp.sum(x, axis=0) / wave.period for x in (first, second)]
