"""Linear recursions of first order along a signal, by the band solver of BLAS.

`scipy.signal.lfilter` does the same in twice the time, and takes a second to import.
"""

import functools

import numpy as np
from scipy.linalg.blas import get_blas_funcs

BLOCK = 1024  # samples that one call of the solver takes: its matrix has as many columns


def recursion(keep: complex, values: np.ndarray) -> None:
    """y_i = keep y_(i-1) + x_i of a contiguous signal x (n,), y_0 = x_0, in place.

    `keep` and signal are both real or both complex.
    """
    (solve,) = get_blas_funcs(("tbsv",), (values,))
    band = _band(keep)
    for first in range(0, len(values) - 1, BLOCK - 1):  # the last of a block begins the next one
        part = values[first : first + BLOCK]
        solve(1, band[:, : len(part)], part, lower=1, diag=1, overwrite_x=1)


@functools.lru_cache(maxsize=64)
def _band(keep: complex) -> np.ndarray:
    """Diagonal and the one below it (2, BLOCK) of the matrix that takes y to x."""
    band = np.empty((2, BLOCK), type(keep), order="F")
    band[0], band[1] = 1.0, -keep
    band.flags.writeable = False
    return band
