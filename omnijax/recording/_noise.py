"""The noise floor of every output: declared, from repeats, from the data itself, or not known.

From the data: differences of a high order leave of them their white noise (`_white_noise.py`).
"""

import dataclasses
import math
from collections.abc import Sequence

import numpy as np

from .._errors import InputError
from .._white_noise import noise_squares, repetition
from ._columns import OUTPUTS, channels
from ._recording import Recording

ORDERS = (3, 5, 7)  # differences; the higher ones forget a floor's or a mount's vibration too
WINDOW = 64  # samples of one stretch
ENOUGH, SHORTEST = 300, 32  # samples of rest: for some 4 %, and for 12 %
ROLLING = 1e-3  # rad/s
TURNED = 0.02  # rad


@dataclasses.dataclass(frozen=True)
class NoiseFloor:
    """1-sigma of white noise by measured column, in SI units; NaN where it cannot be known.

    `source` says by group where it is from: declared, repeats, rest, quiet stretches, short rest
    or unknown; `error` is by group the relative 1-sigma of the estimate itself, 0 for a declared
    one.
    """

    sigma: dict[str, float]
    source: dict[str, str]
    error: dict[str, float]

    def group(self, name: str) -> float:
        """Root mean square over a group's columns; NaN where it is not known."""
        own = [s for column, s in self.sigma.items() if column.rsplit("_", 1)[0] == name]
        return float(np.sqrt(np.mean(np.square(own)))) if own else math.nan

    @property
    def known(self) -> bool:
        """Whether every measured group's noise is known."""
        return "unknown" not in self.source.values()

    def __str__(self) -> str:
        lines = [f"{g}: {self.group(g):.3g} ({source})" for g, source in self.source.items()]
        return "noise, 1-sigma: " + ", ".join(lines)


def noise_floor(runs: Sequence[Recording], declared: bool = True) -> NoiseFloor:
    """Noise of every output group of some runs of one machine, pooled over them.

    With `declared` what the runs declare comes first; else only what the data show counts.

    SI: m, rad, rad/s, m/s^2.  Raises `InputError` where there is no run.

    Source: variate differences (Anderson, 1971; see `_white_noise.py`).
    """
    if not runs:
        raise InputError("the noise is that of one run or more, but there is none.")
    sigma: dict[str, float] = {}
    source: dict[str, str] = {}
    error: dict[str, float] = {}
    wheels = runs[0].wheels
    for group in OUTPUTS:
        measured = [run for run in runs if group in run.groups]
        names = [c for c in channels(group, wheels) if any(run.measures(c) for run in measured)]
        if not names:
            continue
        for how, estimate in _WAYS.items():
            if how == "declared" and not declared:
                continue
            estimated = estimate(measured, names)
            if estimated is not None:
                sigma |= dict(zip(names, map(float, estimated.sigma), strict=True))
                source[group], error[group] = how, estimated.error
                break
        else:
            sigma |= dict.fromkeys(names, math.nan)
            source[group], error[group] = "unknown", math.nan
    return NoiseFloor(sigma, source, error)


@dataclasses.dataclass(frozen=True)
class _Estimate:
    """1-sigma by column, and the relative 1-sigma of their root mean square."""

    sigma: np.ndarray
    error: float


def _declared(runs: Sequence[Recording], names: Sequence[str]) -> _Estimate | None:
    """Root mean square of what the runs declare; `None` where one of them declares nothing."""
    said = [[run.declared_noise(column) for column in names] for run in runs]
    if any(value is None for row in said for value in row):
        return None
    return _Estimate(np.sqrt(np.mean(np.square(np.array(said, float)), axis=0)), 0.0)


def _from_repeats(runs: Sequence[Recording], names: Sequence[str]) -> _Estimate | None:
    """From the difference of runs with equal inputs and starts, unless they do not truly repeat."""
    pairs = [(a, b) for i, a in enumerate(runs) for b in runs[i + 1 :] if _repeat(a, b)]
    if not pairs:
        return None
    square = np.mean([_nanmean((a.table(names) - b.table(names)) ** 2) for a, b in pairs], axis=0)
    sigma = np.sqrt(square / 2)
    rest = _from_rest(runs, names)
    true = rest is None or np.all(sigma[np.isfinite(sigma)] < 1.5 * np.nanmax(rest.sigma))
    count = len(sigma) * sum(len(a) for a, _ in pairs)
    return _Estimate(sigma, (2 * count) ** -0.5) if true and np.isfinite(sigma).all() else None


