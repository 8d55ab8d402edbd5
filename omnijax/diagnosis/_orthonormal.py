"""Orthonormal bases of columns: what parts of a fit's rows are taken off by."""

import numpy as np


def orthonormal(columns: np.ndarray, least: float | None = None) -> np.ndarray:
    """An orthonormal basis (rows, m) of columns (rows, k), m <= k, by singular values.

    Directions of no more than the length `least` are left out.  Without `least` columns count by
    their direction alone: they are scaled to length one, and what is shorter than 1e-9 of the
    longest direction is rounding.
    """
    if least is None:
        columns = _scaled(columns)
    if columns.shape[1] == 0:
        return columns
    u, s, _ = np.linalg.svd(columns, full_matrices=False)
    return u[:, s > (1e-9 * s[0] if least is None else least)]


def orthonormal_of_many_rows(
    columns: np.ndarray, least: float | None = None, short: float = 1e-7
) -> np.ndarray:
    """The same for 1e5 rows of few columns: by the eigenvalues of their products, a pass over them.

    Directions shorter than `short` of the longest one are left out: below 1e-7 they are rounding,
    for the eigenvalues are squares of lengths.
    """
    if least is None:
        columns = _scaled(columns)
    if columns.shape[1] == 0:
        return columns
    values, vectors = np.linalg.eigh(columns.T @ columns)
    kept = values > max(0.0 if least is None else least**2, short**2 * values[-1])
    return columns @ (vectors[:, kept] / np.sqrt(values[kept]))


def _scaled(columns: np.ndarray) -> np.ndarray:
    """Columns of length one; those of zeros are left out."""
    size = np.linalg.norm(columns, axis=0)
    return columns[:, size > 0] / size[size > 0]
