"""What is left of one sensor held against what is left of another that sees the same motion.

A body that moves otherwise shows in both; their noises know nothing of each other, of whatever
colour they are.
"""

import itertools

import numpy as np

from ..._search import WhereQuestion, state
from .._noise import DataRows


def accelerating(name: str, displacement: np.ndarray, step: float) -> list[WhereQuestion]:
    """Whether a channel is the acceleration of what is left of `displacement` (samples,).

    Its second derivative, by bands of a third of an octave: each has its own share of noise.
    """
    lines = np.fft.rfft(displacement - displacement.mean())
    rate = 2 * np.pi * np.fft.rfftfreq(len(displacement), step)
    columns = _in_bands(-(rate**2) * lines, len(displacement))
    size = np.linalg.norm(columns, axis=0)
    columns = columns[:, size > 0] / size[size > 0]
    return [state(f"motion {name}", columns)] if columns.shape[1] else []


def rolled(speed: np.ndarray, axis: np.ndarray, step: float, windows: list[slice]) -> np.ndarray:
    """(samples, 1): the rolled length that what is left of the rotation `speed` (samples, 3) is.

    About the wheel's `axis` (samples or 1, 3).  Length and speed at the start of every window are
    free in both sensors together, so a straight line in a window says nothing.
    """
    length = np.cumsum(np.sum(speed * axis, axis=1, keepdims=True), axis=0) * step
    return beside_starts(length, windows)


def beside_starts(lengths: np.ndarray, windows: list[slice]) -> np.ndarray:
    """Lengths (samples, k), NaN where none counts, less the straight line of every window.

    What is left of a measured length holds one where a gyro has a bias: half of it goes over to the
    start, and the length is off by as much in the other direction.
    """
    out = lengths.copy()
    for window in windows:
        part = out[window]
        line = np.vander(np.linspace(-1, 1, len(part)), 2)
        for column in part.T:
            seen = np.isfinite(column)
            column[seen] -= line[seen] @ np.linalg.lstsq(line[seen], column[seen], rcond=None)[0]
    return out


def turned_lengths(
    rows: DataRows, vector: np.ndarray, axes: np.ndarray, step: float
) -> tuple[np.ndarray, np.ndarray]:
    """What is left of the rolled lengths in sigma (samples, n), NaN where nothing counts, and what
    they would be left by what is left of Omega: both beside the free starts.

    Of a run's rows and its whitened vector; wheels' `axes` (samples or 1, n, 3).
    """
    table, weight = rows.unwhitened_rotation(vector), rows.rotation
    speed = np.divide(table, weight, out=np.zeros_like(table), where=weight > 0)[:, :3]
    windows = rows.windows
    shapes = [rolled(speed, axes[:, k], step, windows) for k in range(axes.shape[1])]
    return beside_starts(table[:, 3:], windows), np.concatenate(shapes, axis=1)


def _in_bands(lines: np.ndarray, count: int) -> np.ndarray:
    """Signals (count, bands) of Fourier lines, by bands of a third of an octave."""
    edges = np.unique(np.round(2.0 ** np.arange(0, np.log2(len(lines)), 1 / 3)).astype(int))
    parts = np.zeros((len(edges), len(lines)), complex)
    for k, (first, last) in enumerate(itertools.pairwise([*edges, len(lines)])):
        parts[k, first:last] = lines[first:last]
    return np.fft.irfft(parts, count, axis=1).T
