"""Low passes of logs before differences are taken, as wide as the noise allows."""

import numpy as np
from scipy.signal import butter, filtfilt

CUTOFFS = (0.2, 0.14, 0.1, 0.07, 0.05, 0.03, 0.02, 0.01)  # of half the sampling rate
NOISY = 0.1  # share of a low-passed acceleration that may be noise
SPOILT = 20  # time constants of a low pass at both ends of a log


def low_passed(x: np.ndarray, share: float) -> np.ndarray:
    """x (t,) without what is quicker than a `share` of half the sampling rate, without lag."""
    b, a = butter(4, share)  # pyright: ignore[reportAssignmentType, reportGeneralTypeIssues]
    return filtfilt(b, a, x)


def cutoff_of(q: np.ndarray, step: float, velocity: np.ndarray | None = None) -> float:
    """The widest low pass, of half the sampling rate, that leaves little noise of acceleration.

    Positions q (t,) are measured, or, where given, the `velocity` (t,) whose integral they are.
    """
    shown, measured = (q, "position") if velocity is None else (velocity, "velocity")
    noise = float(np.sqrt(np.mean(np.diff(shown, 5) ** 2) / 252))
    for share in CUTOFFS:
        size = np.std(acceleration(low_passed(q, share), step))
        if acceleration_noise(noise, measured, share / (2 * step), step) < NOISY * size:
            return share
    return CUTOFFS[-1]


def acceleration_noise(noise: float, measured: str, cutoff: float, step: float) -> float:
    """1-sigma of an acceleration low-passed at `cutoff` Hz, of white noise sampled every `step` s.

    `noise` is 1-sigma of the position or velocity that was `measured`: its spectrum times the
    frequency to the power 4 or 2, up to the cutoff.
    """
    order = 1 if measured == "velocity" else 2
    return noise * (2 * np.pi * cutoff) ** order * np.sqrt(2 * cutoff * step / (2 * order + 1))


def acceleration(q: np.ndarray, step: float) -> np.ndarray:
    """Second difference to fourth order of the step."""
    a = np.gradient(np.gradient(q, step), step)
    two, one = q[:-4] + q[4:], q[1:-3] + q[3:-1]
    a[2:-2] = (16 * one - two - 30 * q[2:-2]) / (12 * step**2)
    return a


def unspoilt(count: int, share: float) -> slice:
    """The samples of a log that a low pass leaves right."""
    edge = min(count // 8, int(SPOILT / (np.pi * share)))
    return slice(edge, count - edge)
