"""Morris' screening: elementary effects along random one-at-a-time trajectories.

    EE_i = (f(x + D e_i) - f(x)) / D over the unit cube;  mu* = mean |EE_i|,  sigma = deviation

A step with a failed end is left out and counted.  Source: M. D. Morris, Technometrics 33 (1991).
"""

from typing import NamedTuple

import numpy as np

LEVELS = 8
TAIL = 1e-3  # share beyond the ends of a normal input, whose ends lie at infinity


class MorrisEffects(NamedTuple):
    """mu, mu* and sigma (m, d), and the number of effects behind each input (d,)."""

    mu: np.ndarray
    mu_star: np.ndarray
    sigma: np.ndarray
    used: np.ndarray
    dropped: int


def morris_design(
    size: int, trajectories: int, seed: int, normal: np.ndarray | bool = False
) -> np.ndarray:
    """Points of the unit cube (r (d + 1), d); steps of half the range on `LEVELS` levels.

    Inputs that are `normal` (d,) keep `TAIL` off the ends of [0, 1].
    """
    rng, jump = np.random.default_rng(seed), LEVELS / (2 * (LEVELS - 1))
    rows = []
    for _ in range(trajectories):
        base = rng.integers(0, LEVELS // 2, size) / (LEVELS - 1)
        up = rng.random(size) < 0.5
        x = np.where(up, base, base + jump)
        rows.append(x.copy())
        for i in rng.permutation(size):
            x[i] += jump if up[i] else -jump
            rows.append(x.copy())
    tail = np.where(normal, TAIL, 0.0)
    return np.clip(np.array(rows), tail, 1 - tail)


def morris_effects(unit: np.ndarray, values: np.ndarray, failed: np.ndarray) -> MorrisEffects:
    """Effects from the runs (n, m) of `morris_design`."""
    size = unit.shape[1]
    x = unit.reshape(-1, size + 1, size)
    y = np.where(failed[:, None], np.nan, values).reshape(len(x), size + 1, -1)
    step, change = np.diff(x, axis=1), np.diff(y, axis=1)
    which = np.argmax(np.abs(step), axis=2)
    effect = change / np.take_along_axis(step, which[..., None], axis=2)
    mu, star, sigma, used = [], [], [], []
    for i in range(size):
        own = effect[which == i]
        own = own[np.isfinite(own).all(axis=1)]
        if len(own) < 2:
            raise ValueError(f"input {i + 1} has fewer than 2 steps without a failed run.")
        mu.append(own.mean(axis=0))
        star.append(np.abs(own).mean(axis=0))
        sigma.append(own.std(axis=0, ddof=1))
        used.append(len(own))
    dropped = which.size - sum(used)
    mu, star, sigma = (np.array(x).T for x in (mu, star, sigma))
    return MorrisEffects(mu, star, sigma, np.array(used), dropped)
