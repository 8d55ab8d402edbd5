"""Modal form of many designs: pairs of poles in real arithmetic, batch last.

A pair is complex (`kind` 1: z = z0 + i z1 moves by exp((l0 + i l1) t)) or two real poles (`kind`
0).  An output is x = sum_p c0 z0 + c1 z1.  Equal poles need no care: any basis of their space will
do.
"""

from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Complex, Float

from ..._exact import GROWTH
from ..arithmetic import Pair, rows
from ..system import Layout, System
from .quartics import SIZES as CLOSED
from .quartics import BlockPoles, block_poles
from .shifted_qr import Decomposed, decomposed, pays


class PolePairs(NamedTuple):
    """Pole pairs (p), what they show (o) and what moves them (l: columns, then the start)."""

    kind: Float[Array, "p c"]
    l0: Float[Array, "p c"]
    l1: Float[Array, "p c"]
    c0: Float[Array, "o p c"]
    c1: Float[Array, "o p c"]
    b0: Float[Array, "l p c"]
    b1: Float[Array, "l p c"]

    def given(self, columns: Sequence[int]) -> Pair:
        """What some input columns give to the pairs, (l, p, c)."""
        return rows(self.b0, columns), rows(self.b1, columns)


class Eigen(NamedTuple):
    """Eigenvalues and eigenvectors of a batch, and which two of them each pair is; batch first.

    Vectors and what belongs to them are real, as LAPACK packs them: at the first of two conjugate
    eigenvalues stands the real part of its vector, at the second the imaginary part of the same.
    """

    value: Complex[Array, "c k"]
    vector: Float[Array, "c m k"]
    inverse: Float[Array, "c k m"]  # of `vector`
    output: Float[Array, "c o k"]  # C vector
    input: Float[Array, "c k l"]  # inverse column, then the start
    kind: Bool[Array, "c p"]
    first: Float[Array, "c p k"]  # a one at the pair's first eigenvalue
    second: Float[Array, "c p k"]


def grows(m: PolePairs) -> Bool[Array, " c"]:
    """Whether a pole of a design makes what it moves grow, by more than rounding."""
    second = jnp.where(m.kind > 0, m.l0, m.l1)
    return jnp.any(
        jnp.maximum(m.l0, second) > GROWTH * jnp.max(jnp.abs(m.l0) + jnp.abs(m.l1), 0), 0
    )


def eigen(system: System, layout: Layout) -> Eigen:
    """Eigenvalues, what the outputs see of their modes and what the inputs give to them.

    The layout's blocks are groups of an even number of states that do not move each other; -1
    stands for a state that nothing moves and nothing shows.
    """
    blocks, A = layout.blocks, jax.lax.stop_gradient(system.A)
    A = jnp.pad(A, ((0, 0), (0, 1), (0, 1))).at[:, -1, -1].set(-1.0)
    right = jnp.concatenate([system.column, system.start[:, None]], axis=1)
    C, right = (jnp.pad(x, ((0, 0), (0, 0), (0, 1))) for x in (system.C, right))
    first, parts = sorted(set(layout.same)), {}
    for size in sorted({len(blocks[i]) for i in first}):
        number = [i for i in first if len(blocks[i]) == size]
        several = jnp.stack([_part(A, blocks[i]) for i in number], axis=1)
        each = _decomposed(several, layout.in_step)
        for j, i in enumerate(number):
            parts[i] = tuple(x[:, j] for x in each)
    values, vectors, inverses, *pairs = zip(*(parts[i] for i in layout.same), strict=True)
    order = np.concatenate(blocks)
    place = [int(np.flatnonzero(order == i)[0]) for i in range(system.A.shape[-1])]
    own = [np.array(block) for block in blocks]
    output = [C[:, :, i] @ x for i, x in zip(own, vectors, strict=True)]
    given = [x @ jnp.swapaxes(right[:, :, i], 1, 2) for i, x in zip(own, inverses, strict=True)]
    return Eigen(
        jnp.concatenate(values, axis=1),
        _diagonal(vectors)[:, place],
        _diagonal(inverses)[:, :, place],
        jnp.concatenate(output, axis=2),
        jnp.concatenate(given, axis=1),
        jnp.concatenate(pairs[0], axis=1),
        _diagonal(pairs[1]),
        _diagonal(pairs[2]),
    )


def unpacked(x: Float[Array, "... k c"], imaginary: Float[Array, "k c"]) -> Pair:
    """What belongs to every eigenvalue of `imaginary` part, of vectors as `Eigen` packs them."""
    upper, lower = imaginary > 0, imaginary < 0
    real = jnp.where(lower, jnp.roll(x, 1, axis=-2), x)
    return real, jnp.where(upper, jnp.roll(x, -1, axis=-2), jnp.where(lower, -x, 0.0))


def unpacked_inverse(x: Float[Array, "... k c"], imaginary: Float[Array, "k c"]) -> Pair:
    """The same of the rows of the inverse."""
    real, other = unpacked(x, imaginary)
    share = jnp.where(imaginary == 0, 1.0, 0.5)
    return share * real, -share * other


