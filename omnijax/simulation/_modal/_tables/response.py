"""How pairs of poles respond to a table from rest, at any time in closed form.

On a piece that begins at z, with rho = sum_j rho_j v^j/j! a time v after, dz/dt = lambda z + rho is

    z(v) = exp(lambda v) z + sum_j rho_j v^(j + 1) phi_(j + 1)(lambda v)

which cancels nothing, however slow or fast a pole is beside the pieces.  With psi(u) the response
from rest that far into a period and q = exp(lambda T), n periods of T leave beside psi(u)

    exp(lambda u) psi(T) (1 - q^n)/(1 - q) = (exp(lambda u) - exp(lambda t)) psi(T)/(1 - q)

of which the second form is quicker; the first keeps its digits where q is near 1.

Source: Higham, Functions of Matrices, 10.7.4 (phi functions).
"""

import functools
import itertools
import math
import operator
from collections.abc import Callable, Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from .._transient import repeated
from ..arithmetic import (
    Pair,
    exp_less_one,
    materialised,
    pair_exp,
    plus,
    product,
    quotient,
    stored,
    times,
)
from ..table_signals import DEGREE, moved_on

# |lambda v| below which the highest phi is a series, as others lose 12 bits of it there, and terms
# of that series, the next one of which is below 1e-13
SERIES = {DEGREE + 1: (0.25, 9), 2 * DEGREE + 2: (1.5, 15)}
RESONANT = 1e-3  # |1 - q| below which digits would be lost


class PolesAlone(NamedTuple):
    """Pairs of poles of one design."""

    kind: Float[Array, "p 1"]
    l0: Float[Array, "p 1"]
    l1: Float[Array, "p 1"]


class Knots(NamedTuple):
    """One table and the pairs of one design where its pieces begin, from rest."""

    begin: Float[Array, " k"]  # s
    rho: Float[Array, "4 k"]
    z: Pair  # (p, k), with exp(lambda begin) times `lasting` unless `resonant`
    period: Float[Array, ""]  # s
    end: Pair  # (p, 1), after a period
    lasting: Pair  # (p, 1): psi(T)/(1 - q), not used where `resonant`
    resonant: Bool[Array, ""]  # whether some |1 - q| is below `RESONANT`


class TableResponse(NamedTuple):
    """rho with its derivatives, and the response of the pairs to it."""

    rho: Float[Array, "4 t"]
    z: Pair  # (p, t)


def phis(kind, a: Pair, highest: int = DEGREE + 1) -> list[Pair]:
    """phi_0 = exp(a), phi_1, ..., the `highest` of pairs."""
    limit, terms = SERIES[highest]
    one = jnp.ones_like(a[0]), jnp.where(kind > 0, 0.0, jnp.ones_like(a[0]))
    k = kind > 0
    size = jnp.where(k, jnp.abs(a[0]) + jnp.abs(a[1]), jnp.abs(a[0]))
    small = size < limit, jnp.where(k, size, jnp.abs(a[1])) < limit

    def chosen(yes, no) -> Pair:
        return jnp.where(small[0], yes[0], no[0]), jnp.where(small[1], yes[1], no[1])

    near, far = chosen(a, times(0.0, one)), chosen(one, a)
    last = times(1 / math.factorial(terms - 1 + highest), one)
    for n in range(terms - 1, 0, -1):
        last = plus(times(1 / math.factorial(n - 1 + highest), one), product(kind, last, near))
    below = [last]  # phi_j = a phi_(j + 1) + 1/j!
    for j in range(highest - 1, 0, -1):
        below.append(plus(product(kind, near, below[-1]), times(1 / math.factorial(j), one)))
    power, inverse = pair_exp(kind, a), quotient(kind, one, far)
    above = [power]  # phi_(j + 1) = (phi_j - 1/j!)/a
    for j in range(highest):
        less = plus(above[-1], times(-1 / math.factorial(j), one))
        above.append(product(kind, less, inverse))
    return [power, *(chosen(x, y) for x, y in zip(below[::-1], above[1:], strict=True))]


def unit_moves(kind, pole: Pair, v) -> tuple[Pair, list[Pair]]:
    """exp(lambda v), and what units of rho and of its derivatives force from rest."""
    over, *phi = phis(kind, times(v, pole))
    power = itertools.accumulate([v] * len(phi), operator.mul)
    return over, [times(x, y) for x, y in zip(power, phi, strict=True)]


def forced_on(kind, z: Pair, over: Pair, forces: Sequence[Pair], rho) -> Pair:
    """z on the way from z on a piece that begins with rho (4, ...), by its `unit_moves`."""
    each = (times(x, force) for x, force in zip(rho, forces, strict=True))
    return functools.reduce(plus, each, product(kind, z, over))


def rate_of(kind, pole: Pair, z: Pair, rho) -> Pair:
    """dz/dt = lambda z + rho."""
    return plus(product(kind, pole, z), (rho, jnp.where(kind > 0, 0.0, rho)))


def moved(kind, l0, l1, z: Pair, v, rho) -> tuple[Pair, Pair]:
    """z(v) from z on a piece that begins with rho (4, ...), and exp(lambda v)."""
    over, forces = unit_moves(kind, (l0, l1), v)
    return forced_on(kind, z, over, forces, rho), over


@jax.custom_jvp
def _moved_by_fixed(kind, l0, l1, z: Pair, v, rho) -> tuple[Pair, Pair]:
    """`moved` by poles that are not differentiated, with d/dv = lambda z + rho of z."""
    return moved(kind, l0, l1, z, v, rho)


