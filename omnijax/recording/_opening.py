"""The first moment of a measured run: values and rates there, from its first samples."""

import math

import numpy as np

FIRST = 20  # samples that say so
DEGREE = 3  # of the course of what is asked for: delays and lags bend it


def at_first_sample(
    time: np.ndarray, values: np.ndarray, order: int = 0
) -> tuple[np.ndarray, np.ndarray]:
    """Values, or their `order`-th derivatives, at the first sample, and their 1-sigma, (c,) each.

    From a polynomial through the first samples of `values` (t, c) at `time` (s), so that a machine
    that speeds up from rest has no speed there yet; single wrong samples are passed over.  NaN
    where half of these samples or more are missing.
    """
    time, values = time[:FIRST] - time[0], values[:FIRST]
    value, sigma = np.array([_fitted(time, column, order) for column in values.T]).T
    return value, sigma


def _fitted(time: np.ndarray, column: np.ndarray, order: int) -> tuple[float, float]:
    good = np.isfinite(column)
    if good.sum() <= FIRST // 2:
        return math.nan, math.nan
    course = _without_peaks(column[good])
    powers = np.vander(time[good], DEGREE + order + 1, increasing=True)
    powers, scale = powers / powers.max(axis=0), powers.max(axis=0)
    inverse = np.linalg.pinv(powers)
    fit = inverse @ course
    scatter = np.linalg.norm(course - powers @ fit) / math.sqrt(len(powers) - len(fit))
    size = math.factorial(order) / scale[order]
    return float(size * fit[order]), float(size * scatter * np.linalg.norm(inverse[order]))


def _without_peaks(column: np.ndarray) -> np.ndarray:
    """The middle of each sample and its neighbours; at the ends of these and their straight line.

    It leaves what rises or falls, with its kinks, as it is.
    """
    inner = np.median([column[:-2], column[1:-1], column[2:]], axis=0)
    first, last = (
        np.median([end, near, 2 * near - next_])
        for end, near, next_ in ((column[0], *inner[:2]), (column[-1], *inner[:-3:-1]))
    )
    return np.concatenate([[first], inner, [last]])
