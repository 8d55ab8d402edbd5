"""Noise of a colour in Omega and theta, told beside the free start of every window.

Omega and the rolled lengths start anew in every window, and a start that is fitted takes up what is
slow: the bias of a gyro that wanders stands half in what is left of Omega and half, as a slope, in
the lengths.  So the power of a walk is not that of the waves of what is left.  It is the likeliest
one of the residual but for its part along the starts (restricted likelihood), all channels at once:

    -2 log L = sum log p + log |F^T p^-1 F| + r^T p^-1 r - b^T (F^T p^-1 F)^-1 b,  b = F^T p^-1 r

with r and F the waves of the residual and of the starts' columns, and p the power of every wave,
of white, low-pass and walking noise and of an offset that is another one in every run.

Source: Patterson, Thompson, Recovery of inter-block information when block sizes are unequal
(1971); choice of the components by the Bayesian information criterion: Schwarz (1978).
"""

import dataclasses
import functools
import itertools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize
from scipy.special import chdtri

from ..._search import (
    NUMBERS,
    Level,
    Likeliest,
    Spectrum,
    Waves,
    likeliest,
    to_waves,
    wave_frequencies,
)
from ..._settings import SETTINGS
from .data_vector import DataRows

BIN_WIDTH = SETTINGS.spectrum.bin_width
WHITE_FROM = SETTINGS.spectrum.white_from
MOVED_POWERS = SETTINGS.turning_noise.moved_powers
TOLD_FROM = SETTINGS.turning_noise.told_from
FEWEST_WAVES = SETTINGS.turning_noise.fewest_waves
MERGED_WAVES = SETTINGS.spectrum.merged_waves
START_WEIGHT = SETTINGS.turning_noise.start_weight
LOW_PASS_TURNS = SETTINGS.turning_noise.low_pass_turns
POWERS = np.concatenate([[0.0], np.logspace(*SETTINGS.turning_noise.decades,
                                            SETTINGS.turning_noise.powers)])  # fmt: skip


@dataclasses.dataclass(frozen=True)
class RunWaves:
    """What one run leaves of its rotation, by waves and in units of the quickest ones' level.

    `waves` (samples, c) of the residual, `starts` (samples, c, k) of the free starts' columns,
    `level` (c,) in assumed sigma (NaN where nothing was measured), `used` (c,) samples.
    """

    step: float
    waves: np.ndarray
    starts: np.ndarray
    level: np.ndarray
    used: np.ndarray

    @classmethod
    def of(cls, parts: Sequence[tuple[DataRows, np.ndarray]], step: float) -> "RunWaves":
        """Of the rows of a run and its vector, whitened; of several `parts` that make it up."""
        tables = [rows.unwhitened_rotation(vector) for rows, vector in parts]
        seen = np.any([rows.rotation > 0 for rows, _ in parts], axis=0)
        used, n = seen.sum(axis=0), len(seen)
        whole = np.sqrt(n / np.maximum(used, 1))  # as if without gaps
        waves = to_waves(np.sum(np.nan_to_num(tables), axis=0)) * whole
        level = np.sqrt(np.mean(waves[wave_frequencies(n) > WHITE_FROM] ** 2, axis=0))
        level = np.where((used > FEWEST_WAVES) & (level > 0), level, np.nan)
        starts = [_placed(rows, *start) for rows, _ in parts for start in rows.starts]
        columns = np.concatenate([np.zeros((*seen.shape, 0)), *starts], axis=2)
        return cls(step, waves / level, to_waves(columns) * (whole / level)[:, None], level, used)


def _placed(rows: DataRows, part: slice, q: np.ndarray) -> np.ndarray:
    """Columns of one window's start (samples, c, k)."""
    out = np.zeros((rows.rotation.size, q.shape[1]))
    out[part] = q
    return out.reshape(*rows.rotation.shape, q.shape[1])


class _Part(NamedTuple):
    """What the waves of one channel of a run, of some power, add to -2 log L."""

    plain: float  # sum of log p and of r^2 / p
    along: np.ndarray  # (k,) F^T p^-1 r
    gram: np.ndarray  # (k, k)


