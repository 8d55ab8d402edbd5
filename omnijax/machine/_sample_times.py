"""Sample times of a log: gaps, even grids; what hangs on them."""

import numpy as np

from .._white_noise import noise_squares

BRIDGED = 5  # steps, of a gap that a straight line bridges; a signal bends over a longer one
MOST = 1000  # samples by which a first speed is told
FOLLOWED = 1.5  # times their noise that samples may be off a parabola which they follow


def travelled(velocity: np.ndarray, step: float) -> np.ndarray:
    """Position (t,) from 0 of a sampled velocity."""
    steps = (velocity[1:] + velocity[:-1]) * step / 2
    return np.concatenate([[0.0], np.cumsum(steps)])


def first_speed(position: np.ndarray, step: float) -> float:
    """Speed at the first of some sampled positions (t,): of a parabola through the first ones.

    Through as many as it follows within their noise: quantised ones have no first difference.
    """
    moves = np.abs(np.diff(position))
    count = np.min(moves[moves > 0], initial=np.inf)  # of an encoder, or next to nothing
    squares = min(np.mean(noise_squares(position, order)) for order in (3, 5, 7))
    noise = np.sqrt(max(squares, count**2 / 12 if np.isfinite(count) else 0.0))
    samples = min(len(position), MOST)
    while True:
        t = step * np.arange(samples)
        table = np.stack([np.ones(samples), t, t * t / t[-1]], 1)
        told = np.linalg.lstsq(table, position[:samples])[0]
        left = position[:samples] - table @ told
        if samples <= 4 or np.sum(left**2) < (samples - 3) * (FOLLOWED * noise) ** 2:
            return float(told[1])
        samples = max(samples * 2 // 3, 3)


def jitters(t: np.ndarray, step: float) -> bool:
    """Whether times (t,) differ from an even grid: samples are missing, or a clock is coarse."""
    return bool(np.max(np.abs(np.diff(t) - step)) > 0.02 * step)


def evenly(t: np.ndarray, step: float, *channels: np.ndarray) -> list[np.ndarray]:
    """Channels (t,) at rising times laid on an even grid; as they are where it is even already."""
    if np.any(np.diff(t) <= 0) or not jitters(t, step):
        return list(channels)
    grid = np.arange(round((t[-1] - t[0]) / step) + 1) * step
    return [np.interp(grid, t - t[0], x) for x in channels]


def unbroken(t: np.ndarray) -> slice:
    """The longest stretch of rising times (t,) without a gap that no straight line bridges.

    In a log of uneven steps a gap is three times as long as nearly all of them.
    """
    steps = np.diff(t)
    far = steps > max(BRIDGED * np.median(steps), 3 * np.quantile(steps, 0.99))
    cuts = [0, *(np.flatnonzero(far) + 1).tolist(), len(t)]
    return max(map(slice, cuts[:-1], cuts[1:]), key=lambda part: part.stop - part.start)
