"""Poles of blocks of two and of four states in closed form, many at a time; batch last.

The characteristic polynomial falls apart into two quadratics, one a pair of poles; vectors are
columns of the adjugate of A - lambda.  Coefficients and adjugate are sums of products of entries,
so that slow poles beside fast ones are as good as these.  What came out is held against A: where
the factors have a root in common, as nearly equal pairs do, it is not good.
"""

import functools
import itertools
import operator
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from ..arithmetic import Pair, across, materialised, product, quotient, summed

SIZES = (2, 4)  # states of the blocks that are done in closed form
GOOD = 256  # units of rounding of the sizes it is made of: what may be left of A V - V L
INVERSE = 1e-4  # what may be left of V X - 1: two poles as near as rounding tells leave 1e-8
NEWTON = 3  # steps from the roots of the resolvent, which are good to half the digits
APART = 0.1  # of the larger: two real poles that are not near each other
PAIRS = tuple(itertools.combinations(range(4), 2))


def _cofactors():
    """Sign, row, column and number of the minor of each of three terms of the adjugate's entries.

    The three rows of an entry are developed along that which shares none with the minors.
    """
    terms = np.zeros((4, 3, 4, 4), int)
    for i, j, t in itertools.product(range(4), range(4), range(3)):
        columns = [k for k in range(4) if k != i]
        column = columns.pop(t)
        of = PAIRS.index(tuple(columns)) + (6 if j < 2 else 0)
        terms[:, t, i, j] = (-1) ** (i + j + t), (1, 0, 3, 2)[j], column, of
    return terms


_COFACTORS = _cofactors()
_COFACTORS_OF_TWO = np.array([[[1, -1], [-1, 1]], [[1, 0], [1, 0]], [[1, 1], [0, 0]]])
_MINORS = np.array([(row, *pair) for row in (0, 2) for pair in PAIRS]).T  # rows row and row + 1


class BlockPoles(NamedTuple):
    """Pairs of poles of blocks, their vectors as columns, two a pair, and whether they are good.

    Of two conjugate poles the columns are the real and the imaginary part of the vector.
    """

    kind: Bool[Array, "p c"]  # conjugate poles
    first: Float[Array, "p c"]  # real part; or a real pole
    second: Float[Array, "p c"]  # imaginary part; or the other
    vector: Float[Array, "m m c"]
    inverse: Float[Array, "m m c"]
    good: Bool[Array, " c"]


def block_poles(A: Float[Array, "m m c"]) -> BlockPoles:
    """Poles and vectors of matrices of 2 or 4 rows."""
    kind, first, second = materialised(_poles, A)
    vector = materialised(_vectors, A, kind, first, second)
    vector, inverse = materialised(_refined, vector, A, kind, first, second)
    good = _good(A, kind, first, second, vector, inverse)
    return BlockPoles(kind, first, second, vector, inverse, good)


def _poles(A):
    """Kinds and poles of the pairs."""
    if len(A) == 4:
        p, q = _factors(A)
    else:
        p, q = -_trace(A)[None], (A[0, 0] * A[1, 1] - A[0, 1] * A[1, 0])[None]
    middle = -p / 2
    square = middle * middle - q
    # two poles are nowhere nearer each other than the coefficients' rounding may bring them
    least = 4 * jnp.finfo(q.dtype).eps * (middle * middle + jnp.abs(q))
    square = jnp.where(square < 0, jnp.minimum(square, -least), jnp.maximum(square, least))
    kind, root = square < 0, jnp.sqrt(jnp.abs(square))
    far = middle + jnp.where(middle < 0, -root, root)
    return kind, jnp.where(kind, middle, far), jnp.where(kind, root, _ratio(q, far))


def _ratio(a, b):
    """a/b, 0 where b is."""
    return jnp.where(b != 0, a / jnp.where(b != 0, b, 1.0), 0.0)


def _trace(A):
    return summed(jnp.stack([A[i, i] for i in range(len(A))]))


