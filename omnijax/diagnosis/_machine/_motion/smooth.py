"""Smoothing of measured rolled lengths: white jerk, its intensity by likelihood."""

import numpy as np
from scipy.linalg import cho_solve_banded, cholesky_banded

from ..._settings import SETTINGS

MISSING_WEIGHT = SETTINGS.smooth.missing_weight
DECADES = SETTINGS.smooth.decades
RATIOS = SETTINGS.smooth.ratios
THIRD = np.array([-1.0, 3.0, -3.0, 1.0])


def penalty(n: int) -> np.ndarray:
    """Upper banded form (4, n) of the third differences' D^T D."""
    band = np.zeros((4, n))
    for i, a in enumerate(THIRD):
        for j, b in enumerate(THIRD[i:], start=i):
            band[3 - (j - i), j : n - 3 + j] += a * b
    return band


def smooth(values: np.ndarray, sigma: float, ratio: float) -> tuple[np.ndarray, float]:
    """Smoothed `values` (n, c) and -2 log likelihood at jerk variance sigma^2/ratio per sample.

    Minimises sum (y - x)^2 + ratio sum (third difference of x)^2: the smoother of a white-jerk
    state; missing (NaN) samples carry next to no weight.  A parabola passes unchanged, so it is
    taken off first: at large ratios the factorisation would tilt it by 1e-4 of its size.
    """
    easy = _parabola(values)
    rest, score = _smoothed(values - easy, sigma, ratio)
    return rest + easy, score


def _smoothed(values: np.ndarray, sigma: float, ratio: float) -> tuple[np.ndarray, float]:
    """`smooth` of values without a parabola."""
    n, result, score = len(values), np.empty_like(values), 0.0
    stiff = ratio * penalty(n)
    for columns in _alike(np.isfinite(values)):
        good = np.isfinite(values[:, columns[:1]])
        weight = np.where(good, 1.0, MISSING_WEIGHT * ratio)
        y = np.where(good, values[:, columns], 0.0)
        matrix = stiff.copy()
        matrix[3] += weight[:, 0]
        factor = cholesky_banded(matrix)
        x = cho_solve_banded((factor, False), weight * y)
        result[:, columns] = x
        square = np.sum(y * weight * (y - x)) / sigma**2
        constant = 2 * np.sum(np.log(factor[3])) - (n - 3) * np.log(ratio)
        score += square + len(columns) * constant
    return result, score


def _alike(good: np.ndarray) -> list[list[int]]:
    """Columns (n, c) that are finite at the same samples: one factorisation serves them."""
    groups: dict[bytes, list[int]] = {}
    for c in range(good.shape[1]):
        groups.setdefault(good[:, c].tobytes(), []).append(c)
    return list(groups.values())


def _parabola(values: np.ndarray) -> np.ndarray:
    """Least-squares parabola (n, c) of every column's finite samples."""
    powers = np.vander(np.linspace(-1.0, 1.0, len(values)), 3)
    out = np.zeros_like(values)
    for c in range(values.shape[1]):
        good = np.isfinite(values[:, c])
        out[:, c] = powers @ np.linalg.lstsq(powers[good], values[good, c], rcond=None)[0]
    return out


def likeliest(values: np.ndarray, sigma: float) -> float:
    """The most likely ratio of noise to jerk (a ladder, two a decade)."""
    ladder, rest = np.logspace(0.0, DECADES, RATIOS), values - _parabola(values)
    scores = [_smoothed(rest, sigma, ratio)[1] for ratio in ladder]
    return float(ladder[int(np.argmin(scores))])


def smooth_by_likelihood(values: np.ndarray, sigma: float) -> np.ndarray:
    """`smooth` at the most likely ratio."""
    return smooth(values, sigma, likeliest(values, sigma))[0]
