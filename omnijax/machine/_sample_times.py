"""Sample times of a log: gaps, even grids; what hangs on them."""

import numpy as np

BRIDGED = 5  # steps, of a gap that a straight line bridges; a signal bends over a longer one
NEAR = 0.5  # of the median step, within which a step is a usual one


def travelled(velocity: np.ndarray, step: float) -> np.ndarray:
    """Position (t,) from 0 of a sampled velocity."""
    steps = (velocity[1:] + velocity[:-1]) * step / 2
    return np.concatenate([[0.0], np.cumsum(steps)])


def usual_step(steps: np.ndarray) -> float:
    """The step of a log from all of its positive ones (n,): the mean of those near their median.

    Stamps are rounded, seconds since 1970 to 0.24 us, and so is each step.
    """
    median = float(np.median(steps))
    return float(np.mean(steps[np.abs(steps - median) < NEAR * median]))


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
