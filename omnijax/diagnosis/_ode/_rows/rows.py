"""Measured less predicted, one run: over a free run, or in the balance of accelerations."""

import dataclasses
import math
from collections.abc import Mapping

import jax
import jax.numpy as jnp
import numpy as np
from scipy.signal import butter, filtfilt, firwin

from ....machine import (
    acting,
    between,
    delayed_inputs,
    outputs_along,
    places_of,
    start_state,
    states_along,
    travelled,
    vector_field,
)
from ..._settings import SETTINGS
from .before import Before, memories_at, seen
from .known import before_sensors, memories, rate_of, states
from .numbers import Numbers

LEAST_START = SETTINGS.free_rows.least_start
FILTER_TAPS = SETTINGS.free_rows.filter_taps
FILTER_ORDER = SETTINGS.free_rows.filter_order
HIGHEST_CUTOFF = SETTINGS.free_rows.highest_cutoff
IMPULSE_SAMPLES = SETTINGS.free_rows.impulse_samples
IMPULSE_EDGES = SETTINGS.free_rows.impulse_edges
PASSED_BAND = SETTINGS.free_rows.passed_band


@dataclasses.dataclass(frozen=True)
class OdeRun:
    """One measured run on a uniform grid, SI units."""

    name: str
    role: str
    time: np.ndarray
    inputs: Mapping[str, np.ndarray]
    outputs: Mapping[str, np.ndarray]
    cutoff: float  # Hz, of the low pass that gives measured speed and acceleration
    hold: str = "linear"
    measured: str = "position"  # or velocity: the position is its integral then

    @property
    def step(self) -> float:
        """Sampling step, s: one number in all parts of a log, for programs are written for it."""
        return float(f"{(self.time[-1] - self.time[0]) / (len(self.time) - 1):.10g}")

    @property
    def shown(self) -> np.ndarray:
        """What was measured (t,)."""
        return np.asarray(self.outputs[self.measured])


def smoothed(x: np.ndarray, step: float, cutoff: float) -> tuple[np.ndarray, ...]:
    """A signal, its rate and acceleration: low-passed both ways (`FILTER_ORDER`), differences."""
    b, a = butter(FILTER_ORDER, min(HIGHEST_CUTOFF, 2 * cutoff * step))  # pyright: ignore[reportAssignmentType, reportGeneralTypeIssues]
    x = filtfilt(b, a, x)
    v = np.asarray(rate_of(x, step))
    return x, v, np.asarray(rate_of(v, step))


