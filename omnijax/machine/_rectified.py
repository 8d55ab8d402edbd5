"""Speeds that have lost their sign, as counters of pulses give them, and numbers from them."""

from collections.abc import Sequence

import numpy as np
from scipy.signal import lfilter

RESTED = 0.05  # of the largest speed, below which one counts as none
TIMES = 60  # time constants that are tried, from a sample to a third of a log
SHARE = 1 / 3


def loses_sign(velocity: np.ndarray, given: np.ndarray) -> bool:
    """Whether a speed (t,) keeps one sign, and comes to rest, under an input that changes its own.

    A machine that an offset or its load keeps turning one way may do so too, but comes to rest
    seldom: that is the diagnosis' to say.
    """
    least = RESTED * np.max(np.abs(velocity))
    rests = np.min(np.abs(velocity)) < least
    one_sided = min(abs(float(velocity.min())), abs(float(velocity.max()))) < least
    return bool(rests and one_sided and given.min() < 0 < given.max())


def rectified_numbers(
    speeds: Sequence[np.ndarray], inputs: Sequence[np.ndarray], step: float
) -> dict[str, float]:
    """Inertia and damping of J v' + d v = u from |v| (t,): the time constant J/d by trial.

    The size of the motion under a time constant is a regression without a constant.
    """
    longest = max(len(x) for x in inputs) * step * SHARE
    best = (np.inf, step, 1.0)
    for tau in np.geomspace(step, longest, TIMES):
        fade = np.exp(-step / tau)
        made = [np.abs(lfilter([1 - fade], [1, -fade], u)) for u in inputs]
        size = sum(float(m @ m) for m in made) or 1e-300
        gain = sum(float(m @ np.abs(v)) for m, v in zip(made, speeds, strict=True)) / size
        left = sum(
            float(np.sum((np.abs(v) - gain * m) ** 2)) for m, v in zip(made, speeds, strict=True)
        )
        best = min(best, (left, float(tau), gain))
    _, tau, gain = best
    return {"inertia": tau / gain, "damping": 1 / gain}
