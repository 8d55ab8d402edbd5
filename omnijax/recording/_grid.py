"""Even times of a run: which they are, where its samples lie on them, and outputs moved there.

A file may print rounded times of an even clock: its samples are even, and stay as they are.  Those
of an uneven clock are moved, each by what a curve through its neighbours does between the two
times.  So its own noise stays, and white noise stays white; interpolation would average it.
"""

import itertools
from typing import NamedTuple

import numpy as np

LATE = 1.5  # steps; a longer one is a missing stretch
UNEVEN = 0.05  # of a step
NEAR = 0.5  # of the median step, within which a step is a usual one
BRIDGE = 5  # rows of an input that are bridged by a straight line without loss
PLACES = 7  # decimals of times in s that are told apart: us, and what is finer
WHOLE = 0.01  # of a last decimal, by which a time may be off it
POINTS, DEGREE = 7, 4  # of the curve along which a sample is moved


class EvenTimes(NamedTuple):
    """Even times of a run from its first sample, and where its samples lie on them.

    `step` in s, `place` (t,) in steps: whole numbers where the samples are `even`.  `rounding` is
    the last decimal of the times in s, where that makes the steps uneven; else 0.
    """

    step: float
    place: np.ndarray
    even: bool
    rounding: float = 0.0

    @property
    def size(self) -> int:
        """Number of even times."""
        return int(self.place[-1] + UNEVEN) + 1

    @property
    def gaps(self) -> np.ndarray:
        """Whether something is missing after each sample but the last one, (t - 1,)."""
        return np.diff(self.place) > LATE

    @property
    def nearest(self) -> tuple[np.ndarray, np.ndarray]:
        """The sample (k,) nearest to each even time, and whether it stands for it."""
        at = np.arange(self.size)
        after = np.clip(np.searchsorted(self.place, at), 1, len(self.place) - 1)
        nearer = self.place[after] - at < at - self.place[after - 1]
        sample = np.where(nearer, after, after - 1)
        return sample, np.abs(self.place[sample] - at) <= LATE / 2


def usual_step(steps: np.ndarray, rounding: float = 0.0) -> float:
    """The step of a log from all of its positive ones (n,): the mean of those near their median.

    Stamps are rounded, seconds since 1970 to 0.24 us, and so is each step.
    """
    median = float(np.median(steps))
    near = max(NEAR * median, (1 + WHOLE) * rounding)
    return float(np.mean(steps[np.abs(steps - median) < near]))


def grid_of(time: np.ndarray) -> EvenTimes:
    """The even times that increasing ones (t,) in s lie on: exactly, rounded, or not at all."""
    rounding = _last_decimal(time)
    for off in (0.0, rounding):
        step, count, away = _counted(time, usual_step(np.diff(time), off))
        if away <= max(UNEVEN * step, off):
            return EvenTimes(step, count, True, off)
    step = usual_step(np.diff(time))
    return EvenTimes(step, (time - time[0]) / step, False)


def _counted(time: np.ndarray, step: float) -> tuple[float, np.ndarray, float]:
    """(step, number of each sample (t,), largest misfit in s): times as an even clock's.

    From about how long a step is.  The line is laid about that in few digits: a step of 0.002 s
    stays just that.
    """
    steps = np.maximum(np.rint(np.diff(time) / step), 1.0)
    count, since = np.concatenate([[0.0], np.cumsum(steps)]), time - time[0]
    about = float(f"{step:.9g}")
    more, first = np.polyfit(count, since - about * count, 1)
    slope = about + float(more)
    return slope, count, float(np.abs(since - first - slope * count).max())


def _last_decimal(time: np.ndarray) -> float:
    """What the last decimal of times (t,) is worth, in s; 0 where they have too many."""
    since = time - time[0]
    for unit in 10.0 ** -np.arange(PLACES):
        if np.all(np.abs(since / unit - np.rint(since / unit)) < WHOLE):
            return float(unit)
    return 0.0


def longer_than_bridged(bad: np.ndarray) -> np.ndarray:
    """Where stretches of true values (t,) are too long for a straight line."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], bad, [False]]).astype(int)))
    out = np.zeros(len(bad), bool)
    for a, b in edges.reshape(-1, 2):
        out[a:b] = b - a > BRIDGE
    return out


def on_even_times(grid: EvenTimes, values: np.ndarray) -> np.ndarray:
    """Samples (t, c) at the even times (k, c); NaN where something is missing.

    Where they are not even, each moves along the curve (least squares) through its neighbours on
    the same side of every gap; where these are too few, nothing is known.

    Source: Savitzky, Golay, Smoothing and differentiation of data (1964).
    """
    sample, stands = grid.nearest
    out = np.full((grid.size, values.shape[1]), np.nan)
    if grid.even:
        out[stands] = values[sample[stands]]
        return out
    ends = np.concatenate([[0], np.flatnonzero(grid.gaps) + 1, [len(values)]])
    for first, end in itertools.pairwise(ends.tolist()):
        at = np.flatnonzero(stands & (sample >= first) & (sample < end))
        if end - first >= POINTS:
            out[at] = _moved(grid.place[first:end], values[first:end], sample[at] - first, at)
    return out


def _moved(place: np.ndarray, values: np.ndarray, sample: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Samples of the numbers `sample` (k,) at the places `at` (k,), by values (t, c) at places."""
    start = np.clip(sample - POINTS // 2, 0, len(place) - POINTS)
    near = start[:, None] + np.arange(POINTS)
    powers = (place[near] - place[sample, None])[:, :, None] ** np.arange(1, DEGREE + 1)
    whole = np.concatenate([np.ones((*near.shape, 1)), powers], axis=2)
    to = (at - place[sample])[:, None] ** np.arange(1, DEGREE + 1)
    weights = np.einsum("kd,kdp->kp", to, np.linalg.pinv(whole)[:, 1:])
    return values[sample] + np.einsum("kp,kpc->kc", weights, values[near])