class _Quadratics(NamedTuple):
    """x^2 + p1 x + q1 and x^2 + p2 x + q2."""

    p1: Array
    p2: Array
    q1: Array
    q2: Array

    def resultant(self):
        """Product of all differences of a root of one and a root of the other."""
        u, v = self.p2 - self.p1, self.q2 - self.q1
        return v * v - u * v * self.p1 + u * u * self.q1


def _factors(A) -> tuple[Array, Array]:
    """Coefficients p and q (2, c) of the quadratics that det(x - A) falls apart into."""
    unit, *a = materialised(_scaled, A)
    each = materialised(_resolvent, *a)
    f = materialised(_started, *a, *each)
    f = jax.lax.fori_loop(0, NEWTON, lambda _, f: _closer(a, f), f)
    p, q = jnp.stack([f.p1, f.p2]), jnp.stack([f.q1, f.q2])
    return p * unit, q * unit * unit


def _scaled(A) -> list[Array]:
    """A unit for the roots, and the coefficients in it."""
    a = _coefficients(A)
    size = [jnp.abs(x) for x in a]
    unit = jnp.maximum(
        jnp.maximum(size[3], jnp.sqrt(size[2])),
        jnp.maximum(jnp.cbrt(size[1]), jnp.sqrt(jnp.sqrt(size[0]))),
    )
    unit = jnp.where(unit > 0, unit, 1.0)
    return [unit, *(x / unit ** (4 - i) for i, x in enumerate(a))]


def _started(a0, a1, a2, a3, largest, smallest) -> _Quadratics:
    """The quadratics whose roots lie farther apart."""
    (f, _), (other, real) = (_split([a0, a1, a2, a3], y) for y in (largest, smallest))
    better = real & (jnp.abs(other.resultant()) > jnp.abs(f.resultant()))
    return _Quadratics(*(jnp.where(better, y, x) for x, y in zip(f, other, strict=True)))


def _coefficients(A) -> list[Array]:
    """a0 ... a3 of det(x - A) = x^4 + a3 x^3 + ... + a0."""
    adjugate = _adjugate(A, operator.mul)
    i, j = np.array(PAIRS).T
    minors = A[i, i] * A[j, j] - A[i, j] * A[j, i]
    return [summed(A[0] * adjugate[:, 0]), -_trace(adjugate), summed(minors), -_trace(A)]


def _resolvent(a0, a1, a2, a3) -> tuple[Array, Array]:
    """Largest and smallest real root of the resolvent: q1 + q2 of two ways to pair the roots."""
    b0, b1 = 4 * a2 * a0 - a1 * a1 - a3 * a3 * a0, a1 * a3 - 4 * a0
    p, q = b1 - a2 * a2 / 3, b0 + a2 * b1 / 3 - 2 * a2**3 / 27
    square = q * q / 4 + p**3 / 27
    root = jnp.cbrt(jnp.abs(q) / 2 + jnp.sqrt(jnp.maximum(square, 0.0)))
    single = -jnp.sign(q) * (root - _ratio(p, 3 * root))
    radius = jnp.sqrt(jnp.maximum(-p / 3, 0.0))
    angle = jnp.arccos(jnp.clip(_ratio(-q, 2 * radius**3), -1.0, 1.0)) / 3
    largest, smallest = 2 * radius * jnp.cos(angle), -2 * radius * jnp.cos(np.pi / 3 - angle)
    one = square > 0
    return jnp.where(one, single, largest) + a2 / 3, jnp.where(one, single, smallest) + a2 / 3


def _split(a: list[Array], y) -> tuple[_Quadratics, Array]:
    """The quadratics of q1 + q2 = y, and whether they are real."""
    a0, a1, a2, a3 = a
    apart, turned = y * y / 4 - a0, a3 * a3 / 4 - a2 + y
    root = jnp.sqrt(jnp.maximum(apart, 0.0))
    q1 = y / 2 + jnp.where(y < 0, -root, root)
    q2 = _ratio(a0, q1)
    half = jnp.sqrt(jnp.maximum(turned, 0.0))
    half = jnp.where((a1 - a3 * y / 2) * (q2 - q1) < 0, -half, half)
    return _Quadratics(a3 / 2 + half, a3 / 2 - half, q1, q2), (apart >= 0) & (turned >= 0)


