"""The spectrum of noise by waves of half periods, and which colour the data show.

A run of n samples is a sum of n cosine waves, of k half periods each (the discrete cosine transform
of type II), at k/2n cycles a sample.  They are the principal components of a random walk whose
start is free, since they diagonalise the matrix of squared first differences, and nearly those of
low-pass noise: the amplitudes of such noise are independent.  Fourier lines of a walk are not, for
the jump from its end to its start is in all of them, and what is slow would seem known up to six
times too well.

The spectrum is that of the likeliest of white noise, a walk and low-pass noise, times the smoothed
ratio of the data's to it: so bins do not blur a steep rise.

Source: Ahmed, Natarajan, Rao, Discrete cosine transform (1974); Strang, The discrete cosine
transform (1999); prewhitening: Blackman, Tukey, The measurement of power spectra (1958); choice of
the colour by the Bayesian information criterion: Schwarz (1978), likelihood: Whittle (1953).
"""

import dataclasses
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.fft import dct, idct
from scipy.special import chdtrc

from .._settings import SETTINGS

WHITE_FROM = SETTINGS.spectrum.white_from
BIN_WIDTH = SETTINGS.spectrum.bin_width
BIN_WAVES = SETTINGS.spectrum.bin_waves
WALK_BEFORE = SETTINGS.spectrum.walk_before
CORNERS = SETTINGS.spectrum.corners
# power over white noise's: of a walk at a run's slowest wave, of low-pass noise at its slow end
POWERS = np.concatenate([[0.0], np.logspace(*SETTINGS.spectrum.decades, SETTINGS.spectrum.powers)])


def wave_frequencies(samples: int) -> np.ndarray:
    """Cycles a sample (samples,) of a run's waves, from 0."""
    return np.arange(samples) / (2 * samples)


def to_waves(values: np.ndarray, axis: int = 0) -> np.ndarray:
    """Amplitudes of the waves of a run's values along an axis, of the same squares in sum."""
    return np.asarray(dct(values, axis=axis, norm="ortho"))


def of_waves(amplitudes: np.ndarray, axis: int = 0) -> np.ndarray:
    """The values that `to_waves` made amplitudes of."""
    return np.asarray(idct(amplitudes, axis=axis, norm="ortho"))


@dataclasses.dataclass(frozen=True)
class Spectrum:
    """Power by frequency f (cycles a sample) of white, walking and low-pass noise.

    (white + walk/f^2 + low_pass/(1 + (f/corner)^2)) times `ratio`, which holds (frequencies,
    ratios) between which it is straight in logarithms.  `offset` is the power that the mean has
    beside, of an offset that is another one in every run.
    """

    white: float
    walk: float = 0.0
    low_pass: float = 0.0
    corner: float = 1.0
    ratio: tuple[np.ndarray, np.ndarray] = (np.ones(1), np.ones(1))
    offset: float = 0.0

    @property
    def colour(self) -> str:
        """What it rises to."""
        names = {"wandering": self.walk, "low-pass": self.low_pass, "offset by run": self.offset}
        return next((name for name, power in names.items() if power), "white")

    def power(self, samples: int, earlier: float = WALK_BEFORE) -> np.ndarray:
        """Power (samples,) of the waves of a run.

        The mean's is that of the white and the low-pass part at frequency zero, and of a walk that
        had gone on for `earlier` such runs before: of one that nobody knows, unless told.
        """
        f = wave_frequencies(samples)
        step = (2 * np.pi) ** 2 * self.walk  # variance of a walk's steps
        level = self.white + self.low_pass + self.offset
        mean = level + samples * (earlier * samples * step)
        power = np.append(mean, self.plain(f[1:]))
        f[0] = f[1]
        return power * self.beside(f)

    def beside(self, f: np.ndarray) -> np.ndarray:
        """The ratio at frequencies above zero."""
        return np.exp(np.interp(np.log(f), np.log(self.ratio[0]), np.log(self.ratio[1])))

    def scaled(self, factor: float) -> "Spectrum":
        """`factor` times its power."""
        return dataclasses.replace(self, ratio=(self.ratio[0], factor * self.ratio[1]))

    def plain(self, f: np.ndarray) -> np.ndarray:
        """Power at frequencies above zero, but for the ratio."""
        return self.white + self.walk / f**2 + self.low_pass / (1 + (f / self.corner) ** 2)


