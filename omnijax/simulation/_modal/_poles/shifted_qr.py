"""Poles and vectors of blocks of any size by QR iteration, many at a time; batch last.

Balanced, to Hessenberg form, then by Francis' double shifts to real Schur form T = Z^T A Z, as
LAPACK does it, but all designs of a batch in step: each has its own window of rows that are not
apart yet, and a step turns the same three rows of all whose window holds them.  Vectors and their
inverse are by substitution in T.  G. H. Golub and C. F. Van Loan, Matrix Computations, 7.4 to 7.6.
"""

import math
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Complex, Float

from ...._compiling import on_cpu
from ..._one_kernel import one_kernel
from ..arithmetic import Pair, across, materialised, stored, summed

CACHE = 6.5e5  # bytes that designs in step may take on a CPU
MOST = 128  # designs in step there
PAYS = 22  # states up to which LAPACK, design by design, takes longer there
BALANCING = 4  # times that units are chosen anew
SWEEPS = 10  # a row, after which a batch is given up; two or three a pair are usual
UNUSUAL = 10  # sweeps without a pole that came off, after which shifts are chosen otherwise:
# real and imaginary part, in sizes of the last two entries below the diagonal
OTHER_SHIFTS = (0.75, 0.66)


class Decomposed(NamedTuple):
    """Eigenvalues, vectors and the vectors' inverse of a batch.

    Of two conjugate poles the first column is the real part of the vector of that with positive
    imaginary part, the second its imaginary part.
    """

    real: Float[Array, "m c"]
    imaginary: Float[Array, "m c"]
    vector: Float[Array, "m m c"]
    inverse: Float[Array, "m m c"]
    good: Bool[Array, " c"]  # whether all poles came off


def decomposed(A: Float[Array, "m m c"]) -> Decomposed:
    """Of real matrices; not a number where an entry is none."""
    groups = A.shape[-1] // (_together(len(A), A.shape[-1]) if on_cpu() else A.shape[-1])
    parts = jnp.moveaxis(A.reshape(*A.shape[:2], groups, -1), 2, 0)
    each = one_kernel(lambda parts: jax.lax.map(_decomposed, parts), parts)
    return jax.tree.map(lambda x: jnp.moveaxis(x, 0, -2).reshape(*x.shape[1:-1], -1), each)


def pays(states: int) -> bool:
    """Whether this costs less than LAPACK, with many designs."""
    return states <= PAYS or not on_cpu()


def _together(m: int, count: int) -> int:
    """Designs in step on a CPU: a power of two, if so many are there, which its cache holds."""
    holds = min(MOST, CACHE / (2 * m * m * np.dtype(float).itemsize))
    return math.gcd(count, 2 ** max(int(math.log2(holds)), 0))


def _decomposed(A) -> Decomposed:
    finite = jnp.all(jnp.isfinite(A), axis=(0, 1))
    unit, A = _balanced(jnp.where(finite, A, 0.0))
    T, Z, good = _schur(A)
    T, Z = _real_apart(T, Z)
    below = _diagonals(T)[1]
    real, imaginary = materialised(_poles, T, below)
    Y, X = _substituted(T, below, real, imaginary)
    vector = materialised(lambda Z, Y, unit: unit[:, None] * _dot(Z, Y), Z, Y, unit)
    inverse = materialised(lambda X, Z, unit: _dot(X, jnp.swapaxes(Z, 0, 1)) / unit, X, Z, unit)
    size = materialised(_sizes, vector, imaginary)
    real = jnp.where(finite, real, jnp.nan)
    return Decomposed(real, imaginary, vector / size, inverse * size[:, None], good)


def _dot(a, b):
    return summed(a[:, :, None] * b[None], 1)


def _balanced(A) -> tuple[Float[Array, "m c"], Array]:
    """Powers of two that make rows and columns alike in size, and A in these units."""

    def sweep(_, carry):
        unit, A = carry
        off = jnp.abs(A) * (1 - jnp.eye(len(A)))[:, :, None]
        row, column = summed(off, 1), summed(off)
        both = (row > 0) & (column > 0)
        ratio = jnp.where(both, row, 1.0) / jnp.where(both, column, 1.0)
        by = materialised(lambda x: jnp.exp2(jnp.round(jnp.log2(x) / 4)), ratio)  # half the way
        return unit * by, A / by[:, None] * by

    return jax.lax.fori_loop(0, BALANCING, sweep, (jnp.ones(A.shape[1:]), A))