def _closer(a: list[Array], f: _Quadratics) -> _Quadratics:
    """One step of Newton's method (Bairstow's, for both factors at once)."""
    p1, p2, q1, q2 = f
    left = (
        a[0] - q1 * q2,
        a[1] - (p1 * q2 + p2 * q1),
        a[2] - (q1 + q2 + p1 * p2),
        a[3] - (p1 + p2),
    )
    u, v, whole = p2 - p1, q2 - q1, f.resultant()

    def step(p, q, u, v):  # what is left over (u x + v), modulo x^2 + p x + q
        x = left[1] - p * left[2] + (p * p - q) * left[3]
        one = left[0] - q * left[2] + p * q * left[3]
        return _ratio(x * v - u * one, whole), _ratio((v - u * p) * one + u * q * x, whole)

    (dp1, dq1), (dp2, dq2) = step(p1, q1, u, v), step(p2, q2, -u, -v)
    return _Quadratics(p1 + dp1, p2 + dp2, q1 + dq1, q2 + dq2)


def _adjugate(M, times: Callable):
    """The adjugate of matrices (m, m, ...) of 2 or 4 rows, arrays or a `Pair` as `times` takes."""

    def at(x, *index):
        return jax.tree.map(lambda y: y.at[index].get(mode="promise_in_bounds"), x)

    def signed(sign: np.ndarray, x):
        return jax.tree.map(lambda y: y * sign.reshape(*sign.shape, *[1] * (y.ndim - 2)), x)

    def plus(x, y):
        return jax.tree.map(operator.add, x, y)

    if len(jax.tree.leaves(M)[0]) == 2:
        sign, row, column = _COFACTORS_OF_TWO
        return signed(sign, at(M, row, column))
    row, first, second = _MINORS
    minor = jax.tree.map(
        operator.sub,
        times(at(M, row, first), at(M, row + 1, second)),
        times(at(M, row, second), at(M, row + 1, first)),
    )
    terms = [
        signed(sign, times(at(M, row, column), at(minor, of)))
        for sign, row, column, of in zip(*_COFACTORS, strict=True)
    ]
    return functools.reduce(plus, terms)


def _vectors(A, kind, first, second):
    """Columns of the adjugate of A - lambda, of length about 1."""
    k = jnp.where(kind, 1.0, 0.0)
    one = jnp.eye(len(A))[:, :, None, None]
    a = A[:, :, None] + jnp.zeros_like(k)
    M = a - one * first, jnp.where(kind, 0.0, a) - one * second
    parts = _adjugate(M, partial(product, k))
    size = [across(jnp.maximum, jnp.abs(x)) for x in parts]  # (j, p, c)
    # both poles of a pair by one column: what two near ones differ by is then what is right
    each = jnp.where(kind, jnp.maximum(*size), jnp.minimum(*size))
    here = jnp.arange(len(A))[:, None, None] == jnp.argmax(each, axis=0)
    parts = [summed(jnp.where(here, x, 0.0), 1) for x in parts]  # (m, p, c)
    size = [summed(jnp.where(here, x, 0.0)) for x in size]
    whole = jnp.maximum(*size)
    unit = [jnp.where(kind, whole, x) for x in size]
    parts = [_ratio(x, y) for x, y in zip(parts, unit, strict=True)]
    return jnp.stack(parts, axis=2).reshape(A.shape)


def _dot(a, b):
    return summed(a[:, :, None] * b[None], 1)


def _inverse(V):
    """The inverse by the adjugate."""
    X = _adjugate(V, operator.mul)
    return _ratio(X, summed(V[0] * X[:, 0]))