class Waves(NamedTuple):
    """Waves of several runs but their means, by rising frequency (cycles a sample)."""

    frequency: np.ndarray
    power: np.ndarray

    @staticmethod
    def of(columns: Sequence[np.ndarray]) -> "Waves":
        """Of one channel by run, NaN where missing; powers are those of runs without gaps."""
        parts = [
            to_waves(np.nan_to_num(x))[1:] ** 2 * len(x) / max(np.isfinite(x).sum(), 1)
            for x in columns
        ]
        f = np.concatenate([wave_frequencies(len(x))[1:] for x in columns])
        order = np.argsort(f, kind="stable")
        return Waves(f[order], np.concatenate(parts)[order])

    def binned(self, broad: float, fewest: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(middle frequencies, mean powers, numbers of waves) in bins that widen.

        Each ends `broad` times its begin at least, and holds `fewest` waves at least.
        """
        edges, k = [0], 0
        while k < len(self.frequency):
            end = int(np.searchsorted(self.frequency, broad * self.frequency[k]))
            end = max(k + fewest, end)
            k = end if len(self.frequency) - end >= fewest else len(self.frequency)
            edges.append(k)
        starts, count = np.array(edges[:-1]), np.diff(edges)
        middle = np.exp(np.add.reduceat(np.log(self.frequency), starts) / count)
        return middle, np.add.reduceat(self.power, starts) / count, count


class Likeliest(NamedTuple):
    """A colour, and twice its log likelihood over that of white noise."""

    spectrum: Spectrum
    gain: float


def likeliest(waves: Waves, white: float) -> dict[str, Likeliest]:
    """Beside white noise of a level: by what else there is, "walk", "low-pass" or "both"."""
    f, power, count = waves.binned(SETTINGS.spectrum.merged_waves, 1)
    slowest, total = f[0], count * power / white**2
    walk = POWERS[:, None] * (slowest / f) ** 2
    best = {}
    for corner in np.geomspace(SETTINGS.spectrum.slowest_corner * slowest, f[-1], CORNERS):
        over = walk[:, None] + POWERS[:, None] / (1 + (f / corner) ** 2)
        gain = over / (1 + over) @ total - np.log1p(over) @ count
        for name, some in (("walk", gain[:, :1]), ("low-pass", gain[:1]), ("both", gain)):
            i, j = np.unravel_index(int(np.argmax(some)), some.shape)
            if name not in best or some[i, j] > best[name].gain:
                level = white**2
                spectrum = Spectrum(
                    level, level * slowest**2 * POWERS[i], level * POWERS[j], corner
                )
                best[name] = Likeliest(spectrum, float(some[i, j]))
    return best


NUMBERS = {"walk": 1, "low-pass": 2, "both": 3}  # free in it


def likeliest_colour(columns: Sequence[np.ndarray]) -> tuple[Spectrum, float]:
    """The spectrum that one channel shows by run, and its chance in white noise.

    `columns` are NaN where nothing was measured.  The richer colour has to gain what its numbers
    cost.
    """
    waves = Waves.of(columns)
    white = float(np.sqrt(np.mean(waves.power[waves.frequency > WHITE_FROM])))
    best, price = likeliest(waves, white), np.log(len(waves.power))
    name = max(best, key=lambda k: best[k].gain - NUMBERS[k] * price)
    plain, gain = best[name]
    beside = Waves(waves.frequency, waves.power / plain.plain(waves.frequency))
    ratio = beside.binned(BIN_WIDTH, BIN_WAVES * len(columns))[:2]
    return dataclasses.replace(plain, ratio=ratio), float(chdtrc(NUMBERS[name], max(gain, 0.0)))
