"""Which states of a batch of designs move each other: blocks whose poles are found one by one.

Identical contacts decouple along the principal directions of their normals, orthogonal ones along
the normals themselves, and contacts of the `paper` variant always.  Poles of different blocks may
coincide; inside its block a pole is then simple, so its eigenvectors are good ones.
"""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ....rig import Rig
from ..system import Layout, System

NOISE = 1e-14  # of the largest entry: what rounding leaves of a zero


def turned_states(rigs: Rig, system: System) -> np.ndarray | None:
    """Directions (m, m) of states that decouple a batch whose own do not; None without."""
    normal = np.asarray(rigs.wheels.normal)
    m, n = system.A.shape[-1], normal.shape[1]
    if m < 2 * (3 + n) or np.any(normal != normal[0]):
        return None
    sphere, wheels = _directions(normal[0])
    turn, first = np.eye(m), 0
    for part in (sphere, wheels, sphere, wheels):
        turn[first : first + len(part), first : first + len(part)] = part
        first += len(part)
    for some in (_first, lambda A: A):  # mostly the first design tells
        if len(blocks_of(np.asarray(_coupled_along(some(system.A), turn)))) == 1:
            return None
    return turn


def _directions(normal: Float[np.ndarray, "n 3"]) -> tuple[np.ndarray, np.ndarray]:
    """Orthonormal directions of the sphere and of the wheels that pair by pair move each other."""
    gram = normal @ normal.T
    if len(normal) == 3 and np.allclose(gram, np.diag(np.diag(gram)), atol=1e-12):
        return normal.T / np.sqrt(np.diag(gram)), np.eye(3)
    wheels, _, sphere = np.linalg.svd(normal)
    return sphere.T, wheels


def blocks_of(pattern: np.ndarray) -> list[tuple[int, ...]]:
    """Groups of states between which nothing is coupled, by which entries of A are there."""
    reach = pattern | pattern.T | np.eye(len(pattern), dtype=bool)
    while np.any(further := (reach.astype(int) @ reach > 0) & ~reach):
        reach = reach | further
    return sorted({tuple(np.flatnonzero(row).tolist()) for row in reach})  # pyright: ignore


def coupled(system: System) -> np.ndarray:
    """Which states of a batch (m, m) move each other."""
    return np.asarray(_coupled(system.A))


@jax.jit
def _coupled(A):
    """Which entries of a batch of matrices (c, m, m) are more than rounding."""
    return jnp.any(jnp.abs(A) > NOISE * jnp.abs(A).max(axis=(1, 2), keepdims=True), axis=0)


@jax.jit
def _first(A):
    return A[:1]


@jax.jit
def _coupled_along(A, turn):
    """The same of states along other directions, the columns of `turn`."""
    return _coupled(turn.T @ A @ turn)


@jax.jit
def _present(matrices):
    """Which entries of the rows of batches of matrices are more than rounding."""
    sizes = [jnp.abs(x) for x in matrices]
    return [jnp.any(x > NOISE * x.max(axis=2, keepdims=True), axis=0) for x in sizes]


def decoupled(system: System, layout: Layout, coupling: np.ndarray) -> Layout:
    """The layout with a batch's blocks, and what outputs show of poles, sinusoids and tables."""
    m = system.A.shape[-1]
    blocks = [tuple(block) + (-1,) * (len(block) % 2) for block in blocks_of(coupling)]
    member = np.repeat([[i in block for i in range(m)] for block in blocks],
                       [len(block) // 2 for block in blocks], axis=0)  # fmt: skip
    present = _present((system.C, system.column, system.direct, system.rate))
    C, column, direct, rate = (np.asarray(x) for x in present)
    shown, moved = C @ member.T, column @ member.T  # (o or l, p)
    seen = (direct | rate).T | (shown @ moved.T)
    return layout._replace(
        blocks=tuple(blocks),
        same=_equal(system.A, blocks),
        live=tuple(tuple(np.flatnonzero(row).tolist()) for row in shown),
        waves=tuple(tuple(np.flatnonzero(row).tolist()) for row in seen[:, layout.column_of]),
        tabled=tuple(tuple(np.flatnonzero(row).tolist()) for row in seen[:, list(layout.tables)]),
    )


def _equal(A: Array, blocks: list[tuple[int, ...]]) -> tuple[int, ...]:
    """Number of the first block that each block of a batch is equal to."""
    states = [np.array([i for i in block if i >= 0]) for block in blocks]
    firsts: list[int] = []
    for i in range(len(blocks)):
        like = (j for j in dict.fromkeys(firsts) if len(states[j]) == len(states[i]))
        firsts.append(next((j for j in like if _alike(A, states[i], states[j])), i))
    return tuple(firsts)


@jax.jit
def _alike(A, one, other):
    """Whether the blocks of these states differ by rounding alone, in all matrices of a batch."""
    a, b = (A[:, states[:, None], states] for states in (one, other))
    return jnp.all(jnp.abs(a - b) <= NOISE * jnp.abs(a).max(axis=(1, 2), keepdims=True))
