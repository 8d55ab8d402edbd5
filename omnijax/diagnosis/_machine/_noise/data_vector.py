"""The data vector: whitened residual rows, and the directions that are left out of it."""

import dataclasses
import functools
import math
from collections.abc import Sequence

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from ....recording import channels
from ..._orthonormal import orthonormal
from ..._search import Level, of_waves, to_waves
from ..._settings import SETTINGS
from ..runs import Run

ELASTIC_CHANNELS = tuple(f"{g}_{axis}" for g in ("dR", "a") for axis in "xyz")
SETTLE = SETTINGS.data_vector.settle
SHORTEST_WINDOW = SETTINGS.data_vector.shortest_window
UNTOLD = SETTINGS.turning_noise.start_weight
LATE = max(SETTINGS.candidates.delays)


def rotation_channels(wheels: int) -> tuple[str, ...]:
    """The channels of a rotation's rows, in their order."""
    return (*channels("Omega", wheels), *channels("theta", wheels))


@dataclasses.dataclass
class DataRows:
    """Rows of one run: elastic (samples, 6: dR, a), then rotation (samples, 3 + n: Omega, s).

    `weight` is 1/sigma, 0 where nothing usable was measured.  `nuisance` holds (slice, orthonormal
    columns): Omega and s at the start of every window, and the elastic state of a rolling start.
    `filters` (6, samples: waves) whitens the elastic channels in time, where their noise has a
    colour; `coloured` whitens further, where the encoders' noise enters them: (U, shrink).
    `turning` (3 + n, samples: waves) whitens the rotation likewise.  A wave lasts over all windows,
    so their starts, white noise's directions, are left out together then.  `late` holds orthonormal
    rows (k, rows) along the offsets of clocks that were fitted to this run.
    """

    samples: int
    elastic: np.ndarray
    rotation: np.ndarray
    nuisance: list[tuple[slice, np.ndarray]]
    coloured: tuple[np.ndarray, np.ndarray] | None = None
    filters: np.ndarray | None = None
    turning: np.ndarray | None = None
    late: np.ndarray | None = None

    @property
    def size(self) -> int:
        """Number of rows."""
        return self.elastic.size + self.rotation.size

    def vector(self, elastic, rotation) -> np.ndarray:
        """Whitened rows of residuals or signatures; None is zero.

        What was not measured is zero; a prediction that is not finite stays so.
        """
        out = np.empty(self.size)
        self.write(out, elastic, rotation)
        return out

    def write(self, out: np.ndarray, elastic, rotation) -> None:
        """`vector` into a contiguous array (rows,)."""
        for values, weight, part in zip(
            (elastic, rotation), (self.elastic, self.rotation), self.split(out), strict=True
        ):
            if values is None:
                part[:] = 0.0
            else:
                np.multiply(values, weight, out=part)
                np.copyto(part, 0.0, where=weight <= 0)

    def project(self, x: np.ndarray) -> np.ndarray:
        """`x` (rows,) or (rows, k), whitened, less its part along the nuisance directions."""
        many = np.array(x.T, order="C", ndmin=2)
        self.take_off(many)
        return many[0] if x.ndim == 1 else many.T

    def take_off(self, x: np.ndarray) -> None:
        """`project` of row vectors (k, rows), in place."""
        self.whiten(x)
        cut = self.elastic.size
        for part, q in self.nuisance:
            if self.turning is None or part.start < cut:
                x[:, part] -= (x[:, part] @ q) @ q.T
        if self.turning is not None:
            self.bleach_rotation(x[:, cut:])
            self._take_off_starts(x[:, cut:])
        if self.late is not None:
            x -= (x @ self.late.T) @ self.late

    @property
    def starts(self) -> list[tuple[slice, np.ndarray]]:
        """Directions of the windows' starts under white noise, by their part of the rotation."""
        cut = self.elastic.size
        return [
            (slice(part.start - cut, part.stop - cut), q)
            for part, q in self.nuisance if part.start >= cut
        ]  # fmt: skip

    def _take_off_starts(self, x: np.ndarray) -> None:
        """Whitened rotation rows (k, rotation) less their part along the starts W q, in place.

        W is symmetric: what (W q)^T x is of every window, and what is taken off, need no W q.
        """
        back = x.copy()
        self.bleach_rotation(back)
        along = [back[:, part] @ q for part, q in self.starts]
        # rows of a rig that runs away are not finite, and stay so
        sizes = cho_solve(self._gram, np.concatenate(along, axis=1).T, check_finite=False).T
        back[:] = 0.0
        ends = np.cumsum([q.shape[1] for _, q in self.starts])[:-1]
        for (part, q), size in zip(self.starts, np.split(sizes, ends, axis=1), strict=True):
            back[:, part] = size @ q.T
        self.bleach_rotation(back)
        x -= back

    @functools.cached_property
    def _gram(self) -> tuple[np.ndarray, bool]:
        """Cholesky factor of the whitened starts' inner products."""
        rows = []
        for part, q in self.starts:
            own = np.zeros((q.shape[1], self.rotation.size))
            own[:, part] = q.T
            for _ in range(2):
                self.bleach_rotation(own)
            rows.append(np.concatenate([own[:, p] @ r for p, r in self.starts], axis=1))
        gram = np.concatenate(rows)
        return cho_factor((gram + gram.T) / 2 + UNTOLD * np.eye(len(gram)), lower=True)

    def bleach_rotation(self, x: np.ndarray) -> None:
        """Whiten rotation rows (k, rotation) in time, in place: waves over their amplitudes."""
        _bleach(x, self.turning)

    def whiten(self, x: np.ndarray) -> None:
        """Whiten the elastic channels of row vectors (k, rows) in place.

        First each channel in time, by its own noise's colour, then from the encoders' part.
        """
        self.bleach(x[:, : self.elastic.size])
        if self.coloured is not None:
            U, shrink = self.coloured
            elastic = x[:, : self.elastic.size]
            elastic -= (elastic @ U.T * shrink) @ U

    def bleach(self, x: np.ndarray) -> None:
        """Whiten elastic rows (k, elastic) in time, in place: waves over their amplitudes."""
        _bleach(x, self.filters)

    def split(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """A row vector as its (elastic, rotation) tables, whitened."""
        cut = self.elastic.size
        return x[:cut].reshape(self.elastic.shape), x[cut:].reshape(self.rotation.shape)

    def unwhitened(self, x: np.ndarray) -> np.ndarray:
        """The elastic table (samples, 6) of a row vector, in sigma, not whitened in time.

        NaN where nothing counts.
        """
        return _unbleached(self.split(x)[0], self.filters, self.elastic)

    def unwhitened_rotation(self, x: np.ndarray) -> np.ndarray:
        """The same of the rotation (samples, 3 + n), but for a part along the windows' starts."""
        return _unbleached(self.split(x)[1], self.turning, self.rotation)

    def left_of_noise(self, noise: Sequence[Level | None], count: int) -> np.ndarray:
        """What is left (samples, 3 + n, count) of rotations that hold noise alone, drawn anew.

        `noise` by channel, None of white noise as it is assumed; where the rows are whitened in
        time it is that by which they are.  Equal calls draw the same.
        """
        n, wide = self.rotation.shape
        if self.turning is None:
            size = [np.ones(n) if x is None else x.amplitudes(n) for x in noise]
            amplitudes = np.stack(size, axis=1)
        else:
            amplitudes = 1 / self.turning.T
        waves = np.random.default_rng(0).normal(size=(count, n, wide)) * amplitudes
        out = np.zeros((count, self.size))
        drawn = np.where(self.rotation > 0, of_waves(waves, 1), 0.0)
        out[:, self.elastic.size :] = drawn.reshape(count, -1)
        self.take_off(out)
        return np.moveaxis(out[:, self.elastic.size :].reshape(count, n, wide), 0, 2)

    @property
    def windows(self) -> list[slice]:
        """Samples after whose first one Omega and the rolled lengths start anew."""
        cut, wide = self.elastic.size, self.rotation.shape[1]
        parts = [part for part, _ in self.nuisance if part.start >= cut]
        return [slice((p.start - cut) // wide, (p.stop - cut) // wide) for p in parts]

    @property
    def used(self) -> int:
        """Rows with weight, less the nuisance directions."""
        count = int(np.sum(self.elastic > 0) + np.sum(self.rotation > 0))
        free = sum(q.shape[1] for _, q in self.nuisance)
        return count - free - (0 if self.late is None else len(self.late))


def _bleach(x: np.ndarray, filters: np.ndarray | None) -> None:
    """Whiten rows (k, samples by channels) in time, in place; where there are filters."""
    if filters is not None:
        for c in np.flatnonzero(np.any(filters != 1.0, axis=1)):
            part = slice(c, None, len(filters))
            x[:, part] = of_waves(to_waves(x[:, part], 1) * filters[c], 1)


def _unbleached(table: np.ndarray, filters: np.ndarray | None, weight: np.ndarray) -> np.ndarray:
    """A whitened table (samples, channels) before that; NaN where nothing has a weight."""
    if filters is not None:
        table = of_waves(to_waves(table) / filters.T)
    return np.where(weight > 0, table, np.nan)


def make_rows(run: Run, noise, length_noise, axes, window: float, wheels: int) -> DataRows:
    """Weights and nuisance directions of one run; `length_noise` (n,) is sigma of s."""
    n = run.samples
    elastic = np.concatenate([_weights(run, g, noise, 3) for g in ("dR", "a")], axis=1)
    theta = _weights(run, "theta", {"theta": 1.0}, wheels)
    filters = _filters(run, ELASTIC_CHANNELS)
    turning = _filters(run, rotation_channels(wheels))
    rotation = np.concatenate([_weights(run, "Omega", noise, 3), theta / length_noise], axis=1)
    for i in np.flatnonzero(~run.known):
        elastic[max(0, i - 1) : i + int(SETTLE / run.step)] = 0.0
    if run.rolling_start(noise):  # nobody knows what a late sensor still reads from before
        elastic[: math.ceil(LATE / run.step)] = 0.0
    if run.counts is not None:
        elastic[~run.counts] = 0.0
        rotation[~run.counts] = 0.0
    rows = DataRows(n, elastic, rotation, [], filters=filters, turning=turning)
    length = n if window <= 0 else max(SHORTEST_WINDOW, round(window / run.step))
    starts = list(range(0, n, length))
    if len(starts) > 1 and n - starts[-1] < length // 2:
        starts.pop()
    for first, last in zip(starts, [*starts[1:], n], strict=True):
        if not run.known[first:last].all():
            rotation[first:last] = 0.0
        columns = _start_columns(first, last, run, axes, rotation[first:last])
        width = rotation.shape[1]
        offset = elastic.size
        part = slice(offset + first * width, offset + last * width)
        rows.nuisance.append((part, orthonormal(columns)))
    return rows


def _weights(run: Run, group: str, noise, channels: int) -> np.ndarray:
    values = run.outputs.get(group)
    if values is None or not noise.get(group):
        return np.zeros((run.samples, channels))
    return np.isfinite(values) / (noise[group] * run.level(group))


def _filters(run: Run, names: Sequence[str]) -> np.ndarray | None:
    """1/sqrt of the relative spectrum of the noise of channels (channels, samples: waves).

    None where all are white.
    """
    if not any(name in run.spectra for name in names):
        return None
    out = np.ones((len(names), run.samples))
    for c, channel in enumerate(names):
        if channel in run.spectra:
            out[c] = 1 / np.sqrt(run.spectra[channel].power(run.samples))
    return out


def _start_columns(first, last, run: Run, axes, weight) -> np.ndarray:
    """Changes of the window's rows with Omega (3) and s (n) at its start, whitened."""
    count, wheels = last - first, weight.shape[1] - 3
    columns = np.zeros((count, 3 + wheels, 3 + wheels))
    columns[:, :3, :3] = np.eye(3)
    time = run.time[first:last] - run.time[first]
    if len(axes) == 1:
        columns[:, 3:, :3] = time[:, None, None] * axes[0]
    else:
        here = axes[:: max(1, (len(axes) - 1) // (run.samples - 1))][first:last]
        columns[:, 3:, :3] = np.cumsum(here, axis=0) * run.step - here[:1] * run.step
    columns[:, 3:, 3:] = np.eye(wheels)
    return (columns * weight[:, :, None]).reshape(-1, 3 + wheels)