@_moved_by_fixed.defjvp
def _(primals, tangents):
    kind, *pole, z, v, rho = primals
    *_, dz, dv, drho = tangents

    def parts(kind, l0, l1, z: Pair, v, rho) -> list[Array]:
        over, forces = unit_moves(kind, (l0, l1), v)
        end = forced_on(kind, z, over, forces, rho)
        rate = rate_of(kind, (l0, l1), end, moved_on(rho, v)[0])
        turn = product(kind, (l0, l1), over)
        return [jax.lax.complex(*x) for x in (end, over, rate, turn, *forces)]

    each = materialised(parts, kind, *pole, z, v, rho)
    end, over, rate, turn, *forces = ((x.real, x.imag) for x in each)
    by_rho = (times(x, force) for x, force in zip(drho, forces, strict=True))
    start = plus(product(kind, dz, over), times(dv, rate))
    return (end, over), (functools.reduce(plus, by_rho, start), times(dv, turn))


def _stored(*args) -> tuple[Pair, Pair]:
    """`moved`, stored."""
    each = materialised(lambda *a: [jax.lax.complex(*x) for x in moved(*a)], *args)
    (first, over), (second, turn) = ([x.real for x in each], [x.imag for x in each])
    return (first, second), (over, turn)


def moving(fixed: bool) -> Callable:
    """How pairs move along a piece, where poles are `fixed` or differentiated."""
    return _moved_by_fixed if fixed else _stored


def knots_of(
    m: PolesAlone,
    duration: Float[Array, " k"],
    rho: Float[Array, "4 k"],
    until,
    fixed: bool = False,
) -> Knots:
    """The begins of the pieces of one table, from rest, for times up to `until` (s).

    What comes later counts as nothing, as a pole that grows may be without bound there.  `fixed`:
    see `moving`.
    """
    after = jnp.cumsum(duration)
    begin = jnp.concatenate([jnp.zeros(1), after[:-1]])
    left = until - begin
    reached = jnp.where(left >= duration, duration, jnp.maximum(left, 0.0))
    rest = jnp.zeros((len(m.kind), len(duration)))
    forced, over = moving(fixed)(*m, (rest, rest), reached, rho)
    kind = m.kind[:, 0]

    def on(z: Pair, step) -> tuple[Pair, Pair]:
        over, more = step
        return plus(product(kind, z, over), more), z

    steps = jax.tree.map(jnp.transpose, (over, forced))
    end, z = jax.lax.scan(on, (jnp.zeros_like(kind), jnp.zeros_like(kind)), steps)
    end = end[0][:, None], end[1][:, None]
    span = jnp.where(after[-1] <= until, after[-1], until)
    less = exp_less_one(m.kind, times(span, (m.l0, m.l1)))  # q - 1
    complex_, (first, second) = m.kind > 0, (jnp.abs(x) for x in less)
    size = jnp.where(complex_, first + second, jnp.minimum(first, second))
    resonant = jnp.any(size < RESONANT)
    safe = jnp.where(resonant, -1.0, less[0]), jnp.where(resonant, complex_ - 1.0, less[1])
    lasting = quotient(m.kind, times(-1.0, end), safe)

    def started(kind, l0, l1, z: Pair, lasting: Pair) -> Pair:
        early = jnp.minimum(begin, until)
        return plus(z, product(kind, lasting, pair_exp(kind, times(early, (l0, l1)))))

    z = z[0].T, z[1].T
    every = stored(started, *m, z, lasting)
    first, second = (jnp.where(resonant, x, y) for x, y in zip(z, every, strict=True))
    return Knots(begin, rho, (first, second), after[-1], end, lasting, resonant)


def decay_at(m: PolesAlone, time: Float[Array, " t"]) -> Pair:
    """exp(lambda t) of every pair, (p, t)."""
    return stored(lambda kind, l0, l1: pair_exp(kind, times(time, (l0, l1))), *m)


def response_at(
    m: PolesAlone, knots: Knots, time: Float[Array, " t"], decay: Pair, fixed: bool = False
) -> TableResponse:
    """The response from rest at times (s) since the start, of the poles' `decay_at` them.

    `fixed`: see `moving`.
    """
    many = jax.lax.stop_gradient(jnp.floor(time / knots.period))
    into = time - many * knots.period
    into = into + jax.lax.stop_gradient(jnp.maximum(-into, 0.0))  # its slope by the period stays
    piece = jax.lax.stop_gradient(jnp.searchsorted(knots.begin, into, side="right") - 1)
    v, rho = into - knots.begin[piece], knots.rho[:, piece]
    at = knots.z[0][:, piece], knots.z[1][:, piece]
    here, _ = moving(fixed)(*m, at, v, rho)

    def left(many, into, decay) -> Pair:
        each = product(m.kind, knots.end, pair_exp(m.kind, times(into, (m.l0, m.l1))))
        sums = repeated(m.kind, times(knots.period, (m.l0, m.l1)), jnp.maximum(many, 1.0))
        first, second = product(m.kind, each, sums)
        return jnp.where(many > 0, first, 0.0), jnp.where(many > 0, second, 0.0)

    def ended(many, into, decay) -> Pair:
        return times(-1.0, product(m.kind, knots.lasting, decay))

    before = jax.lax.cond(knots.resonant, left, ended, many, into, decay)
    return TableResponse(moved_on(rho, v), plus(here, before))
