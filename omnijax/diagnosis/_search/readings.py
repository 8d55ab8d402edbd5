"""Whether what is left of a channel is a function of its own reading, over all runs at once."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from .levels import Level, levels, over
from .where import shares, state

KNOTS = 12  # equally filled stretches of the reading, between which the function is straight
LEAST = 1e-6  # of the longest direction: a shorter one is none


def on_reading(
    label: str, left: Sequence[np.ndarray], read: Sequence[np.ndarray], seed: int = 0
) -> dict[str, Any] | None:
    """Share of what is `left` of a channel that one function of its reading is, and its p-value.

    `left` and `read` (samples,) by run, in any unit, NaN where nothing counts.  None where nothing
    is left.  A sensor's function is one in all runs, and slow where the machine is: noise of a
    colour looks like it.  So both are whitened by the spectrum of what is left, and the function is
    piecewise straight, since a step would be seen as noise of high frequency.  `rms` and `share`
    are those of what is left itself.

    Source: score test by generalised least squares (Aitken, 1935).
    """
    kept = [(r, x) for r, x in zip(left, read, strict=True) if (np.isfinite(r + x)).sum() > KNOTS]
    left, read = [r for r, _ in kept], [x for _, x in kept]
    whole = [np.isfinite(r + x) for r, x in kept]
    values = np.concatenate([x[k] for x, k in zip(read, whole, strict=True)] or [np.zeros(1)])
    if np.ptp(values) == 0 or not any(np.any(r[k]) for r, k in zip(left, whole, strict=True)):
        return None
    noise = levels([np.where(k, r - r[k].mean(), np.nan)
                    for r, k in zip(left, whole, strict=True)], True)  # fmt: skip
    knots = np.unique(np.quantile(values, np.linspace(0, 1, KNOTS + 1)))
    raw = [_without_mean(np.nan_to_num(r)[:, None], k) for r, k in zip(left, whole, strict=True)]
    shapes = [_without_mean(_straight(np.nan_to_num(x), knots), k)
              for x, k in zip(read, whole, strict=True)]  # fmt: skip
    y = _whitened(raw, noise)[:, 0]
    u, s, v = np.linalg.svd(_whitened(shapes, noise), full_matrices=False)
    if not s[0] > 0 or not y.any():
        return None
    u, s, v = u[:, s > LEAST * s[0]], s[s > LEAST * s[0]], v[s > LEAST * s[0]]
    (answer,) = shares(y, (), seed, [state(f"reading {label}", u)])
    strengths = v.T @ ((u.T @ y) / s)
    before = np.concatenate(raw)[:, 0]
    after = before - np.concatenate(shapes) @ strengths
    share = max(0.0, 1 - float(after @ after) / float(before @ before))
    counted = sum(int(k.sum()) for k in whole)
    return answer | {"share": share, "rms": float(np.sqrt(before @ before / counted))}


def _straight(values: np.ndarray, knots: np.ndarray) -> np.ndarray:
    """Functions (samples, knots) that are 1 at a knot, 0 at the others and straight between."""
    return np.stack([np.interp(values, knots, row) for row in np.eye(len(knots))], axis=1)


def _without_mean(columns: np.ndarray, counted: np.ndarray) -> np.ndarray:
    """Columns less their means over what counts, and zero elsewhere."""
    mean = columns[counted].mean(axis=0) if counted.any() else 0.0
    return np.where(counted[:, None], columns - mean, 0.0)


def _whitened(runs: Sequence[np.ndarray], noise: Sequence[Level]) -> np.ndarray:
    """All runs' columns one after the other, each over the spectrum of its run's noise."""
    out = []
    for columns, level in zip(runs, noise, strict=True):
        lines = np.fft.rfft(columns, axis=0)
        if level.spectrum is not None:
            lines /= np.sqrt(over(*level.spectrum, len(columns)))[:, None]
        lines[0] = 0.0  # the mean of what wanders says nothing
        size = level.ratio if level.ratio > 0 else np.inf
        out.append(np.fft.irfft(lines, len(columns), axis=0) / size)
    return np.concatenate(out)
