"""The mean over the time of a run of what is known at its samples."""

from types import ModuleType
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

Samples = Float[Array, " t"] | Float[np.ndarray, " t"]
EVEN = 1e-6  # of a step, up to which steps that differ are those of rounding


def time_mean(t: Samples, values: Samples, xp: ModuleType = jnp) -> Any:
    """Mean of `values` over the time `t`: each sample stands for half of the steps beside it.

    The first and the last one stand for the whole of their one step: at even steps all weigh the
    same, and this is the mean of the samples.  `xp` is `jax.numpy` or `numpy`.
    """
    plain = xp.mean(values)
    if len(t) < 3:
        return plain
    steps = xp.diff(t)
    weights = 0.5 * (xp.concatenate([steps[:1], steps]) + xp.concatenate([steps, steps[-1:]]))
    total = xp.sum(weights)
    even = xp.max(steps) - xp.min(steps) <= EVEN * total / len(t)
    by_time = xp.sum(weights * values) / xp.where(even, 1.0, total)
    return xp.where(even, plain, by_time)


def off_even(t: Samples, xp: ModuleType = jnp) -> Any:
    """By how much of a step the samples lie off even times, at most."""
    step = (t[-1] - t[0]) / max(len(t) - 1, 1)
    off = xp.max(xp.abs(t - t[0] - step * xp.arange(len(t))))
    return off / xp.where(step > 0, step, 1.0)