def _repeat(a: Recording, b: Recording) -> bool:
    if len(a) != len(b) or not np.allclose(a.time - a.time[0], b.time - b.time[0]):
        return False
    size = np.abs(a.inputs).max(axis=0) + 1e-300
    same = np.all(np.abs(a.inputs - b.inputs).max(axis=0) <= 1e-3 * size)
    start = np.nan_to_num(a.group("theta")[0] - b.group("theta")[0])
    return bool(same and np.abs(start).max() < 5e-3)


def _from_rest(
    runs: Sequence[Recording], names: Sequence[str], enough: int = ENOUGH
) -> _Estimate | None:
    """Differences over the rest at the start of the runs, `enough` samples or more together."""
    pieces = [run.table(names)[: rest_length(run)] for run in runs]
    pieces = [piece for piece in pieces if len(piece) > 2 * ORDERS[-1]]
    return _level(pieces) if sum(map(len, pieces)) >= enough else None


def _from_short_rest(runs: Sequence[Recording], names: Sequence[str]) -> _Estimate | None:
    return _from_rest(runs, names, SHORTEST)


def rest_length(run: Recording) -> int:
    """Number of samples at the start before a motor acts; 0 for a run that begins rolling.

    What moves slowly meanwhile (a force on the platform, a creeping motor) drops out of the
    differences.
    """
    torque = np.abs(run.torque - run.torque[0]).max(axis=1)
    acts = torque > 1e-3 * np.abs(run.torque).max()
    end = int(np.argmax(acts)) if acts.any() else len(run)
    speed = np.abs(_nanmean(run.group("Omega")[:end]))
    turned = np.abs(run.group("theta")[:end] - run.group("theta")[:1])
    rolls = np.any(speed > ROLLING) or np.any(turned[np.isfinite(turned)] > TURNED)
    return 0 if rolls else end


def _from_quiet(runs: Sequence[Recording], names: Sequence[str]) -> _Estimate | None:
    """From the quietest stretches of raw readings, if they scatter as stretches of pure noise do.

    Under white noise the 10th and the 30th percentile of the stretches' levels have a known ratio;
    where the data's differs, the quietest stretches still move and say nothing about the noise.
    """
    order = ORDERS[-1]
    levels = np.concatenate([_windows(run.table(names), order) for run in runs])
    if np.isfinite(levels).sum(axis=0).min() < 20:
        return None
    pure = _windows(np.random.default_rng(0).standard_normal((WINDOW * 2000, 1)), order)
    low, high = (
        np.nanpercentile(levels, p, axis=0) / np.percentile(pure, p, axis=0) for p in (10, 30)
    )
    alike = np.all(high < 1.4 * low)
    # the 10th percentile of n levels scatters by 1.7/sqrt(n) of what one of them scatters
    error = 1.7 * _scatter(order, WINDOW) / np.sqrt(np.isfinite(levels).sum())
    return _Estimate(np.sqrt(low), error) if alike else None


def _windows(values: np.ndarray, order: int) -> np.ndarray:
    """Mean squares of the differences in stretches of `WINDOW` samples, as variances of noise."""
    count = len(values) // WINDOW
    windows = values[: count * WINDOW].reshape(count, WINDOW, -1)
    with np.errstate(invalid="ignore"):
        return noise_squares(windows, order, axis=1).mean(axis=1)


def _level(pieces: Sequence[np.ndarray]) -> _Estimate | None:
    """White noise from third differences, or higher ones where they are clearly less.

    The order is chosen for all columns together: by column, chance alone would pick the lower.
    The pieces are rest, where all that differs is noise, so their mean square counts.  A residual
    of the diagnosis may hold bursts: `diagnosis/_search/levels.py` takes the median of windows.
    """
    best = None
    for order in ORDERS:
        squares = [noise_squares(piece, order) for piece in pieces if len(piece) > 2 * order]
        if not squares:
            return None
        squared = np.concatenate(squares)
        sigma = np.sqrt(_nanmean(squared))
        if best is None or _rms(sigma) < 0.9 * _rms(best.sigma):
            best = _Estimate(sigma, _scatter(order, int(np.isfinite(squared).sum())))
    return best if best is not None and np.isfinite(best.sigma).all() else None


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _scatter(order: int, count: int) -> float:
    """Relative 1-sigma of the level of white noise from `count` differences of one order."""
    return float(np.sqrt(repetition(order) / (2 * max(count, 1))))


def _nanmean(values: np.ndarray) -> np.ndarray:
    good = np.isfinite(values)
    count = good.sum(axis=0)
    total = np.where(good, values, 0.0).sum(axis=0)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


_WAYS = {
    "declared": _declared,
    "repeats": _from_repeats,
    "rest": _from_rest,
    "quiet stretches": _from_quiet,
    "short rest": _from_short_rest,
}
