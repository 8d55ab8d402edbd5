"""Linear recursions of first order along signals, by the band solver of BLAS.

`scipy.signal.lfilter` does the same in twice the time.
"""

import functools
from collections.abc import Sequence

import numpy as np
from scipy.linalg.blas import get_blas_funcs

BLOCK = 1024  # samples that one call of the solver takes: its matrix has as many columns


def recursion(keep: Sequence[complex], values: np.ndarray) -> None:
    """y_i = keep y_(i-1) + x_i of contiguous signals x (n, k), in place; y_0 = x_0.

    `keep` holds one number a signal; all are real or all complex.
    """
    (solve,) = get_blas_funcs(("tbsv",), (values,))
    bands, width = [_band(x) for x in keep], values.shape[1]
    for first in range(0, len(values) - 1, BLOCK - 1):  # the last of a block begins the next one
        part = values[first : first + BLOCK]
        flat, count = part.reshape(-1), len(part)
        for k, band in enumerate(bands):
            solve(1, band[:, :count], flat, incx=width, offx=k, lower=1, diag=1, overwrite_x=1)


@functools.lru_cache(maxsize=64)
def _band(keep: complex) -> np.ndarray:
    """Diagonal and the one below it (2, BLOCK) of the matrix that takes y to x."""
    band = np.empty((2, BLOCK), type(keep), order="F")
    band[0], band[1] = 1.0, -keep
    band.flags.writeable = False
    return band
