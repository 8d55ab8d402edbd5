"""A measured run as the diagnosis uses it: plain arrays, masks, noise and the fine time grids."""

import dataclasses

import numpy as np

from .settings import SETTINGS

FINE = SETTINGS.force_points
STEPS = SETTINGS.steps
COARSE = SETTINGS.coarse_steps
SHAPE = SETTINGS.shape_points
ELASTIC = ("dR", "a")


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

    @property
    def step(self) -> float:
        """Sampling interval, s."""
        return float(self.time[1] - self.time[0])

    @property
    def samples(self) -> int:
        """Number of samples."""
        return len(self.time)

    def fine(self, parts: int) -> np.ndarray:
        """Times with `parts` points a sample, s."""
        return np.linspace(0.0, self.time[-1], (self.samples - 1) * parts + 1)

    def first(self, samples: int) -> "Run":
        """The run's first samples."""
        parts = {k: getattr(self, k)[:samples] for k in ("time", "torque", "force", "known")}
        outputs = {g: values[:samples] for g, values in self.outputs.items()}
        return dataclasses.replace(self, outputs=outputs, **parts)

    def rolling_start(self, noise: dict[str, float]) -> bool:
        """Whether the sphere turns already at the first samples."""
        first = self.outputs["Omega"][:10] if "Omega" in self.outputs else None
        if first is not None and np.isfinite(first).any():
            return bool(np.nanmax(np.abs(np.nanmean(first, axis=0))) > 5 * noise["Omega"])
        angle = self.outputs.get("theta")
        if angle is None:
            return False
        change = np.nanmean(angle[10:20], axis=0) - np.nanmean(angle[:10], axis=0)
        return bool(np.nanmax(np.abs(change)) > 5 * noise["theta"])


def to_run(recording) -> Run:
    """A `Recording` as arrays: inputs interpolated over missing stretches, which are marked."""
    step = float(np.median(np.diff(recording.time)))
    n = round((recording.time[-1] - recording.time[0]) / step) + 1
    index = np.round((recording.time - recording.time[0]) / step).astype(int)

    def gridded(values):
        full = np.full((n, values.shape[1]), np.nan)
        full[index] = values
        return full

    inputs = [gridded(recording.torque), gridded(recording.force)]
    if np.isnan(inputs[1]).all():
        inputs[1][:] = 0.0
    known: np.ndarray = np.all(np.isfinite(np.concatenate(inputs, axis=1)), axis=1)
    torque, force = (filled(x) for x in inputs)
    outputs = {g: gridded(recording.group(g)) for g in recording.groups}
    time = np.arange(n) * step
    return Run(recording.name, recording.role, time, torque, force, outputs, known)


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