class _Binned(NamedTuple):
    """Waves of one channel of a run in narrow bins: in each the power is one."""

    frequency: np.ndarray  # (bins,) cycles a sample
    count: np.ndarray  # (bins,)
    square: np.ndarray  # (bins,) sums of r^2
    along: np.ndarray  # (bins, k)
    gram: np.ndarray  # (bins, k, k)

    @classmethod
    def of(cls, waves: np.ndarray, starts: np.ndarray, f: np.ndarray) -> "_Binned":
        """Of waves (f,) and starts (f, k) at rising frequencies."""
        edges = [0]
        while edges[-1] < len(f):
            edges.append(max(edges[-1] + 1, int(np.searchsorted(f, MERGED_WAVES * f[edges[-1]]))))
        parts = [slice(*x) for x in itertools.pairwise(edges)]
        return cls(
            np.array([np.mean(f[x]) for x in parts]),
            np.diff(edges),
            np.array([waves[x] @ waves[x] for x in parts]),
            np.stack([starts[x].T @ waves[x] for x in parts]),
            np.stack([starts[x].T @ starts[x] for x in parts]),
        )

    def part(self, power: np.ndarray) -> _Part:
        """With a power by bin."""
        plain = float(self.count @ np.log(power) + np.sum(self.square / power))
        return _Part(plain, self.along.T @ (1 / power), np.tensordot(1 / power, self.gram, 1))


def _refined(spectrum: Spectrum, waves: Waves) -> Likeliest:
    """The likeliest spectrum near one of a coarse grid, and twice its log likelihood over white.

    Half a step of the grid off, low-pass noise would show a walk beside it.
    """
    f, power, count = waves.binned(MERGED_WAVES, 1)
    names = [k for k in ("walk", "low_pass", "corner") if getattr(spectrum, k) > 0]
    names = [k for k in names if k != "corner" or spectrum.low_pass > 0]

    def at(logs: np.ndarray) -> Spectrum:
        return dataclasses.replace(spectrum, **dict(zip(names, np.exp(logs), strict=True)))

    def cost(logs: np.ndarray) -> float:
        over = at(logs).plain(f)
        return float(count @ (np.log(over) + power / over))

    start = np.log([getattr(spectrum, k) for k in names])
    best = minimize(cost, start, method="Nelder-Mead").x if names else start
    return Likeliest(at(best), float(count @ power) - cost(best))


def _substituted(root: np.ndarray, right: np.ndarray) -> np.ndarray:
    """x (m, k) of L x = `right` with lower triangles L (m, k, k), all at once."""
    x, columns = right.T.copy(), np.ascontiguousarray(root.transpose(2, 1, 0))
    for j, own in enumerate(columns):
        x[j] /= own[j]
        x[j + 1 :] -= own[j + 1 :] * x[j]
    return x.T