def _hessenberg(A) -> Float[Array, "2m m c"]:
    """H = Z^T A Z without entries further than one below its diagonal, and Z below it."""
    m = len(A)
    number = np.arange(m)[:, None]

    def sizes(x, k):  # of the reflector that takes x to its entry k + 1
        first = jax.lax.dynamic_index_in_dim(x, k + 1, 0, keepdims=False)
        further = jnp.any(jnp.where(number > k + 1, x, 0.0) != 0, axis=0)
        norm = jnp.sqrt(summed(jnp.where(number > k, x * x, 0.0)))
        to = jnp.where(first < 0, norm, -norm)
        turned = to * (to - first)
        some = further & (turned > 0)
        return to, jnp.where(some, 1 / jnp.where(some, turned, 1.0), 0.0)

    def step(k, G):
        x = jax.lax.dynamic_index_in_dim(G[:m], k, 1, keepdims=False)
        to, weight = stored(sizes, x, k)
        v = jnp.where(number > k, x, 0.0) - jnp.where(number == k + 1, to, 0.0)
        v, w = stored(lambda v, weight: (v, weight * v), v, weight)
        along = materialised(lambda v, H: summed(v[:, None] * H), v, G[:m])
        G = jax.lax.dynamic_update_slice_in_dim(G, G[:m] - w[:, None] * along, 0, 0)
        along = materialised(lambda G, v: summed(G * v, 1), G, v)
        return G - along[:, None] * w

    G = jnp.concatenate([A, jnp.broadcast_to(jnp.eye(m)[:, :, None], A.shape)])
    G = jax.lax.fori_loop(0, m - 2, step, G)
    rounding = np.tri(2 * m, m, -2)[:, :, None] * (np.arange(2 * m) < m)[:, None, None]
    return jnp.where(rounding > 0, 0.0, G)


def _diagonals(T) -> tuple[Array, Array, Array]:
    """The diagonal, what is below it and not rounding, and what is above it."""
    m = T.shape[1]
    flat = T[:m].reshape(m * m, -1)
    own, below, above = (flat[i :: m + 1] for i in (0, m, 1))
    size = jnp.abs(own[1:]) + jnp.abs(own[:-1])
    eps = jnp.finfo(T.dtype).eps
    return own, jnp.where(jnp.abs(below) <= eps * size, 0.0, below), above


class _Window(NamedTuple):
    """The last rows of each design that are not apart yet."""

    first: Float[Array, " c"]
    last: Float[Array, " c"]  # 0 where all are


class _Iteration(NamedTuple):
    """Where the iteration is."""

    G: Float[Array, "2m+2 m+1 c"]  # H and Z, each with a row and a column of zeros
    diagonals: tuple[Array, Array, Array]
    window: _Window
    since: Float[Array, " c"]  # sweeps since a pole came off
    sweeps: Array


def _schur(A) -> tuple[Array, Array, Bool[Array, " c"]]:
    """T = Z^T A Z with blocks of one or two rows along its diagonal, and Z."""
    m = len(A)
    G = _hessenberg(A).reshape(2, m, m, -1)
    G = jnp.pad(G, ((0, 0), (0, 1), (0, 1), (0, 0))).reshape(2 * (m + 1), m + 1, -1)

    def seen(G):
        diagonals = materialised(lambda G: _diagonals(G[:m, :m]), G)
        return diagonals, _Window(*stored(_window, diagonals[1]))

    def sweep(s: _Iteration) -> _Iteration:
        G = _swept(s)
        diagonals, window = seen(G)
        since = jnp.where(window.last == s.window.last, s.since + 1, 0.0)
        return _Iteration(G, diagonals, window, since, s.sweeps + 1)

    def unfinished(s: _Iteration):
        return (s.sweeps < SWEEPS * m) & jnp.any(s.window.last > 0)

    start = _Iteration(G, *seen(G), jnp.zeros(G.shape[-1]), jnp.asarray(0))
    s = jax.lax.while_loop(unfinished, sweep, start)
    apart = np.eye(m, k=-1)[:, :, None] * jnp.pad(s.diagonals[1], ((1, 0), (0, 0)))[:, None]
    T = jnp.where(np.tri(m, m, -1)[:, :, None] > 0, apart, s.G[:m, :m])
    return T, s.G[m + 1 : -1, :m], s.window.last == 0