def _part(A, block: tuple[int, ...]):
    return A[:, block][:, :, block]


def _diagonal(parts: Sequence[Array]) -> Array:
    """Batches of matrices (c, i, j) along the diagonal of one batch."""
    placed, total, first = [], sum(part.shape[2] for part in parts), 0
    for part in parts:
        after = total - first - part.shape[2]
        placed.append(jnp.pad(part, ((0, 0), (0, 0), (first, after))))
        first += part.shape[2]
    return jnp.concatenate(placed, axis=1)


class _Blocks(NamedTuple):
    """Eigenvalues, vectors and pairs of blocks (c, b, ...), as in `Eigen`."""

    value: Array
    vector: Array
    inverse: Array
    kind: Array
    first: Array
    second: Array


def _decomposed(A: Float[Array, "c b m m"], in_step: bool) -> _Blocks:
    """In closed form where the blocks are small, or `in_step`, where that is good for the batch."""
    if A.shape[-1] in CLOSED:
        made, way = block_poles(_batch_last(A)), _in_closed_form
    elif in_step and pays(A.shape[-1]):
        made, way = decomposed(_batch_last(A)), _by_iteration
    else:
        return _by_lapack(A)
    return jax.lax.cond(
        jnp.all(made.good), lambda A, made: way(made, A.shape), lambda A, _: _by_lapack(A), A, made
    )


def _batch_last(A):
    states = jnp.moveaxis(A, (0, 1), (-1, -2))
    return states.reshape(*states.shape[:2], -1)


def _apart(x, shape):
    """(..., b c) as (c, b, ...)."""
    return jnp.moveaxis(x.reshape(*x.shape[:-1], shape[1], shape[0]), (-1, -2), (0, 1))


def _by_iteration(made: Decomposed, shape) -> _Blocks:
    """Of blocks (c, b) side by side."""
    real, imaginary, vector, inverse = (_apart(x, shape) for x in made[:4])
    value = jax.lax.complex(real, imaginary)
    return _Blocks(value, vector, inverse, *_paired(value))


def _in_closed_form(poles: BlockPoles, shape) -> _Blocks:
    """Of blocks (c, b) side by side."""
    apart = partial(_apart, shape=shape)
    kind, one, two = (apart(x) for x in (poles.kind, poles.first, poles.second))
    real = jnp.stack([one, jnp.where(kind, one, two)], axis=-1)
    imaginary = jnp.where(kind, two, 0.0)
    value = jax.lax.complex(real, jnp.stack([imaginary, -imaginary], axis=-1))
    of = np.eye(shape[-1])
    first, second = (jnp.broadcast_to(x, (*kind.shape, shape[-1])) for x in (of[0::2], of[1::2]))
    value = value.reshape(*kind.shape[:2], -1)
    return _Blocks(value, apart(poles.vector), apart(poles.inverse), kind, first, second)


def _by_lapack(A) -> _Blocks:
    value, vector = jnp.linalg.eig(A)
    vector = jnp.where(value.imag[..., None, :] < 0, -vector.imag, vector.real)
    return _Blocks(value, vector, jnp.linalg.inv(vector), *_paired(value))


def _paired(value):
    """Complex pairs first, then the real eigenvalues two by two, in the order of `value`."""
    pairs = value.shape[-1] // 2
    upper, real = value.imag > 0, value.imag == 0
    count = jnp.sum(upper, axis=-1, keepdims=True)
    place = jnp.cumsum(upper, axis=-1) - 1
    among = jnp.cumsum(real, axis=-1) - 1
    own = jnp.where(upper, place, jnp.where(real, count + among // 2, -1))  # pair of each
    lower = value.imag < 0
    own = jnp.where(lower, jnp.cumsum(lower, axis=-1) - 1, own)
    late = lower | (real & (among % 2 == 1))
    number = jnp.arange(pairs)[:, None]
    here = own[..., None, :] == number
    kind = jnp.arange(pairs) < count
    return (
        kind,
        jnp.where(here & ~late[..., None, :], 1.0, 0.0),
        jnp.where(here & late[..., None, :], 1.0, 0.0),
    )


def modes_of(pairs: Eigen) -> PolePairs:
    """The pairs in real arithmetic."""

    def picked(x):  # (c, ..., k) -> (..., p, c), of the first and of the second of each pair
        return (jnp.einsum("c...k,cpk->...pc", x, one) for one in (pairs.first, pairs.second))

    kind = pairs.kind.T
    (a, d), (b, _) = picked(pairs.value.real), picked(pairs.value.imag)
    (c0, c1), (b0, b1) = picked(pairs.output), picked(jnp.swapaxes(pairs.input, 1, 2))
    return PolePairs(
        jnp.where(kind, 1.0, 0.0),
        a,
        jnp.where(kind, b, d),
        jnp.where(kind, 2.0, 1.0) * c0,
        jnp.where(kind, -2.0, 1.0) * c1,
        jnp.where(kind, 0.5, 1.0) * b0,
        jnp.where(kind, -0.5, 1.0) * b1,
    )
