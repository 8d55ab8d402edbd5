"""Pole pairs as numbers u + v j with j^2 = D: one branch-free form for complex and real pairs.

D < 0 is a complex pair u +- i sqrt(-D), D > 0 two real poles u +- sqrt(D), and D = 0 (critical
damping) no special case: exp((u + j) t) = e^{ut} (C + S j) with C = cosh(sqrt(D) t) and
S = sinh(sqrt(D) t)/sqrt(D), both entire in D.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._sincos import sincos as sincos
from .materialise import in_halves


class Pair(NamedTuple):
    """A number u + v j; what D is, the operations are told."""

    u: Float[Array, "..."]
    v: Float[Array, "..."]


def times(a: Pair, b: Pair, D) -> Pair:
    """a b."""
    return Pair(a.u * b.u + D * a.v * b.v, a.u * b.v + a.v * b.u)


def inverse(a: Pair, D) -> Pair:
    """1/a."""
    n = 1 / (a.u**2 - D * a.v**2)
    return Pair(a.u * n, -a.v * n)


def scaled(c, a: Pair) -> Pair:
    """c a for a real c."""
    return Pair(c * a.u, c * a.v)


def plus(a: Pair, b: Pair) -> Pair:
    """a + b."""
    return Pair(a.u + b.u, a.v + b.v)


def polynomial(coefficients, a: Pair, D) -> Pair:
    """Sum of coefficients[k] a^k (real coefficients, lowest first)."""
    total = Pair(coefficients[-1] + 0 * a.u, 0 * a.v)
    for c in reversed(coefficients[:-1]):
        total = times(total, a, D)
        total = Pair(total.u + c, total.v)
    return total


_NEAR = 1e-3  # of D t^2: below it the series, whose next term is below rounding


@jax.custom_jvp
def turning(D, t) -> Pair:
    """exp(j t) = C + S j, for D t^2 not above 1 (else two exponentials are the way)."""
    x = D * t * t
    near = x > -1.0
    root = jnp.sqrt(jnp.where(near, 1.0, -x))
    s, c = sincos(root)
    small = jnp.where(near, x, 0.0)
    even, odd = jnp.ones_like(small), jnp.ones_like(small)
    for k in range(8, 0, -1):
        even = 1 + small * even / (2 * k * (2 * k - 1))
        odd = 1 + small * odd / (2 * k * (2 * k + 1))
    return Pair(jnp.where(near, even, c), t * jnp.where(near, odd, s / root))


@turning.defjvp
def _(primals, tangents):
    (D, t), (dD, dt) = primals, tangents
    E = turning(D, t)
    x = D * t * t
    sinc, bend = _bend(E, x, t, 1.0)
    return E, Pair(D * E.v * dt + dD * t * t * sinc / 2, E.u * dt + dD * t**3 * bend)


def _bend(E: Pair, x, t, size):
    """S/t and (C - S/t)/(2x), both smooth at x = 0; `size` is e^{ut}."""
    near = jnp.abs(x) < 0.1
    sinc = jnp.where(t == 0, size, E.v / jnp.where(t == 0, 1.0, t))
    far = (E.u - sinc) / jnp.where(near, 1.0, 2 * x)
    series = 1 + x / 10 * (1 + x / 28 * (1 + x / 54 * (1 + x / 88 * (1 + x / 130))))
    return sinc, jnp.where(near, size / 6 * series, far)


@jax.custom_jvp
def exponential(u, D, t) -> Pair:
    """exp((u + j) t) for u t +- sqrt(D) t not above 700."""
    x = D * t * t
    root = jnp.sqrt(jnp.abs(x))
    s, c = sincos(jnp.where(x < 0, root, 0.0))
    first = jnp.exp(jnp.where(x < 0, u * t, u * t + root))
    second = jnp.exp(jnp.where(x < 0, 0.0, u * t - root))
    near = jnp.abs(x) < _NEAR
    safe = jnp.where(near, 1.0, root)
    sinc = jnp.where(x < 0, first * s, 0.5 * (first - second)) / safe
    series = 1 + x / 6 * (1 + x / 20 * (1 + x / 42 * (1 + x / 72)))
    sinc = jnp.where(near, jnp.exp(u * t) * series, sinc)
    return Pair(jnp.where(x < 0, first * c, 0.5 * (first + second)), t * sinc)


def _exponential_rule(function, primals, tangents):
    """dE = E (t du + (u + j) dt) + dD t^2 e^{ut} (S'/2 + j (C - S')/(2x)), S' = S/t, x = D t^2."""
    (u, D, t), (du, dD, dt) = primals, tangents
    E = function(u, D, t)
    x = D * t * t
    flat = jnp.exp(jnp.where(jnp.abs(x) < 0.1, u * t, 0.0))
    sinc, bend = _bend(E, x, t, flat)
    turn = times(E, Pair(t * du + u * dt, dt + 0 * u), D)
    return E, Pair(turn.u + dD * t * t * sinc / 2, turn.v + dD * t**3 * bend)


exponential.defjvp(lambda p, t: _exponential_rule(exponential, p, t))


@jax.custom_jvp
def stored_exponential(u, D, t) -> Pair:
    """`exponential`, computed once and stored (see `_stage`); arguments of one shape."""
    both = in_halves(lambda u, D, t: jax.lax.complex(*exponential(u, D, t)), u, D, t)
    return Pair(jnp.real(both), jnp.imag(both))


stored_exponential.defjvp(
    lambda primals, tangents: _exponential_rule(stored_exponential, primals, tangents)
)


@jax.custom_jvp
def stored_sincos(x):
    """`sincos`, computed once and stored."""
    both = in_halves(lambda x: jax.lax.complex(*sincos(x)), x)
    return jnp.real(both), jnp.imag(both)


@stored_sincos.defjvp
def _(primals, tangents):
    s, c = stored_sincos(*primals)
    return (s, c), (c * tangents[0], -s * tangents[0])