def _window(below) -> Pair:
    """First and last row of the last three or more that are not apart."""
    first = last = top = jnp.zeros_like(below[0])
    for k in range(1, len(below) + 1):
        top = jnp.where(below[k - 1] != 0, top, float(k))
        long = k - top >= 2
        first, last = jnp.where(long, top, first), jnp.where(long, float(k), last)
    return first, last


def _at(x, row):
    """x[row], lane by lane."""
    y = x[0]
    for k in range(1, len(x)):
        y = jnp.where(row == k, x[k], y)
    return y


def _swept(s: _Iteration):
    """G after one sweep of a double shift through each window."""
    m, G = s.G.shape[1] - 1, s.G
    first, last = s.window
    own, below, above = s.diagonals
    shift = stored(_shifts, own, below, above, last, s.since)
    columns = materialised(_first_columns, own, below, above, *shift)
    start, x, y, z = materialised(partial(_start, m), own, below, columns, first, last)
    begin = jnp.stack([x, y, z])
    from_row = jnp.min(jnp.where(last > 0, start, m).astype(int))
    to_row = jnp.max(last.astype(int))

    def three(x, row, axis: int):
        return jax.lax.dynamic_slice_in_dim(x, row, 3, axis)

    def reflector(G, row):
        """v and w of 1 - w v^T, which takes what stands before the three rows into the first."""

        def entries(G, row, begin, start, last):
            before = jax.lax.dynamic_index_in_dim(G, jnp.maximum(row - 1, 0), 1, keepdims=False)
            x = jnp.where(row == start, begin, three(before, row, 0))
            return jnp.where((np.arange(3)[:, None] < 2) | (row + 2 <= last), x, 0.0)

        def weighed(x, some):
            further = x[1] * x[1] + x[2] * x[2]
            norm = jnp.sqrt(x[0] * x[0] + further)
            to = jnp.where(x[0] < 0, norm, -norm)
            some = some & (further > 0)
            return x[0] - to, jnp.where(some, 1 / jnp.where(some, to * (to - x[0]), 1.0), 0.0)

        x = materialised(entries, G, row, begin, start, last)
        v, weight = stored(weighed, x, (row >= start) & (row < last))
        v = jnp.stack([v, x[1], x[2]])
        return jnp.concatenate([v, weight * v])

    def along(G, v, row, axis: int):
        each = (jax.lax.dynamic_index_in_dim(G, row + i, axis, keepdims=False) for i in range(3))
        return sum(x * y for x, y in zip(v, each, strict=True))

    def step(row, carry):
        G, (v, w) = carry[0], carry[1].reshape(2, 3, -1)
        rows = three(G, row, 0) - w[:, None] * materialised(partial(along, axis=0), G, v, row)
        zero = (np.arange(3)[:, None] > 0) & (np.arange(m + 1) == row - 1)
        rows = jnp.where(zero[:, :, None] & (row >= start) & (row < last), 0.0, rows)
        G = jax.lax.dynamic_update_slice_in_dim(G, rows, row, 0)
        columns = three(G, row, 1) - materialised(partial(along, axis=1), G, v, row)[:, None] * w
        G = jax.lax.dynamic_update_slice_in_dim(G, columns, row, 1)
        return G, reflector(G, row + 1)

    return jax.lax.fori_loop(from_row, to_row, step, (G, reflector(G, from_row)))[0]


def _of_two(a, b, c, d) -> tuple[Array, Array, Array, Array]:
    """Poles of [[a, b], [c, d]] less d: half + root or half - root, or half +- i root.

    The half, the root, its square (below zero: conjugate poles), and the larger of the real ones.
    """
    half = (a - d) / 2
    square = half * half + b * c
    root = jnp.sqrt(jnp.abs(square))
    return half, root, square, half + jnp.where(half < 0, -root, root)


