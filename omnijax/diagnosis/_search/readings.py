"""What is left of a channel held against shapes, over all runs at once and whatever its colour."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from .._settings import SETTINGS
from .levels import Level, levels
from .spectrum import of_waves, to_waves
from .where import shares, state

KNOTS = SETTINGS.readings.knots
LEAST_DIRECTION = SETTINGS.readings.least_direction


def on_reading(
    label: str,
    left: Sequence[np.ndarray],
    read: Sequence[np.ndarray],
    seed: int = 0,
    steps: Sequence[float] = (),
) -> dict[str, Any] | None:
    """Share of what is `left` of a channel that one function of its reading is, and its p-value.

    `left` and `read` (samples,) by run, in any unit, NaN where nothing counts.  None where nothing
    is left.  The function is piecewise straight: a step would be seen as noise of high frequency.
    `steps` as in `levels`.
    """
    values = np.concatenate([x[np.isfinite(r + x)] for r, x in zip(left, read, strict=True)])
    if len(values) == 0 or np.ptp(values) == 0:
        return None
    knots = np.unique(np.quantile(values, np.linspace(0, 1, KNOTS + 1)))
    shapes = [_straight(np.nan_to_num(x), knots) for x in read]
    return in_all_runs(f"reading {label}", left, shapes, seed, steps)


def in_all_runs(
    name: str,
    left: Sequence[np.ndarray],
    shapes: Sequence[np.ndarray],
    seed: int = 0,
    steps: Sequence[float] = (),
) -> dict[str, Any] | None:
    """Answer of the question `name`: share of what is `left` that lies in some shapes; p-value.

    `left` (samples,) by run, NaN where nothing counts, `shapes` (samples, k); their strengths are
    one in all runs.  What hangs on a slow motion is slow, and noise of a colour looks like it: both
    are whitened by the spectrum of what is left.  `share` and `rms` are those of what is left
    itself.  `steps` as in `levels`.  None where nothing is.

    Source: score test by generalised least squares (Aitken, 1935).
    """
    told = [np.isfinite(r).sum() > KNOTS for r in left]
    kept = [(r, x) for r, x, some in zip(left, shapes, told, strict=True) if some]
    steps = [step for step, some in zip(steps, told, strict=False) if some]
    if not any(np.nan_to_num(r).any() and x.any() for r, x in kept):
        return None
    counted = [np.isfinite(r) for r, _ in kept]
    raw = [
        _without_mean(np.nan_to_num(r)[:, None], k) for (r, _), k in zip(kept, counted, strict=True)
    ]
    columns = [_without_mean(x, k) for (_, x), k in zip(kept, counted, strict=True)]
    known = [np.where(k, r[:, 0], np.nan) for r, k in zip(raw, counted, strict=True)]
    noise = levels(known, True, steps)
    y = _whitened(raw, noise)[:, 0]
    u, s, v = np.linalg.svd(_whitened(columns, noise), full_matrices=False)
    u, s, v = (
        u[:, s > LEAST_DIRECTION * s[0]],
        s[s > LEAST_DIRECTION * s[0]],
        v[s > LEAST_DIRECTION * s[0]],
    )
    if not len(s) or not y.any():
        return None
    (answer,) = shares(y, (), seed, [state(name, u)])
    before = np.concatenate(raw)[:, 0]
    after = before - np.concatenate(columns) @ (v.T @ ((u.T @ y) / s))
    share = max(0.0, 1 - float(after @ after) / float(before @ before))
    rms = float(np.sqrt(before @ before / sum(k.sum() for k in counted)))
    return answer | {"share": share, "rms_over_noise": rms}


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
        waves = to_waves(columns)
        if level.spectrum is not None:
            waves /= np.sqrt(level.spectrum.power(len(columns)))[:, None]
        waves[0] = 0.0  # the mean of what wanders says nothing
        size = level.ratio if level.ratio > 0 else np.inf
        out.append(of_waves(waves) / size)
    return np.concatenate(out)
