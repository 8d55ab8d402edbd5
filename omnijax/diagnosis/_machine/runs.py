"""A measured run as the diagnosis uses it: plain arrays, masks, noise and the fine time grids."""

import dataclasses
import functools
from collections.abc import Mapping
from typing import Any

import numpy as np

from ...recording import at_first_sample
from .._search import Spectrum
from .._settings import SETTINGS

FINE = SETTINGS.prediction.force_points
STEPS = SETTINGS.prediction.steps
COARSE = SETTINGS.prediction.coarse_steps
SHAPE = SETTINGS.prediction.shape_points
FIRST_SAMPLES = SETTINGS.runs.first_samples
ROLLING_SIGMAS = SETTINGS.runs.rolling_sigmas
ELASTIC = ("dR", "a")
SPEEDS = {"Omega": 0, "theta": 1}  # groups that tell speeds, and as which derivative


@dataclasses.dataclass(frozen=True)
class Run:
    """One run on a uniform grid; NaN where nothing usable was measured."""

    name: str
    role: str
    time: np.ndarray  # (n,) s, from the first sample
    torque: np.ndarray  # (n, wheels)
    force: np.ndarray  # (n, 3)
    outputs: dict[str, np.ndarray]  # group -> (n, channels)
    known: np.ndarray  # (n,) whether the inputs were measured
    start: np.ndarray | None = None  # (wheels,) rad at the first sample, where no encoder says it
    levels: dict[str, np.ndarray] = dataclasses.field(default_factory=dict)  # see `level`
    spectra: dict[str, Spectrum] = dataclasses.field(default_factory=dict)
    counts: np.ndarray | None = None  # (n,) samples that are compared; None: every one
    # group -> (n, channels): readings of samples that `outputs` lacks as outliers, NaN elsewhere
    aside: dict[str, np.ndarray] = dataclasses.field(default_factory=dict)
    longest: int = 0  # samples of the longest run beside it, see `as_longest`

    def level(self, group: str) -> np.ndarray | float:
        """1-sigma (channels,) of this run's noise over that of the group."""
        return self.levels.get(group, 1.0)

    @property
    def step(self) -> float:
        """Sampling interval, s."""
        return float(self.time[1] - self.time[0])

    @property
    def samples(self) -> int:
        """Number of samples."""
        return len(self.time)

    @functools.cached_property
    def lacks_an_encoder(self) -> bool:
        """Whether the angle of some wheel was measured nowhere."""
        measured = self.outputs.get("theta")
        return measured is None or bool(np.isnan(measured).all(axis=0).any())

    @functools.cached_property
    def _speeds_at_start(self) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        """By group that tells them the speeds at the first sample, rad/s, and their 1-sigma."""
        return {
            group: at_first_sample(self.time, self.outputs[group], order)
            for group, order in SPEEDS.items() if group in self.outputs
        }  # fmt: skip

    def as_longest(self, values: np.ndarray) -> np.ndarray:
        """A signal (points, ..) of evenly as many points a sample, led on to the longest run's end.

        So that one compiled program serves all runs of a case.  One entry for all times stays so.
        """
        if len(values) == 1:
            return values
        parts = (len(values) - 1) // (self.samples - 1)
        return padded(values, (max(self.longest, self.samples) - 1) * parts + 1)

    def fine(self, parts: int) -> np.ndarray:
        """Times with `parts` points a sample, s."""
        return np.linspace(0.0, self.time[-1], (self.samples - 1) * parts + 1)

    def first(self, samples: int) -> "Run":
        """The run's first samples."""
        parts = {k: getattr(self, k)[:samples] for k in ("time", "torque", "force", "known")}
        outputs = {g: values[:samples] for g, values in self.outputs.items()}
        parts["aside"] = {g: values[:samples] for g, values in self.aside.items()}
        parts["counts"] = None if self.counts is None else self.counts[:samples]
        return dataclasses.replace(self, outputs=outputs, **parts)

    def rolling_start(self, noise: dict[str, float]) -> bool:
        """Whether the sphere turns already at the first sample.

        By Omega, or by the wheels' angles where it was not measured: by more than is uncertain, and
        than the noise of one sample (angles: over `FIRST_SAMPLES` of them).  The first sample of
        Omega has to say so too, as friction and lags bend a start from rest.
        """
        for group, (speed, sigma) in self._speeds_at_start.items():
            if np.isfinite(speed).any():
                order = SPEEDS[group]
                least = noise[group] / (FIRST_SAMPLES * self.step) ** order
                moves = np.abs(speed) > ROLLING_SIGMAS * np.maximum(sigma, least)
                rests = order == 0 and np.abs(self.outputs[group][0]) <= ROLLING_SIGMAS * least
                return bool(np.any(moves & ~np.asarray(rests)))
        return False


def with_noise(run: Run, noise: Mapping[str, Any], wheels: int) -> Run:
    """The run with other noise: by channel a `ratio` to the old 1-sigma; a `spectrum` or None."""
    levels, spectra = dict(run.levels), dict(run.spectra)
    for group in run.outputs:
        names = [f"{group}_{c}" for c in (range(1, wheels + 1) if group == "theta" else "xyz")]
        ratio = np.array([_strength(noise.get(n)) for n in names])
        if np.any(ratio != 1.0):
            levels[group] = run.level(group) * ratio
        for n in names:
            if n in noise and noise[n].spectrum is not None:
                spectra[n] = noise[n].spectrum
    return dataclasses.replace(run, levels=levels, spectra=spectra)


def _strength(level: Any) -> float:
    """1-sigma of a channel over the old one."""
    if level is None or not np.isfinite(level.ratio) or level.ratio <= 0:
        return 1.0
    return float(level.ratio)


def to_run(recording) -> Run:
    """A `Recording` as arrays at even times; where its inputs were lost is marked."""
    even = recording.filled()
    outputs = {g: even.group(g) for g in even.groups}
    force = np.zeros((len(even), 3)) if np.isnan(even.force).all() else even.force
    time = even.step * np.arange(len(even))
    return Run(even.name, even.role, time, even.torque, force, outputs, ~even.lost)


def filled(values: np.ndarray) -> np.ndarray:
    """NaN replaced by linear interpolation (0 where nothing is known)."""
    out, at = values.copy(), np.arange(len(values))
    for c in range(values.shape[1]):
        good = np.isfinite(values[:, c])
        out[:, c] = np.interp(at, at[good], values[good, c]) if good.any() else 0.0
    return out


def padded(values: np.ndarray, length: int) -> np.ndarray:
    """`values` (t, ...) with the last one held, or zero where there is none, to `length`."""
    if len(values) == length:
        return values
    last = values[-1:] if len(values) else np.zeros((1, *values.shape[1:]))
    return np.concatenate([values, np.repeat(last, length - len(values), axis=0)])