class Balance:
    """Measured acceleration less that of the equation at the measured position and speed.

    Both sides go through the same low pass and are thinned; nothing is integrated.
    """

    group = "acceleration"

    @property
    def kind(self) -> tuple:
        """What a program of such rows hangs on beside the shapes of the data."""
        return ("balance", self.thin)

    picked = slice(None)  # of the values of `rows` those that count

    def __init__(self, numbers: Numbers, run: OdeRun):
        self.numbers, self.run, cutoff = numbers, run, run.cutoff
        q, v, a = smoothed(run.outputs["position"], run.step, cutoff)
        self.thin = max(1, round(1 / (run.step * cutoff)))
        wide = 2 * FILTER_TAPS * self.thin + 1
        self.taps = np.asarray(
            firwin(wide, PASSED_BAND / self.thin) if self.thin > 1 else np.ones(1)
        )
        self.edge = len(self.taps) // 2
        given = {"input": acting(np.asarray(run.inputs["input"]), run.hold)}
        inputs = {k: jnp.asarray(x) for k, x in (dict(run.inputs) | given).items()}
        time = jnp.asarray(run.time)
        self.data = (jnp.asarray(q), jnp.asarray(v), jnp.asarray(a), inputs, time)
        self.count = len(self.thinned(np.asarray(q)))
        self.time = self.thinned(run.time)
        self.filtered = {"position": q, "velocity": v, "acceleration": a}

    def thinned(self, x) -> np.ndarray:
        """A sampled signal through the thinning low pass."""
        return np.convolve(np.asarray(x), self.taps, "valid")[:: self.thin]

    def rows(self, theta, data, steps=1, only=None, on=None):
        """(rows,) m/s^2 or rad/s^2; traced.  Nothing is stepped in time."""
        q, v, a, inputs, time = data
        machine, placed = self.numbers.build(theta, only, on)
        inputs = delayed_inputs(placed, time - time[0], inputs)
        rate, _, _ = vector_field(machine, placed)
        q, v, a = before_sensors(placed, time, (q, v, a))
        x = states(machine, q, v, time[1] - time[0])
        whole = jnp.concatenate([x, memories(machine, placed, time, x, inputs)], axis=1)
        raw = a - jax.vmap(rate)(whole, inputs)[:, 1]
        return jnp.convolve(raw, jnp.asarray(self.taps), "valid")[:: self.thin]

    def each(self, one, data, *tables):
        """`one(data, row, ...)` of all rows (points, ...) of some tables: (points, rows)."""
        return jax.vmap(lambda *row: one(data, *row))(*tables)

    def gain(self) -> float:
        """1-sigma of a row for white noise of 1-sigma 1 in what is measured."""
        n = max(IMPULSE_SAMPLES, IMPULSE_EDGES * self.edge + 1)
        impulse = np.zeros(n)
        impulse[n // 2] = 1.0
        if self.run.measured == "velocity":
            impulse = travelled(impulse, self.run.step)
        _, _, a = smoothed(impulse, self.run.step, 1 / (self.thin * self.run.step))
        return float(np.linalg.norm(np.convolve(a, self.taps, "same")))


class FreeRun:
    """Measured outputs less those simulated from the inputs, in windows.

    A window begins at the measured state, `lead` samples before the first that counts: by then an
    axis that forgets has forgotten its start.  Before a run's own first sample nothing was
    measured, so that its first window begins where it counts: as for windows without a lead, start
    and past (`before`) are free there.  A run that is shorter than its window is filled up, so that
    runs of about one length share a program.
    """

    @property
    def group(self) -> str:
        """The output that is compared: position or velocity."""
        return self.run.measured

    @property
    def kind(self) -> tuple:
        """What a program of such rows hangs on beside the shapes of the data."""
        return ("free-run", self.run.hold, self.run.step)

    def __init__(self, numbers: Numbers, run: OdeRun, lead: int, length: int, thin: int = 1):
        self.numbers, self.run, self.thin = numbers, run, thin
        n, self.places = len(run.time), places_of(run.hold)
        q, v, _ = smoothed(run.outputs["position"], run.step, run.cutoff)
        if run.measured == "position":
            q = np.where(np.arange(n) < 3, run.outputs["position"], q)
        ends = windows(n, length)
        begins, count, total = np.append(0, ends[:-1]), len(ends), length + lead
        self.begin = np.maximum(0, begins - lead)
        short = begins - self.begin < max(lead, 1)
        self.free = [w for w in range(count) if short[w]]  # windows of free starts
        take = self.begin[:, None] + np.arange(total)
        self.used = (take >= begins[:, None]) & (take < ends[:, None])
        take = np.minimum(take, n - 1)
        fine = {k: between(x, run.hold) for k, x in run.inputs.items()}
        spot = self.begin[:, None] * self.places + np.arange(self.places * (total - 1) + 1)
        spot = np.minimum(spot, self.places * (n - 1))
        first = {"position": (jnp.asarray(q[self.begin]), jnp.asarray(v[self.begin]))}
        inputs = {k: jnp.asarray(x[spot]) for k, x in fine.items()}
        where = np.stack(np.nonzero(self.used))[:, ::thin]
        self.where = where
        self.picked = np.ravel_multi_index(tuple(where), take.shape)
        clock = self.begin[:, None] + np.arange(total)
        clock = jnp.asarray(clock * run.step)
        shown = jnp.asarray(run.shown[take])
        self.states = len(numbers.machine.start({"position": (0.0, 0.0)}))
        self.data = (first, inputs, clock, shown)
        self.count, self.time = where.shape[1], run.time[take[tuple(where)]]

    def simulated(self, theta, data, steps, shift=0.0, only=None, on=None):
        """What is measured (samples,) in one window of the data, its start and past moved; traced.

        `data` are those of one window and its start, `shift` (states + 2,) what this is moved by.
        """
        first, inputs, time, _, moved = data
        machine, placed = self.numbers.build(theta, only, on)
        parts, hold, step = self.places, self.run.hold, self.run.step
        moved = moved + shift
        x0 = start_state(machine, first) + moved[: self.states]
        before = Before(*moved[self.states :])
        memory = memories_at(machine, placed, x0, inputs, before)
        fine = jnp.linspace(time[0], time[-1], parts * (len(time) - 1) + 1)
        inputs = delayed_inputs(placed, fine, inputs, before.jump)
        way = states_along(machine, placed, x0, inputs, step, steps, parts, hold, memory)
        out = outputs_along(machine, way, inputs, parts)
        return seen(placed, time, out[self.run.measured], step, before)

    def as_measured(self) -> np.ndarray:
        """Starts (windows, states + 2) that are moved by nothing from what was measured."""
        return np.zeros((len(self.begin), self.states + len(Before._fields)))

    def better_starts(
        self, starts: np.ndarray, tangents: np.ndarray, left: np.ndarray, share: float = 1.0
    ) -> np.ndarray:
        """Starts (windows, states + 2) that explain most of what is `left` (rows,) by tangents.

        `starts` are those at which the rows were taken; the first `share` of every window counts.
        Steps of numbers that change nothing are zero, and a window that cannot be evaluated keeps
        its start.
        """
        moved = starts.copy()
        for w, whole in self._windows():
            rows = whole[: math.ceil(share * len(whole))]
            size = np.linalg.norm(tangents[:, rows], axis=1) + 1e-300
            if len(rows) > len(tangents) and np.all(np.isfinite([*left[rows], *size])):
                A = (tangents[:, rows] / size[:, None]).T
                moved[w] += np.linalg.lstsq(A, left[rows], rcond=LEAST_START)[0] / size
        return moved

    def squares(self, left: np.ndarray) -> np.ndarray:
        """Sum of squares (windows,) of what is `left` (rows,); 0 where the start is not free."""
        out = np.zeros(len(self.begin))
        for w, rows in self._windows():
            out[w] = left[rows] @ left[rows]
        return out

    def mean_squares(self, left: np.ndarray) -> np.ndarray:
        """Mean square (free windows,) of what is `left` (rows,)."""
        return np.array([np.mean(left[rows] ** 2) for _, rows in self._windows() if len(rows)])

    def _windows(self) -> list[tuple[int, np.ndarray]]:
        """Windows of free starts with their rows."""
        return [(w, np.flatnonzero(self.where[0] == w)) for w in self.free]

    def bases(self, tangents: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
        """By window: its rows, and an orthonormal basis of what its start changes there.

        `tangents` (k, rows) are those of the k numbers of a start and its past.
        """
        out = []
        for _, rows in self._windows():
            if len(rows) <= len(tangents):
                continue
            size = np.linalg.norm(tangents[:, rows], axis=1)
            ways = tangents[size > 0][:, rows] / size[size > 0, None]
            left, values, _ = np.linalg.svd(ways.T, full_matrices=False)
            out.append((rows, left[:, values > 1e-9 * values[0]]))
        return out

    def rows(self, theta, data, steps=1, only=None, on=None):
        """(samples,) of one window in the unit of what is measured; traced."""
        return data[3] - self.simulated(theta, data, steps, only=only, on=on)

    def each(self, one, data, *tables):
        """`one(data, row, ...)` of all windows and rows (points, ...): (points, windows * samples).

        By a single `vmap`: two of them, one in the other, take a third longer to be traced.
        """
        points, windows = len(tables[0]), len(data[2])
        pairs = [jnp.repeat(table, windows, axis=0) for table in tables]
        data = jax.tree.map(lambda x: jnp.tile(x, (points, *[1] * (x.ndim - 1))), data)
        return jax.vmap(one)(data, *pairs).reshape(points, -1)

    def gain(self) -> float:
        """1-sigma of a row for white noise of 1-sigma 1 in what is measured."""
        return 1.0


def windows(count: int, length: int) -> np.ndarray:
    """Ends (windows,) of the fewest windows of at most `length` samples that share `count` evenly.

    A rest of a few samples would not tell its own start, and the error of that is read as misfit.
    """
    some = max(1, -(-count // length))
    return np.arange(1, some + 1) * count // some
