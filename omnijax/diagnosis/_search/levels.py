"""What the residual says of the measurement noise: its level and colour, by run and channel.

Differences of a high order forget whatever moves slowly against the sampling, so their windows'
median is the level of the white part.  Where nothing in a channel hangs on the machine's state all
that is left is noise, and its smoothed periodogram is the noise's own spectrum.
"""

import dataclasses
import math

import numpy as np
from scipy.fft import dct
from scipy.stats import chi2, gamma

from ..._white_noise import noise_squares, repetition
from .._settings import SETTINGS

ORDERS = SETTINGS.levels.orders
WINDOW = SETTINGS.levels.window
FLAT = SETTINGS.levels.flat
BROAD = SETTINGS.levels.broad
FEWEST = SETTINGS.levels.fewest
LEANS = SETTINGS.levels.leans
STRETCHES = SETTINGS.levels.stretches
SCATTER = SETTINGS.levels.scatter
BETTER = SETTINGS.levels.better
HIGH = SETTINGS.levels.high
SLOWEST = SETTINGS.levels.slowest
STEEP = SETTINGS.levels.steep
FREE = SETTINGS.levels.free


@dataclasses.dataclass(frozen=True)
class Level:
    """Noise of one channel of one run, over the sigma that was assumed.

    `ratio` is the 1-sigma itself, `error` its relative 1-sigma, `floor` the level of the white part
    alone; `spectrum` (cycles a sample, power) of coloured noise, over that of white of `ratio`.
    """

    ratio: float
    error: float
    floor: float
    colour: str = "white"
    spectrum: tuple[np.ndarray, np.ndarray] | None = None


def white_level(values: np.ndarray) -> tuple[float, float]:
    """Level of the white part of `values` (n,), NaN where missing, and its relative 1-sigma."""
    best = (math.nan, math.nan)
    for order in ORDERS:
        square = noise_squares(values, order)
        square = square[np.isfinite(square)]
        count = len(square) // WINDOW
        if count < STRETCHES:
            return best
        free = WINDOW / repetition(order)
        middle = np.median(square[: count * WINDOW].reshape(count, WINDOW).mean(axis=1))
        level = math.sqrt(middle / (chi2.ppf(0.5, free) / free))
        if not best[0] <= BETTER * level:
            best = (level, SCATTER / math.sqrt(2 * free * count))
    return best


