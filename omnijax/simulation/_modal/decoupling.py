"""Which states of a batch of designs move each other: blocks whose poles are found one by one.

Identical contacts decouple along the principal directions of their normals, orthogonal ones along
the normals themselves, and contacts of the `paper` variant always.  Poles of different blocks may
coincide; inside its block a pole is then simple, so its eigenvectors are good ones.
"""

import numpy as np
from jaxtyping import Array, Float

from ...rig import Rig
from .system import Layout, System

NOISE = 1e-14  # of the largest entry: what rounding leaves of a zero


def turned_states(rigs: Rig, system: System) -> np.ndarray | None:
    """Directions (m, m) of states that decouple a batch better than its own; None without."""
    normal = np.asarray(rigs.wheels.normal)
    m, n = system.A.shape[-1], normal.shape[1]
    if m < 2 * (3 + n) or np.any(normal != normal[0]) or len(_blocks(system.A)) > 1:
        return None
    sphere, wheels = _directions(normal[0])
    turn, first = np.eye(m), 0
    for part in (sphere, wheels, sphere, wheels):
        turn[first : first + len(part), first : first + len(part)] = part
        first += len(part)
    A = np.asarray(system.A)
    return turn if len(_blocks(turn.T @ (A / _size(A)) @ turn)) > 1 else None


def _directions(normal: Float[np.ndarray, "n 3"]) -> tuple[np.ndarray, np.ndarray]:
    """Orthonormal directions of the sphere and of the wheels that pair by pair move each other."""
    gram = normal @ normal.T
    if len(normal) == 3 and np.allclose(gram, np.diag(np.diag(gram)), atol=1e-12):
        return normal.T / np.sqrt(np.diag(gram)), np.eye(3)
    wheels, _, sphere = np.linalg.svd(normal)
    return sphere.T, wheels


def _size(A):
    return np.abs(A).max(axis=(1, 2), keepdims=True)


def _blocks(A: Array | np.ndarray) -> list[list[int]]:
    """Groups of states, of a batch of matrices (c, m, m), between which nothing is coupled."""
    A = np.abs(np.asarray(A))
    pattern = np.any(NOISE * _size(A) < A, axis=0)
    reach = pattern | pattern.T | np.eye(len(pattern), dtype=bool)
    while np.any(further := (reach.astype(int) @ reach > 0) & ~reach):
        reach = reach | further
    return sorted({tuple(np.flatnonzero(row).tolist()) for row in reach})  # pyright: ignore


def decoupled(system: System, layout: Layout) -> Layout:
    """The layout with the blocks of a batch, and what each output shows of poles and sinusoids."""
    A = np.asarray(system.A)
    blocks = [tuple(block) + (-1,) * (len(block) % 2) for block in _blocks(A)]
    member = np.repeat([[i in block for i in range(A.shape[1])] for block in blocks],
                       [len(block) // 2 for block in blocks], axis=0)  # fmt: skip
    shown, moved = (_present(x) @ member.T for x in (system.C, system.column))  # (o or l, p)
    straight = _present(system.direct) | _present(system.rate)  # (l, o)
    seen = straight.T | (shown @ moved.T)
    columns = [layout.kinds[i].column for i in layout.signal_of]
    return layout._replace(
        blocks=tuple(blocks),
        same=_equal(A, blocks),
        live=tuple(tuple(np.flatnonzero(row).tolist()) for row in shown),
        waves=tuple(tuple(np.flatnonzero(row).tolist()) for row in seen[:, columns]),
    )


def _present(x) -> np.ndarray:
    """Which entries of the rows of a batch of matrices are more than rounding."""
    x = np.abs(np.asarray(x))
    return np.any(x > NOISE * x.max(axis=2, keepdims=True), axis=0)


def _equal(A: np.ndarray, blocks: list[tuple[int, ...]]) -> tuple[int, ...]:
    """Number of the first block that each block of a batch is equal to."""
    padded, size = np.pad(A, ((0, 0), (0, 1), (0, 1))), NOISE * _size(A)
    found: list[int] = []
    for i, block in enumerate(blocks):
        own, same = padded[:, block][:, :, block], i
        for j in dict.fromkeys(found):
            if len(blocks[j]) == len(block):
                other = padded[:, blocks[j]][:, :, blocks[j]]
                same = j if same == i and np.all(np.abs(own - other) <= size) else same
        found.append(same)
    return tuple(found)
