"""What is left of one sensor held against what is left of another that sees the same motion.

A body that moves otherwise shows in both; their noises know nothing of each other, of whatever
colour they are.
"""

import itertools

import numpy as np

from ..._search import WhereQuestion, state


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
    out = np.cumsum(np.sum(speed * axis, axis=1, keepdims=True), axis=0) * step
    for window in windows:
        part = out[window]
        line = np.vander(np.linspace(-1, 1, len(part)), 2)
        out[window] = part - line @ np.linalg.lstsq(line, part, rcond=None)[0]
    return out


def _in_bands(lines: np.ndarray, count: int) -> np.ndarray:
    """Signals (count, bands) of Fourier lines, by bands of a third of an octave."""
    edges = np.unique(np.round(2.0 ** np.arange(0, np.log2(len(lines)), 1 / 3)).astype(int))
    parts = np.zeros((len(edges), len(lines)), complex)
    for k, (first, last) in enumerate(itertools.pairwise([*edges, len(lines)])):
        parts[k, first:last] = lines[first:last]
    return np.fft.irfft(parts, count, axis=1).T