def _shifts(own, below, above, last, since) -> Pair:
    """Real and imaginary part of the two: the last two rows' own, or the nearer real one twice."""
    a, d, b, c = _at(own[:-1], last - 1), _at(own, last), _at(above, last - 1), _at(below, last - 1)
    half, root, square, far = _of_two(a, b, c, d)
    near = d - jnp.where(far != 0, b * c / jnp.where(far != 0, far, 1.0), 0.0)
    real, imaginary = jnp.where(square < 0, d + half, near), jnp.where(square < 0, root, 0.0)
    size = jnp.abs(c) + jnp.abs(_at(below, last - 2))
    other = since % UNUSUAL == UNUSUAL - 1
    one, two = OTHER_SHIFTS
    return jnp.where(other, d + one * size, real), jnp.where(other, two * size, imaginary)


def _first_columns(own, below, above, real, imaginary):
    """(H - s)(H - s*) of the rows from each on (3, m - 2, c), by what is below the first."""
    a, b = own[:-2] - real, own[1:-1] - real
    under = jnp.where(below[:-1] != 0, below[:-1], 1.0)
    return jnp.stack([(a * a + imaginary * imaginary) / under + above[:-1], a + b, below[1:]])


def _start(m: int, own, below, columns, first, last):
    """Row that a sweep starts from, and the column there.

    The first of the window, or the last one that two small entries keep nearly apart: there a
    shift that has come so far would be lost.
    """
    start, x, eps = first, _at_row(columns, first), jnp.finfo(own.dtype).eps
    for k in range(1, m - 2):
        across_it = jnp.abs(below[k - 1]) * (jnp.abs(columns[1, k]) + jnp.abs(columns[2, k]))
        size = jnp.abs(own[k - 1]) + jnp.abs(own[k]) + jnp.abs(own[k + 1])
        apart = across_it <= eps * jnp.abs(columns[0, k]) * size
        later = apart & (k > first) & (k <= last - 2)
        start = jnp.where(later, float(k), start)
        x = [jnp.where(later, column[k], y) for column, y in zip(columns, x, strict=True)]
    return jnp.stack([start, *x])


def _at_row(columns, row) -> list[Array]:
    return [_at(column, row) for column in columns]


def _real_apart(T, Z) -> tuple[Array, Array]:
    """Blocks of two rows with real poles turned until one stands below the other."""
    m = len(T)

    def angle(T, k):
        a, b, c, d = (
            jax.lax.dynamic_slice(T, (i, j, 0), (1, 1, T.shape[2]))[0, 0]
            for i, j in ((k, k), (k, k + 1), (k + 1, k), (k + 1, k + 1))
        )
        _, _, square, far = _of_two(a, b, c, d)
        apart = (c != 0) & (square >= 0)
        far, c = jnp.where(apart, far, 1.0), jnp.where(apart, c, 0.0)
        size = jnp.sqrt(far * far + c * c)
        return far / size, c / size

    def step(k, G):
        cos, sin = stored(angle, G[:m], k)
        rows = jax.lax.dynamic_slice_in_dim(G, k, 2, 0)
        rows = jnp.stack([cos * rows[0] + sin * rows[1], cos * rows[1] - sin * rows[0]])
        G = jax.lax.dynamic_update_slice_in_dim(G, rows, k, 0)
        one, two = jnp.moveaxis(jax.lax.dynamic_slice_in_dim(G, k, 2, 1), 1, 0)
        zero = (np.arange(len(G))[:, None] == k + 1) & (sin != 0)
        one, two = jnp.where(zero, 0.0, cos * one + sin * two), cos * two - sin * one
        return jax.lax.dynamic_update_slice_in_dim(G, jnp.stack([one, two], axis=1), k, 1)

    own, below, above = materialised(_diagonals, T)
    _, _, square, _ = _of_two(own[:-1], above, below, own[1:])
    some = jnp.any((below != 0) & (square >= 0))
    G = jnp.concatenate([T, Z])
    G = jax.lax.cond(some, lambda G: jax.lax.fori_loop(0, m - 1, step, G), lambda G: G, G)
    return G[:m], G[m:]


