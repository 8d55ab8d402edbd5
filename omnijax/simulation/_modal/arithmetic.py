"""Arithmetic of pairs of poles (see `poles`) in a form that XLA vectorises."""

import functools
import operator
from collections.abc import Callable, Sequence

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from .._materialised import materialised as materialised
from .._sincos import sincos as sincos

Pair = tuple[Array, Array]
TINY = 1e-75


def stored(f: Callable, *args) -> Pair:
    """The pair f(*args), `materialised`."""
    pair = materialised(lambda *a: jax.lax.complex(*f(*a)), *args)
    return pair.real, pair.imag


def pair_exp(kind, a: Pair) -> Pair:
    """exp of pairs: of the complex number, or of two real ones."""
    k = kind > 0
    first, (s, c) = jnp.exp(a[0]), sincos(jnp.where(k, a[1], 0.0))
    second = jnp.exp(jnp.where(k, 0.0, a[1]))
    return jnp.where(k, first * c, first), jnp.where(k, first * s, second)


def plus(a: Pair, b: Pair) -> Pair:
    """a + b."""
    return a[0] + b[0], a[1] + b[1]


def times(x, a: Pair) -> Pair:
    """x a, of a number x."""
    return x * a[0], x * a[1]


def product(kind, a, b):
    """a b of pairs: of complex numbers, or number by number."""
    k = kind > 0
    return (
        jnp.where(k, a[0] * b[0] - a[1] * b[1], a[0] * b[0]),
        jnp.where(k, a[0] * b[1] + a[1] * b[0], a[1] * b[1]),
    )


def onward(kind, w: Pair, E: Pair) -> Pair:
    """Weights w of what an output shows of pairs, w0 z0 + w1 z1, when the pairs have moved by E."""
    k = kind > 0
    return (
        w[0] * E[0] + jnp.where(k, w[1] * E[1], 0.0),
        w[1] * jnp.where(k, E[0], E[1]) - jnp.where(k, w[0] * E[1], 0.0),
    )


def powers(kind, a: Pair, count: int) -> Pair:
    """1, a, ..., a^(count - 1) of pairs, one below the other, by doubling; `flushed`."""
    one = jnp.ones((1, *a[0].shape))
    first, second = one, jnp.where(kind > 0, 0.0, one)
    while len(first) < count:
        further = stored(_product, kind, first, second, *a)
        first, second = (
            flushed(jnp.concatenate(x)) for x in zip((first, second), further, strict=True)
        )
        a = stored(_product, kind, *a, *a)
    return first[:count], second[:count]


def _product(kind, a0, a1, b0, b1) -> Pair:
    return product(kind, (a0, a1), (b0, b1))


def quotient(kind, a, b):
    """a / b of pairs."""
    k = kind > 0
    size = jnp.where(k, b[0] * b[0] + b[1] * b[1], b[0])
    return (
        jnp.where(k, a[0] * b[0] + a[1] * b[1], a[0]) / size,
        jnp.where(k, a[1] * b[0] - a[0] * b[1], a[1]) / jnp.where(k, size, b[1]),
    )


def turned(a, b, c, s):
    """a cos + b sin moved on by an angle of the cosine c and the sine s: a c + b s, b c - a s."""
    return a * c + b * s, b * c - a * s


def flushed(x):
    """x with nothing smaller than `TINY`: products of two never become slow subnormal numbers."""
    return jnp.where(jnp.abs(x) > TINY, x, 0.0)


def summed(x, axis: int = 0):
    """Sum over a short axis, term by term; XLA's own reduction takes one number at a time."""
    rows = [jax.lax.index_in_dim(x, i, axis, keepdims=False) for i in range(x.shape[axis])]
    return functools.reduce(operator.add, rows)


def across(better: Callable, x):
    """x (k, ...) reduced over k; XLA's own reduction takes one number at a time."""
    while len(x) > 1:
        half, odd = divmod(len(x), 2)
        rest = x[2 * half :]
        x = better(x[:half], x[half : 2 * half])
        x = jnp.concatenate([x, rest]) if odd else x
    return x[0]


def rows(x, index: Sequence[int] | np.ndarray, axis: int = 0):
    """x[index] along an axis, without a copy where those lie side by side or are x, repeated."""
    x, index = jnp.moveaxis(x, axis, 0), [int(i) for i in index]
    times = len(index) // max(len(x), 1)
    if not index:
        x = x[:0]
    elif index == times * list(range(len(x))):
        x = jnp.broadcast_to(x, (times, *x.shape)).reshape(-1, *x.shape[1:]) if times > 1 else x
    elif index == list(range(index[0], index[0] + len(index))):
        x = x[index[0] : index[-1] + 1]
    else:
        x = jnp.stack([x[i] for i in index])
    return jnp.moveaxis(x, 0, axis)


@jax.custom_jvp
def _real_less_one(x):
    """e^x - 1, vectorised by XLA (its own is not)."""
    near = jnp.abs(x) < 0.3
    y, series = jnp.where(near, x, 0.0), 0.0
    for n in range(13, 0, -1):
        series = (1.0 + series) * y / n
    return jnp.where(near, series, jnp.exp(jnp.where(near, 0.0, x)) - 1.0)


@_real_less_one.defjvp
def _(primals, tangents):
    value = _real_less_one(*primals)
    return value, (value + 1.0) * tangents[0]


def exp_less_one(kind, a: Pair) -> Pair:
    """e^a - 1 without cancellation."""
    k = kind > 0
    first, second = _real_less_one(a[0]), _real_less_one(jnp.where(k, 0.0, a[1]))
    s, c = sincos(jnp.where(k, a[1] / 2, 0.0))
    off = -2 * s * s
    return (
        jnp.where(k, first + off + first * off, first),
        jnp.where(k, (1 + first) * 2 * s * c, second),
    )