class TurningNoise:
    """The likeliest noise of the rotation's channels in some runs, one for all of them.

    A walk's variance grows alike per second in all runs, over the square of each one's level.
    """

    def __init__(self, runs: Sequence[RunWaves], levels: Sequence[np.ndarray] | None = None):
        """`levels` by run: those of another residual, with which this one is compared."""
        self.levels = [run.level for run in runs] if levels is None else [*levels]
        self.runs = [
            dataclasses.replace(
                run, waves=run.waves * (run.level / level),
                starts=run.starts * (run.level / level)[:, None], level=level,
            )
            for run, level in zip(runs, self.levels, strict=True)
        ]  # fmt: skip
        self.channels = [
            c for c in range(len(self.levels[0])) if all(np.isfinite(x[c]) for x in self.levels)
        ]
        squares = [run.waves**2 for run in self.runs]
        self.bases = {c: self._quick(squares, c) for c in self.channels}
        self._binned: dict[tuple[int, int, bool], _Binned] = {}
        self._known: dict[tuple[int, int, int], _Part] = {}
        every = sum(r.waves.shape[0] * len(self.channels) for r in self.runs)
        chance = SETTINGS.levels.colour_chance / max(1, 2 * len(self.channels))
        self._price = max(float(np.log(every)), float(chdtri(1, chance)))

    def _quick(self, squares: Sequence[np.ndarray], channel: int) -> Spectrum:
        """White or low-pass noise by the waves of which the free starts take up little.

        `squares` by run are the powers (samples, c) of the waves.
        """
        f, power = [], []
        for run, square in zip(self.runs, squares, strict=True):
            own = wave_frequencies(len(run.waves))
            some = own / run.step > TOLD_FROM
            f.append(own[some])
            power.append(square[some, channel])
        frequency, powers = np.concatenate(f), np.concatenate(power)
        order = np.argsort(frequency, kind="stable")
        if len(order) < FEWEST_WAVES:
            return Spectrum(1.0)
        waves, price = Waves(frequency[order], powers[order]), np.log(len(order))
        best = {k: _refined(x.spectrum, waves) for k, x in likeliest(waves, 1.0).items()}
        gain = {k: best[k].gain - NUMBERS[k] * price for k in best}
        name = max(gain, key=lambda k: gain[k])
        least = chdtri(NUMBERS[name], SETTINGS.levels.colour_chance)
        if name == "walk" or gain[name] < 0 or best[name].gain < least:
            return Spectrum(1.0)
        plain = best[name].spectrum
        beside = Waves(waves.frequency, waves.power / plain.plain(waves.frequency))
        ratio = beside.binned(BIN_WIDTH, SETTINGS.spectrum.bin_waves * len(self.runs))[:2]
        return dataclasses.replace(plain, walk=0.0, ratio=ratio)

    @functools.cached_property
    def _scales(self) -> np.ndarray:
        """(runs, c) a walk's power over that of the slowest wave of a run like the mean one.

        Of one whose variance grows alike per second: by f^2 in cycles a sample.
        """
        ratio = np.array([run.step / x**2 for run, x in zip(self.runs, self.levels, strict=True)])
        lasts = np.mean([len(run.waves) for run in self.runs])
        return ratio / np.exp(np.mean(np.log(ratio), axis=0)) / (2 * lasts) ** 2

    def walk(self, run: int, channel: int, power: float) -> float:
        """`Spectrum.walk` in a run of a walk of some power over the level's."""
        return float(power * self._scales[run, channel])

    def _part(self, run: int, number: int, power: int) -> _Part:
        """Of a channel of a run, the walk's or, at numbers behind, the offset's power."""
        key = run, number, power
        if key not in self._known:
            mean, at = divmod(number, len(self.channels))
            channel, extra = self.channels[at], float(POWERS[power])
            bins, base = self._bins(run, channel, bool(mean)), self.bases[channel]
            if mean:
                level = (base.white + base.low_pass + extra) * base.beside(base.ratio[0][:1])
            else:
                spectrum = dataclasses.replace(base, walk=self.walk(run, channel, extra))
                level = spectrum.plain(bins.frequency) * spectrum.beside(bins.frequency)
            self._known[key] = bins.part(level)
        return self._known[key]

    def _bins(self, run: int, channel: int, mean: bool) -> _Binned:
        """The waves of one channel of a run: its offset, or all others."""
        if (run, channel, mean) not in self._binned:
            of = self.runs[run]
            some = slice(0, 1) if mean else slice(1, None)
            f = wave_frequencies(len(of.waves))[some]
            self._binned[run, channel, mean] = _Binned.of(
                of.waves[some, channel], of.starts[some, channel], f
            )
        return self._binned[run, channel, mean]

    def _deviances(self, powers: np.ndarray, steps: Sequence[tuple[int, int]]) -> np.ndarray:
        """-2 log L, but for a constant, where one of the `powers` (2 c: walks, offsets) is another.

        `steps` holds which and its number.
        """
        total = np.zeros(len(steps))
        for run in range(len(self.runs)):
            now = [self._part(run, i, k) for i, k in enumerate(powers)]
            new = [self._part(run, i, k) for i, k in steps]
            old = [now[i] for i, _ in steps]
            pairs = [*zip(new, old, strict=True)]
            total += sum(x.plain for x in now)
            total += np.array([x.plain - y.plain for x, y in pairs])
            along = sum(x.along for x in now) + np.stack([x.along - y.along for x, y in pairs])
            gram = sum(x.gram for x in now) + np.stack([x.gram - y.gram for x, y in pairs])
            if along.shape[1]:
                root = np.linalg.cholesky(gram + START_WEIGHT * np.eye(gram.shape[1]))
                total += 2 * np.sum(np.log(np.diagonal(root, axis1=1, axis2=2)), axis=1)
                total -= np.sum(_substituted(root, along) ** 2, axis=1)
        return total

    @functools.cached_property
    def likeliest(self) -> tuple[np.ndarray, float]:
        """The likeliest powers (2 c: walks, offsets), by number, and their deviance.

        The starts take up some of low-pass noise: it is told again by what is expected of it.
        """
        powers, cost = self._likeliest()
        for _ in range(LOW_PASS_TURNS if any(x.low_pass for x in self.bases.values()) else 0):
            squares = self._expected(powers)
            self.bases = {c: self._quick(squares, c) for c in self.channels}
            self._known.clear()
            powers, cost = self._likeliest()
        return powers, cost

    def _expected(self, powers: np.ndarray) -> list[np.ndarray]:
        """By run the powers (samples, c) that the noise's waves are expected to have."""
        out = []
        for k, run in enumerate(self.runs):
            parts = [self._part(k, i, power) for i, power in enumerate(powers)]
            along = np.sum([x.along for x in parts], axis=0)
            gram = np.sum([x.gram for x in parts], axis=0)
            inverse = np.linalg.inv(gram + START_WEIGHT * np.eye(len(gram)))
            noise = run.waves - run.starts @ (inverse @ along)
            out.append(noise**2 + np.einsum("fck,kl,fcl->fc", run.starts, inverse, run.starts,
                                            optimize=True))  # fmt: skip
        return out

    def _likeliest(self) -> tuple[np.ndarray, float]:
        """The same with the low-pass noise as it stands.

        From none, and from an offset in every channel: a walk stands in for several of them.
        """
        count = len(self.channels)
        begins = np.zeros((2, 2 * count), int)
        begins[1, count:] = len(POWERS) // 2
        ways = [self._from(begin) for begin in begins]
        powers, cost = min(ways, key=lambda way: way[1])
        return powers, cost - self._price * np.count_nonzero(powers)

    def _from(self, now: np.ndarray) -> tuple[np.ndarray, float]:
        """The likeliest powers from some on, and their deviance with what their number costs.

        One is taken in or changed after the other; each has to gain its price.
        """
        cost = np.inf
        while True:
            steps = [
                (i, k) for i, old in enumerate(now) for k in range(len(POWERS))
                if k == old or not old or not k or abs(k - old) <= MOVED_POWERS
            ]  # fmt: skip
            if not steps:
                return now, 0.0
            taken = np.count_nonzero(now)
            count = np.array([taken - (now[i] > 0) + (k > 0) for i, k in steps])
            costs = self._deviances(now, steps) + self._price * count
            best = int(np.argmin(costs))
            if not costs[best] < cost - START_WEIGHT * abs(costs[best]):
                return now, cost
            cost = float(costs[best])
            now[steps[best][0]] = steps[best][1]

    def shown(self, names: Sequence[str]) -> list[dict[str, Level]]:
        """By run the `Level` of the channels, by name; of none where none has a colour."""
        walks, offsets = np.split(POWERS[self.likeliest[0]], 2)
        extra = dict(zip(self.channels, zip(walks, offsets, strict=True), strict=True))
        if not any(np.any(extra[c]) or self.bases[c].low_pass for c in self.channels):
            return [{} for _ in self.runs]
        return [{names[c]: self._level(k, c, *map(float, extra[c])) for c in self.channels}
                for k in range(len(self.runs))]  # fmt: skip

    def _level(self, run: int, channel: int, walk: float, offset: float) -> Level:
        """The level of a channel of a run, that of its quickest waves; of some powers beside."""
        own = self.runs[run]
        base, walk = self.bases[channel], self.walk(run, channel, walk)
        spectrum = dataclasses.replace(base, walk=walk, offset=offset)
        error = (2 * np.sum(wave_frequencies(len(own.waves)) > WHITE_FROM)) ** -0.5
        level, colour = float(self.levels[run][channel]), spectrum.colour
        return Level(level, float(error), level, colour, None if colour == "white" else spectrum,
                     int(own.used[channel]))  # fmt: skip