def _poles(T, below) -> tuple[Float[Array, "m c"], Float[Array, "m c"]]:
    """Real and imaginary parts; the positive one of two conjugate poles first."""
    own, _, above = _diagonals(T)
    _, root, square, _ = _of_two(own[:-1], above, below, own[1:])
    pair = below != 0
    size = jnp.where(pair & (square < 0), root, 0.0)
    upper, lower = jnp.pad(pair, ((0, 1), (0, 0))), jnp.pad(pair, ((1, 0), (0, 0)))
    middle = (own[:-1] + own[1:]) / 2
    after, before = jnp.pad(middle, ((0, 1), (0, 0))), jnp.pad(middle, ((1, 0), (0, 0)))
    real = jnp.where(upper, after, jnp.where(lower, before, own))
    return real, jnp.pad(size, ((0, 1), (0, 0))) - jnp.pad(size, ((1, 0), (0, 0)))


class _Columns(NamedTuple):
    """Poles of the columns of a matrix whose columns are packed as `Decomposed` packs vectors."""

    pole: Complex[Array, "m c"]  # the upper one of two
    first: Bool[Array, "m c"]  # of two conjugate poles
    second: Bool[Array, "m c"]

    def numbers(self, x: Float[Array, "m c"]) -> Complex[Array, "m c"]:
        """Each column's number, of the upper one of two poles."""
        before, after = jnp.roll(x, 1, axis=0), jnp.roll(x, -1, axis=0)
        imaginary = jnp.where(self.first, after, jnp.where(self.second, x, 0.0))
        return jax.lax.complex(jnp.where(self.second, before, x), imaginary)

    def packed(self, x: Complex[Array, "m c"]) -> Float[Array, "m c"]:
        """The same from numbers."""
        return jnp.where(self.second, x.imag, x.real)


def _reciprocal(a, least):
    """1 / a of complex numbers, with `least` for an a that is no more than rounding."""
    square = a.real * a.real + a.imag * a.imag
    tiny = square < least * least
    x = 1 / jnp.where(tiny, least, square)
    return jax.lax.complex(jnp.where(tiny, x, a.real * x), jnp.where(tiny, 0.0, -a.imag * x))


def _substituted(T, below, real, imaginary) -> tuple[Array, Array]:
    """Vectors Y of T and Y^-1; both have blocks of one or two rows along the diagonal as T has."""
    m = len(T)
    first = jnp.pad(below != 0, ((0, 1), (0, 0)))
    second = jnp.pad(below != 0, ((1, 0), (0, 0)))
    columns = _Columns(jax.lax.complex(real, jnp.abs(imaginary)), first, second)
    largest = partial(across, jnp.maximum)
    least = jnp.finfo(T.dtype).eps * largest(largest(jnp.abs(T)))
    least = jnp.where(least > 0, least, 1.0)
    one = jnp.eye(m)[:, :, None]
    Y = _from_last(T, jnp.zeros_like(T), columns, _VectorRows(columns, least))
    return Y, _from_last(Y, one + jnp.zeros_like(Y), columns, _InverseRows())


def _from_last(M, right, columns: _Columns, rows):
    """X of M X = right, row by row from the last, or two where they belong to a pair.

    `rows.solved(number, block, pair, here, under)`: the rows of that number and below, where
    block X = (here, under) or, without a pair, its first entry alone; `rows.read`: what is carried
    of what is left for a row.
    """
    m, c = len(M), M.shape[2]
    M, right = (jnp.pad(x, ((0, 1), (0, 1), (0, 0))) for x in (M, right))
    first, second = (jnp.pad(x, ((0, 1), (0, 0))) for x in (columns.first, columns.second))

    def step(i, carry):
        X, under = carry
        k = m - 1 - i

        def left_of(X, M, right, k):
            each, of = (jax.lax.dynamic_index_in_dim(x, k, 0, keepdims=False) for x in (M, right))
            return of[:m] - summed(each[:m, None] * X[:m])

        here = rows.read(materialised(left_of, X, M, right, k))
        block = jax.lax.dynamic_slice(M, (k, k, 0), (2, 2, c))
        pair, later = (jax.lax.dynamic_index_in_dim(x, k, keepdims=False) for x in (first, second))
        top, bottom = rows.solved(k, block, pair, here, under)
        old = jax.lax.dynamic_index_in_dim(X, k + 1, keepdims=False)
        two = jnp.stack([jnp.where(later, 0.0, top), jnp.where(pair, bottom, old)])
        return jax.lax.dynamic_update_slice_in_dim(X, two, k, 0), here

    nothing = jnp.zeros((m + 1, m, c)), rows.read(jnp.zeros((m, c)))
    return jax.lax.fori_loop(0, m, step, nothing)[0][:m]


