"""White noise of a sampled signal, told by its differences.

Of white noise of 1-sigma s the k-th difference has the mean square C(2k, k) s^2, while whatever
moves slowly against the sampling drops out.

Source: variate differences (Anderson, The Statistical Analysis of Time Series, 1971, chapter 3).
"""

import math

import numpy as np


def noise_squares(values: np.ndarray, order: int, axis: int = 0) -> np.ndarray:
    """Squares of the differences of one order along an axis, in variances of the white noise.

    Shorter by `order` along the axis; NaN beside missing values.
    """
    return np.diff(values, order, axis=axis) ** 2 / math.comb(2 * order, order)


def repetition(order: int) -> float:
    """How many neighbouring squares say the same: C(4k, 2k)/C(2k, k)^2.

    Neighbouring differences are correlated; so much do the squares of their correlations add up to.
    """
    return math.comb(4 * order, 2 * order) / math.comb(2 * order, order) ** 2
