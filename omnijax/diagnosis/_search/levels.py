"""What the residual says of the measurement noise: its level and colour, by run and channel.

Differences of a high order forget whatever moves slowly against the sampling, so their windows'
median is the level of the white part.  Where nothing in a channel hangs on the machine's state all
that is left is noise, and shows the noise's own spectrum.
"""

import dataclasses
import math
from collections.abc import Sequence

import numpy as np
from scipy.special import chdtri

from ..._white_noise import noise_squares, repetition
from .._settings import SETTINGS
from .spectrum import BIN_WAVES, BIN_WIDTH, WHITE_FROM, Spectrum, Waves, likeliest, likeliest_colour

DIFFERENCES = SETTINGS.levels.differences
WINDOW = SETTINGS.levels.window
COLOUR_CHANCE = SETTINGS.levels.colour_chance
FLAT_RATIO = SETTINGS.levels.flat_ratio
FEWEST_WINDOWS = SETTINGS.levels.fewest_windows
MEDIAN_SCATTER = SETTINGS.levels.median_scatter
LOWER_LEVEL = SETTINGS.levels.lower_level
LEAST_FREEDOM = SETTINGS.levels.least_freedom
STEP_TOLERANCE = SETTINGS.levels.step_tolerance
BEGUN = 1 / 3  # run lengths for which a walk would have gone on whose level is a run's mean


@dataclasses.dataclass(frozen=True)
class Level:
    """Noise of one channel of one run, over the sigma that was assumed.

    `ratio` is the 1-sigma itself, `error` its relative 1-sigma, `floor` the level of the white part
    alone; `spectrum` of coloured noise, over that of white of `ratio`.  `samples` that count: what
    it weighs beside those of other runs.
    """

    ratio: float
    error: float
    floor: float
    colour: str = "white"
    spectrum: Spectrum | None = None
    samples: int = 1

    def amplitudes(self, samples: int) -> np.ndarray:
        """1-sigma (samples,) of the waves of a run of such noise, over the assumed sigma.

        A walk begins with the run; the mean of what it is at n samples has the variance n/3 steps.
        """
        power = 1.0 if self.spectrum is None else self.spectrum.power(samples, BEGUN)
        return self.ratio * np.sqrt(np.broadcast_to(power, (samples,)))

    def white(self, level: float) -> "Level":
        """The same as white noise of another level."""
        return Level(level, self.error, level, samples=self.samples)


def white_level(values: np.ndarray) -> tuple[float, float]:
    """Level of the white part of `values` (n,), NaN where missing, and its relative 1-sigma.

    The median of windows, as a residual of moving machines may hold bursts that are no noise.
    `recording/_noise.py` sees rest alone and takes the mean square, which scatters less.
    """
    best = (math.nan, math.nan)
    for order in DIFFERENCES:
        square = noise_squares(values, order)
        square = square[np.isfinite(square)]
        count = len(square) // WINDOW
        if count < FEWEST_WINDOWS:
            return best
        free = WINDOW / repetition(order)
        middle = np.median(square[: count * WINDOW].reshape(count, WINDOW).mean(axis=1))
        level = math.sqrt(middle / (chdtri(free, 0.5) / free))
        if not best[0] <= LOWER_LEVEL * level:
            best = (level, MEDIAN_SCATTER / math.sqrt(2 * free * count))
    return best


def coloured(columns: list[np.ndarray]) -> Spectrum | None:
    """The spectrum of a channel whose noise is not white within chance, and rises where slow."""
    waves = Waves.of(columns)
    _, power, _ = waves.binned(BIN_WIDTH, BIN_WAVES * len(columns))
    if not power.max() > FLAT_RATIO * power.min():
        return None
    high = np.mean(waves.power[waves.frequency > WHITE_FROM])
    if (
        power[0] < FLAT_RATIO * high
    ):  # windows take the slowest part off; no noise is feared that rises
        return None
    spectrum, p = likeliest_colour(columns)
    return spectrum if p < COLOUR_CHANCE else None


def levels(columns: list[np.ndarray], noise_only: bool, steps: Sequence[float] = ()) -> list[Level]:
    """`Level` of one channel in every run, from its residual columns (NaN where missing).

    `noise_only`: nothing in it hangs on the machine's state, so all of it is noise; else only the
    level of its white part is known.  `steps` by run, see `of_one_step`.
    """
    out = []
    shapes: list[Spectrum | None] = [None] * len(columns)
    for which in of_one_step(len(columns), steps) if noise_only else ():
        shape = coloured([columns[k] for k in which])
        for k in which:
            shapes[k] = shape
    for x, shape in zip(columns, shapes, strict=True):
        floor, error = white_level(x)
        used = int(np.isfinite(x).sum())
        if not noise_only or used == 0:
            out.append(Level(floor, error, floor, samples=used))
            continue
        ratio = float(np.sqrt(np.nanmean(x**2)))
        if shape is None:
            out.append(Level(ratio, 1 / math.sqrt(2 * used), floor, samples=used))
            continue
        foretold = shape.power(len(x))[1:]
        own = shape.scaled(float(np.mean(Waves.of([x]).power / foretold)) / ratio**2)
        free = used * np.mean(foretold) ** 2 / np.mean(foretold**2)  # a few strong waves say less
        error = 1 / math.sqrt(max(free, LEAST_FREEDOM))
        out.append(Level(ratio, error, floor, shape.colour, own, used))
    return out


def of_one_step(count: int, steps: Sequence[float] = ()) -> list[list[int]]:
    """The numbers of `count` runs by their sampling `steps`, of any unit; none: all are alike.

    A colour is told by cycles a sample: runs of other steps show another one.
    """
    groups: list[list[int]] = []
    for k in range(count):
        alike = (g for g in groups if not steps or abs(steps[k] / steps[g[0]] - 1) < STEP_TOLERANCE)
        group = next(alike, None)
        if group is None:
            groups.append([k])
        else:
            group.append(k)
    return groups


def deviance(columns: list[np.ndarray], steps: Sequence[float] = ()) -> float:
    """-2 log likelihood of noise, white of level 1 or of a colour, but for a constant.

    `columns` by run are one channel's residual in sigma (zero where missing).  Beside white noise
    there may be a random walk and low-pass noise; both levels and the corner are free, the same in
    all runs `of_one_step`, and the mean says nothing.
    """
    white = sum(len(x) * float(np.var(x)) for x in columns)
    parts = ([columns[k] for k in which] for which in of_one_step(len(columns), steps))
    return white - sum(likeliest(Waves.of(part), 1.0)["both"].gain for part in parts)