def spectrum(columns: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(cycles a sample, mean power, lines) in bins that widen, of one channel over several runs."""
    lines, powers = [], []
    for x in columns:
        filled = np.nan_to_num(x)
        power = np.abs(np.fft.rfft(filled)[1:]) ** 2 / max(np.isfinite(x).sum(), 1)
        lines.append(np.arange(1, len(power) + 1) / len(x))
        powers.append(power)
    at, power = np.concatenate(lines), np.concatenate(powers)
    order = np.argsort(at)
    at, power = at[order], power[order]
    edges, k = [0], 0
    while k < len(at):
        end = max(k + FEWEST * len(columns), int(np.searchsorted(at, BROAD * at[k])))
        k = end if len(at) - end >= FEWEST * len(columns) else len(at)
        edges.append(k)
    starts = np.array(edges[:-1])
    count = np.diff(edges)
    middle = np.exp(np.add.reduceat(np.log(at), starts) / count)
    return middle, np.add.reduceat(power, starts) / count, count


def colour_of(at: np.ndarray, power: np.ndarray, count: np.ndarray) -> str:
    """Name of a spectrum: white where it is flat within chance, else by what it rises to."""
    mean = float(np.sum(power * count) / np.sum(count))
    tails = np.minimum(gamma.cdf(power / mean, count, scale=1 / count),
                       gamma.sf(power / mean, count, scale=1 / count))  # fmt: skip
    leans = power.max() > LEANS * power.min()
    if not leans or 2 * len(power) * tails.min() > FLAT:
        return "white"
    high = np.average(power[at > HIGH], weights=count[at > HIGH])
    if power[0] < LEANS * high:  # windows take the slowest part off; no noise is feared that rises
        return "white"
    low = at < SLOWEST * at[0]
    slope = np.polyfit(np.log(at[low]), np.log(power[low]), 1)[0] if low.sum() > 2 else 0.0
    return "wandering" if slope < STEEP else "low-pass"


def levels(columns: list[np.ndarray], noise_only: bool) -> list[Level]:
    """`Level` of one channel in every run, from its residual columns (NaN where missing).

    `noise_only`: nothing in it hangs on the machine's state, so all of it is noise; else only the
    level of its white part is known.
    """
    out, colour, shape = [], "white", None
    if noise_only:
        at, power, count = spectrum(columns)
        colour = colour_of(at, power, count)
        shape = None if colour == "white" else (at, power)
    for x in columns:
        floor, error = white_level(x)
        used = int(np.isfinite(x).sum())
        if not noise_only or used == 0:
            out.append(Level(floor, error, floor))
            continue
        ratio = float(np.sqrt(np.nanmean(x**2)))
        if shape is None:
            out.append(Level(ratio, 1 / math.sqrt(2 * used), floor))
            continue
        at, power = shape
        lines = np.abs(np.fft.rfft(np.nan_to_num(x))[1:]) ** 2 / used
        dense = over(at, power, len(x))[1:]
        own = power * np.mean(lines / dense) / ratio**2
        free = used * np.mean(dense) ** 2 / np.mean(dense**2)  # a few strong lines say less
        out.append(Level(ratio, 1 / math.sqrt(max(free, FREE)), floor, colour, (at, own)))
    return out


# power over white noise's: of a walk at a run's slowest wave, of low-pass noise at its slow end
POWERS = np.concatenate([[0.0], np.logspace(*SETTINGS.levels.wanders, SETTINGS.levels.powers)])


def deviance(columns: list[np.ndarray]) -> float:
    """-2 log likelihood of noise, white of level 1 or of a colour, but for a constant.

    `columns` by run are one channel's residual in sigma (zero where missing).  Beside white noise
    there may be a random walk, whose waves of half a period over k have a power that falls with k
    squared, and low-pass noise, alike up to a corner; both levels and the corner are free, the same
    in all runs, and the mean says nothing.
    """
    return sum(len(x) * float(np.var(x)) for x in columns) - _colour_gain(columns)


def _colour_gain(columns: list[np.ndarray]) -> float:
    """Twice the log likelihood of the likeliest colour over that of white noise."""
    k, power, count = _waves(columns)
    walk, best = POWERS[:, None] / k**2, 0.0
    for corner in np.geomspace(SETTINGS.levels.lowest, k[-1], SETTINGS.levels.corners):
        over = walk[:, None] + POWERS[:, None] / (1 + (k / corner) ** 2)
        best = max(best, float(np.max(over / (1 + over) @ power - np.log1p(over) @ count)))
    return best


def _waves(columns: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(half periods over the longest run, power, waves) of all runs, in bins of like waves."""
    longest = max(len(x) for x in columns)
    k = np.concatenate([np.arange(1, len(x)) * (longest / len(x)) for x in columns])
    power = np.concatenate([np.asarray(dct(x, norm="ortho"))[1:] ** 2 for x in columns])
    order = np.argsort(k, kind="stable")
    k, power = k[order], power[order]
    bins = np.floor(np.log(k) / np.log(SETTINGS.levels.alike) + 1e-9)
    starts = np.flatnonzero(np.diff(bins, prepend=-1))
    count = np.diff(np.append(starts, len(k)))
    middle = np.exp(np.add.reduceat(np.log(k), starts) / count)
    return middle, np.add.reduceat(power, starts), count


def over(at: np.ndarray, power: np.ndarray, samples: int) -> np.ndarray:
    """A spectrum's power at the Fourier frequencies of `samples` samples (that of 0: the first)."""
    lines = np.arange(samples // 2 + 1) / samples
    lines[0] = lines[1]
    return np.exp(np.interp(np.log(lines), np.log(at), np.log(np.maximum(power, 1e-300))))