class _Elimination(NamedTuple):
    """What solves two equations for each column, or the first alone."""

    swap: Bool[Array, "m c"]  # whether the second equation comes first
    pivot: Complex[Array, "m c"]  # its reciprocal
    share: Complex[Array, "m c"]  # of the first that is taken from the other
    last: Complex[Array, "m c"]  # the reciprocal of what is left
    right: Complex[Array, "m c"]  # the other coefficient of the first

    def solved(self, pair, here, under):
        """Both unknowns."""
        first, second = jnp.where(self.swap, under, here), jnp.where(self.swap, here, under)
        bottom = (second - self.share * first) * self.last
        return (first - jnp.where(pair, self.right * bottom, 0.0)) * self.pivot, bottom


class _VectorRows(NamedTuple):
    """Rows of vectors: what is left is (block - pole) rows; of a block's own poles its vectors."""

    columns: _Columns
    least: Float[Array, " c"]

    def read(self, left):
        """The numbers of the columns."""
        return materialised(lambda left, columns: columns.numbers(left), left, self.columns)

    def eliminated(self, block, pair) -> _Elimination:
        """With the larger entry of the first column as pivot: an equal pole's block is singular."""
        (a, b), (low, d) = block
        one, two = a - self.columns.pole, d - self.columns.pole
        swap = pair & (one.real * one.real + one.imag * one.imag < low * low)
        right = jnp.where(swap, two, b)
        pivot = _reciprocal(jnp.where(swap, low, one), self.least)
        share = jnp.where(swap, one, low) * pivot
        last = _reciprocal(jnp.where(swap, b, two) - share * right, self.least)
        return _Elimination(swap, pivot, share, last, right)

    def solved(self, k, block, pair, here, under):
        """See `_from_last`."""
        (a, b), _ = block
        columns, pole = self.columns, self.columns.pole
        number = np.arange(len(pole))[:, None]
        e = materialised(lambda block, pair, rows: rows.eliminated(block, pair), block, pair, self)
        top, bottom = (columns.packed(x) for x in e.solved(pair, here, under))
        own, below = number == k, (number == k + 1) & pair  # (b, pole - a) of two rows, 1 of one
        top = jnp.where(own, jnp.where(pair, b, 1.0), jnp.where(below, 0.0, top))
        bottom = jnp.where(own, pole.real - a, jnp.where(below, pole.imag, bottom))
        return jnp.where(number >= k, top, 0.0), jnp.where(number >= k, bottom, 0.0)


class _InverseRows(NamedTuple):
    """Rows of the inverse of vectors."""

    def read(self, left):
        """As it is."""
        return left

    def solved(self, k, block, pair, here, under):
        """See `_from_last`."""
        del k
        (a, b), (low, d) = block
        whole = 1 / jnp.where(pair, a * d - b * low, a)
        top = jnp.where(pair, d * here - b * under, here) * whole
        return top, (a * under - low * here) * whole


def _sizes(vector, imaginary) -> Float[Array, "m c"]:
    """The largest entry of each vector."""
    square = across(jnp.maximum, vector * vector)
    other = jnp.where(imaginary > 0, jnp.roll(square, -1, axis=0), jnp.roll(square, 1, axis=0))
    return jnp.sqrt(square + jnp.where(imaginary != 0, other, 0.0))
