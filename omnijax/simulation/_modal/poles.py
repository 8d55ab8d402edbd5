"""Modal form of many designs: pairs of poles in real arithmetic, batch last.

A pair is complex (`kind` 1: z = z0 + i z1 moves by exp((l0 + i l1) t)) or two real poles (`kind`
0).  An output is x = sum_p c0 z0 + c1 z1.  Equal poles need no care: any basis of their space will
do.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Complex, Float

from .system import System


class Modes(NamedTuple):
    """Pole pairs (p), what they show (o) and what moves them (l: columns, then the start)."""

    kind: Float[Array, "p c"]
    l0: Float[Array, "p c"]
    l1: Float[Array, "p c"]
    c0: Float[Array, "o p c"]
    c1: Float[Array, "o p c"]
    b0: Float[Array, "l p c"]
    b1: Float[Array, "l p c"]


class Eigen(NamedTuple):
    """Eigenvalues and eigenvectors of a batch, and which two of them each pair is; batch first."""

    value: Complex[Array, "c k"]
    vector: Complex[Array, "c m k"]
    inverse: Complex[Array, "c k m"]
    output: Complex[Array, "c o k"]
    input: Complex[Array, "c k l"]
    kind: Bool[Array, "c p"]
    first: Float[Array, "c p k"]  # a one at the pair's first eigenvalue
    second: Float[Array, "c p k"]


def eigen(system: System, blocks: tuple[tuple[int, ...], ...]) -> Eigen:
    """Eigenvalues, what the outputs see of their modes and what the inputs give to them.

    `blocks` are groups of an even number of states that do not move each other; -1 stands for a
    state that nothing moves and nothing shows.
    """
    m, A = system.A.shape[-1], jax.lax.stop_gradient(system.A)
    A = jnp.pad(A, ((0, 0), (0, 1), (0, 1))).at[:, -1, -1].set(-1.0)
    values, vectors, inverses = [jnp.zeros(0)] * len(blocks), {}, {}
    for size in sorted({len(block) for block in blocks}):
        number = [i for i, block in enumerate(blocks) if len(block) == size]
        parts = [A[:, blocks[i]][:, :, blocks[i]] for i in number]
        value, vector = jnp.linalg.eig(jnp.stack(parts, axis=1))
        inverse = jnp.linalg.inv(vector)
        for j, i in enumerate(number):
            values[i], vectors[i], inverses[i] = value[:, j], vector[:, j], inverse[:, j]
    order = np.concatenate(blocks)
    place = [int(np.flatnonzero(order == i)[0]) for i in range(m)]
    vector = _diagonal([vectors[i] for i in range(len(blocks))])[:, place]
    inverse = _diagonal([inverses[i] for i in range(len(blocks))])[:, :, place]
    right = jnp.concatenate([system.column, system.start[:, None]], axis=1)
    pairs = [_paired(value) for value in values]
    return Eigen(
        jnp.concatenate(values, axis=1),
        vector,
        inverse,
        system.C @ vector,
        inverse @ jnp.swapaxes(right, 1, 2),
        jnp.concatenate([pair[0] for pair in pairs], axis=1),
        _diagonal([pair[1] for pair in pairs]),
        _diagonal([pair[2] for pair in pairs]),
    )


def _diagonal(parts: list[Array]) -> Array:
    """Batches of matrices (c, i, j) along the diagonal of one batch."""
    rows, total, first = [], sum(part.shape[2] for part in parts), 0
    for part in parts:
        after = total - first - part.shape[2]
        rows.append(jnp.pad(part, ((0, 0), (0, 0), (first, after))))
        first += part.shape[2]
    return jnp.concatenate(rows, axis=1)


def _paired(value):
    """Complex pairs first, then the real eigenvalues two by two, in the order of `value`."""
    pairs = value.shape[1] // 2
    upper, real = value.imag > 0, value.imag == 0
    count = jnp.sum(upper, axis=1, keepdims=True)
    place = jnp.cumsum(upper, axis=1) - 1
    among = jnp.cumsum(real, axis=1) - 1
    own = jnp.where(upper, place, jnp.where(real, count + among // 2, -1))  # pair of each
    lower = value.imag < 0
    own = jnp.where(lower, jnp.cumsum(lower, axis=1) - 1, own)
    late = lower | (real & (among % 2 == 1))
    number = jnp.arange(pairs)[None, :, None]
    here = own[:, None, :] == number
    kind = jnp.arange(pairs) < count
    return (
        kind,
        jnp.where(here & ~late[:, None], 1.0, 0.0),
        jnp.where(here & late[:, None], 1.0, 0.0),
    )


def modes_of(found: Eigen) -> Modes:
    """The pairs in real arithmetic."""

    def picked(x, one):  # (c, ..., m) -> (..., p, c)
        real = jnp.einsum("c...m,cpm->...pc", x.real, one)
        return real, jnp.einsum("c...m,cpm->...pc", x.imag, one)

    kind = found.kind.T
    (a, b), (d, _) = picked(found.value, found.first), picked(found.value, found.second)
    (ca, cb), (cd, _) = picked(found.output, found.first), picked(found.output, found.second)
    inputs = jnp.swapaxes(found.input, 1, 2)
    (ba, bb), (bd, _) = picked(inputs, found.first), picked(inputs, found.second)
    return Modes(
        jnp.where(kind, 1.0, 0.0),
        a,
        jnp.where(kind, b, d),
        jnp.where(kind, 2 * ca, ca),
        jnp.where(kind, -2 * cb, cd),
        ba,
        jnp.where(kind, bb, bd),
    )