def _refined(V, A, kind, first, second):
    """The vectors without what each has of the others, to first order, and their inverse.

    What is left of V^-1 A V beside the poles is what rounding of the poles leaves of fast vectors
    in slow ones.
    """
    X = _inverse(V)
    left = _dot(X, _dot(A, V) - _moved(V, kind, first, second))  # L Y - Y L = -left
    turn = _sylvester(left, kind, (first, second))
    V, X = V + _dot(V, turn), X - _dot(turn, X)
    return V, _dot(X, 2 * jnp.eye(len(V))[:, :, None] - _dot(V, X))


def _sylvester(left, kind, pole: Pair):
    """Y of L Y - Y L = -left beside the pairs, and in them where two real poles are apart.

    A block of pairs i, j with L_j^2 + p L_j + q = 0 is that of (L_i^2 + p L_i + q) Y =
    -(L_i left + left L_j + p left).  L_i multiplies a column by the conjugate of its pole, L_j a
    row by its pole.
    """
    n, k = len(kind), jnp.where(kind, 1.0, 0.0)
    left = left.reshape(n, 2, n, 2, -1)  # pair, of two; pair, of two
    own, of = k[:, None], k[None]  # (i, 1, c), (1, j, c)
    turned = pole[0][:, None], jnp.where(kind, -pole[1], pole[1])[:, None]
    p = -jnp.where(kind, 2 * pole[0], pole[0] + pole[1])
    q = jnp.where(kind, pole[0] ** 2 + pole[1] ** 2, pole[0] * pole[1])
    columns = [product(own, turned, (left[:, 0, :, j], left[:, 1, :, j])) for j in (0, 1)]
    each = pole[0][None], pole[1][None]
    along = [product(of, each, (left[:, i, :, 0], left[:, i, :, 1])) for i in (0, 1)]
    square = product(own, turned, turned)
    whole = square[0] + p * turned[0] + q, square[1] + p * turned[1] + jnp.where(own > 0, 0.0, q)
    beside = ~jnp.eye(n, dtype=bool)[:, :, None]
    whole = [jnp.where(beside, x, 1.0) for x in whole]
    gap = pole[0] - pole[1]
    apart = ~kind & (jnp.abs(gap) > APART * jnp.maximum(jnp.abs(pole[0]), jnp.abs(pole[1])))
    gap = jnp.where(apart, gap, jnp.inf)
    parts = []
    for j in (0, 1):
        right = [-(columns[j][i] + along[i][j] + p * left[:, i, :, j]) for i in (0, 1)]
        outer = quotient(own, (right[0], right[1]), whole)
        inner = (0.0, left[:, 1, :, 0] / gap) if j == 0 else (-left[:, 0, :, 1] / gap, 0.0)
        parts.append([jnp.where(beside, x, y) for x, y in zip(outer, inner, strict=True)])
    (a, c), (b, d) = parts
    return jnp.stack([jnp.stack([a, b], 2), jnp.stack([c, d], 2)], 1).reshape(2 * n, 2 * n, -1)


def _moved(V, kind, first, second):
    """V L."""
    v, w = V[:, 0::2], V[:, 1::2]
    other = jnp.where(kind, second * v + first * w, second * w)
    return jnp.stack([first * v - jnp.where(kind, second * w, 0.0), other], axis=2).reshape(V.shape)


def _good(A, kind, first, second, V, X):
    """Whether A V = V L and V X = 1, as near as rounding lets them be."""
    largest = partial(across, jnp.maximum)
    left = (
        _dot(X, _dot(A, V) - _moved(V, kind, first, second)),
        _dot(V, X) - jnp.eye(len(V))[:, :, None],
    )
    poles, inverse = (largest(largest(jnp.abs(x))) for x in left)
    size = GOOD * jnp.finfo(A.dtype).eps * largest(summed(jnp.abs(X), 1))
    of_A = largest(largest(jnp.abs(A)))
    return (poles <= size * of_A) & (inverse <= jnp.minimum(size, INVERSE))
