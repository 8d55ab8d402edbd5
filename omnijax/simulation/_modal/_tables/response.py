"""How pairs of poles respond to a table from rest, at any time in closed form.

On a piece that begins at z, with rho = sum_j rho_j v^j/j! a time v after, dz/dt = lambda z + rho is

    z(v) = exp(lambda v) z + sum_j rho_j v^(j + 1) phi_(j + 1)(lambda v)

which cancels nothing, however slow a pole is beside the pieces.  With psi(u) the response from rest
that far into a period, n periods of T leave exp(lambda u) psi(T) (1 - q^n)/(1 - q) beside psi(u),
q = exp(lambda T).

Source: Higham, Functions of Matrices, 10.7.4 (phi functions).
"""

import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..arithmetic import Pair, pair_exp, plus, product, quotient, times
from ..table_signals import DEGREE, TableSignals, moved_on
from .._transient import repeated

SMALL = 0.25  # |lambda v| below which phi_4 is a series: its closed form cancels to 1e-12 there
TERMS = 9  # of that series, the next one of which is below 1e-13


class PolesAlone(NamedTuple):
    """Pairs of poles of one design."""

    kind: Float[Array, "p 1"]
    l0: Float[Array, "p 1"]
    l1: Float[Array, "p 1"]


class Knots(NamedTuple):
    """One table and the pairs of one design where its pieces begin, from rest."""

    begin: Float[Array, " k"]  # s
    rho: Float[Array, "4 k"]
    z: Pair  # (p, k)
    period: Float[Array, ""]  # s
    end: Pair  # (p, 1), after a period


class TableResponse(NamedTuple):
    """rho with its derivatives, and the response of the pairs to it."""

    rho: Float[Array, "4 t"]
    z: Pair  # (p, t)


def phis(kind, a: Pair) -> list[Pair]:
    """phi_0 = exp(a), phi_1, ..., phi_4 of pairs."""
    one = jnp.ones_like(a[0]), jnp.where(kind > 0, 0.0, jnp.ones_like(a[0]))
    k = kind > 0
    size = jnp.where(k, jnp.abs(a[0]) + jnp.abs(a[1]), jnp.abs(a[0]))
    small = size < SMALL, jnp.where(k, size, jnp.abs(a[1])) < SMALL

    def chosen(yes, no) -> Pair:
        return jnp.where(small[0], yes[0], no[0]), jnp.where(small[1], yes[1], no[1])

    near, far = chosen(a, times(0.0, one)), chosen(one, a)
    series = times(1 / math.factorial(TERMS + 3), one)
    for n in range(TERMS - 1, 0, -1):
        series = plus(times(1 / math.factorial(n + 3), one), product(kind, series, near))
    square, power = product(kind, far, far), pair_exp(kind, a)
    rest = plus(power, times(-1.0, plus(plus(one, far), times(0.5, square))))
    rest = plus(rest, times(-1 / 6, product(kind, square, far)))
    last = chosen(series, quotient(kind, rest, product(kind, square, square)))
    return [power, *_below(kind, a, one, last)]


def _below(kind, a: Pair, one: Pair, last: Pair) -> list[Pair]:
    """phi_1, ..., phi_4 from phi_4: phi_j = a phi_(j + 1) + 1/j!."""
    each = [last]
    for j in range(DEGREE, 0, -1):
        each.append(plus(product(kind, a, each[-1]), times(1 / math.factorial(j), one)))
    return each[::-1]


def _forced(rho, v, phi: list[Pair]) -> Pair:
    """What a piece has forced from rest a time v after it began."""
    first = second = jnp.zeros_like(phi[1][0])
    power = v
    for j in range(DEGREE + 1):
        first, second = plus((first, second), times(rho[j] * power, phi[j + 1]))
        power = power * v
    return first, second


def knots_of(m: PolesAlone, duration: Float[Array, " k"], rho: Float[Array, "4 k"]) -> Knots:
    """The begins of the pieces of one table, from rest."""
    phi = phis(m.kind, times(duration, (m.l0, m.l1)))
    forced, kind = _forced(rho, duration, phi), m.kind[:, 0]

    def on(z: Pair, step) -> tuple[Pair, Pair]:
        over, more = step
        return plus(product(kind, z, over), more), z

    none = jnp.zeros_like(kind)
    steps = jax.tree.map(jnp.transpose, (phi[0], forced))
    end, z = jax.lax.scan(on, (none, none), steps)
    after = jnp.cumsum(duration)
    first, second = (x.T for x in z)
    begin = jnp.concatenate([jnp.zeros(1), after[:-1]])
    return Knots(begin, rho, (first, second), after[-1], (end[0][:, None], end[1][:, None]))


def response_at(m: PolesAlone, knots: Knots, time: Float[Array, " t"]) -> TableResponse:
    """The response from rest at times (s) since the start."""
    kind, pole = m.kind, (m.l0, m.l1)
    many = jax.lax.stop_gradient(jnp.floor(time / knots.period))
    into = jnp.maximum(time - many * knots.period, 0.0)
    piece = jax.lax.stop_gradient(jnp.searchsorted(knots.begin, into, side="right") - 1)
    v, rho = into - knots.begin[piece], knots.rho[:, piece]
    phi = phis(kind, times(v, pole))
    at = knots.z[0][:, piece], knots.z[1][:, piece]
    own = plus(product(kind, at, phi[0]), _forced(rho, v, phi))
    left = product(kind, knots.end, pair_exp(kind, times(into, pole)))
    left = product(kind, left, repeated(kind, times(knots.period, pole), jnp.maximum(many, 1.0)))
    earlier = many > 0
    z = plus(own, (jnp.where(earlier, left[0], 0.0), jnp.where(earlier, left[1], 0.0)))
    return TableResponse(moved_on(rho, v), z)
