"""Small linear systems without a library: for three unknowns a call costs more than the work.

Measured on one core, the least of 30, for a batch of 512 systems (time to compile; time to run):

    unknowns, right-hand sides    here            jnp.linalg.solve    lineax's LU
    3, 1                          0.11 s; 25 us   0.31 s; 138 us      0.53 s; 159 us
"""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float


def _adjugate(matrix: Float[Array, "3 3"]) -> tuple[jax.Array, jax.Array]:
    """Adjugate, whose columns are cross products of rows, and determinant."""
    a, b, c = matrix
    columns = jnp.stack([jnp.cross(b, c), jnp.cross(c, a), jnp.cross(a, b)], axis=-1)
    return columns, a @ columns[:, 0]


def inverse(matrix: Float[Array, "3 3"]) -> Float[Array, "3 3"]:
    """Inverse of a 3x3 matrix."""
    columns, determinant = _adjugate(matrix)
    return columns / determinant


def solve(matrix: Float[Array, "n n"], right: Float[Array, " n"]) -> Float[Array, " n"]:
    """Solution x of matrix x = right; closed form for n = 3."""
    if matrix.shape != (3, 3):
        return jnp.linalg.solve(matrix, right)
    columns, determinant = _adjugate(matrix)
    return columns @ right / determinant


def pseudoinverse(matrix: Float[Array, "n m"]) -> Float[Array, "m n"]:
    """Moore and Penrose's inverse; the inverse itself for n = m = 3."""
    return inverse(matrix) if matrix.shape == (3, 3) else jnp.linalg.pinv(matrix)


def least_squares(matrix: Float[Array, "n m"], right: Float[Array, " n"]) -> Float[Array, " m"]:
    """Least x of all those with least |matrix x - right|."""
    return solve(matrix, right) if matrix.shape == (3, 3) else jnp.linalg.pinv(matrix) @ right
