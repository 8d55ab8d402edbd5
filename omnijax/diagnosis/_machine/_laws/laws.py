"""Laws evaluated over long arrays: one compiled call a law class."""

import math
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from scipy.interpolate import CubicSpline

from ...._programs import kept
from ....dynamics import rest_memory, sensor_readings
from ....laws import AbstractSensor, SensorSignal
from ....rig import Rig
from ....simulation import SENSOR_POINTS
from ..._settings import SETTINGS
from ..clocks import LoggerClock, offset_of, only_delays, read_late
from ..runs import Run


@kept
def _over(law, signal):
    return jax.vmap(law)(signal)


def along(law, signal: Any, run: Run | None = None) -> Any:
    """`law` at every entry of `signal` (leading axis), as NumPy arrays.

    A number in the signal holds for all entries.  Along a `run` programs are those of the longest.
    """
    length = max(len(x) for x in jax.tree.leaves(signal) if np.ndim(x))
    signal = jax.tree.map(lambda x: x if np.ndim(x) else np.full(length, x), signal)
    if run is not None:
        signal = jax.tree.map(run.as_longest, signal)
    out = _over(law, signal)
    return jax.tree.map(lambda x: np.asarray(x)[:length], out)


@kept
def sensed(law, signal: SensorSignal):
    """What a sensor's law adds to the values (t, c) of its signal."""
    return law(signal)


def _read(law, signal: SensorSignal):
    if type(law) is LoggerClock:
        return read_late(law, signal)
    return np.asarray(sensed(law, signal))


def on_time(rig: Rig, group: str) -> Callable[[Any, SensorSignal], Any]:
    """What calls the laws of a group, once each in their order, on values that are late already.

    By as much as `offset_of` says; a law before a delay, such as a drift, acted by so much earlier.
    """
    ahead = offset_of(rig, group)

    def apply(law, signal: SensorSignal):
        nonlocal ahead
        if only_delays(law):
            ahead -= float(law.delay)
            return 0.0
        if ahead and not (isinstance(law, AbstractSensor) and law.remembers):
            first = min(float(signal.time[0]), 0.0)  # as at the run's first sample before it
            signal = signal._replace(time=np.maximum(signal.time - ahead, first))
        return np.asarray(sensed(law, signal))

    return apply


def remembers(rig: Rig, group: str) -> bool:
    """Whether a sensor of the group shows what was before, other than by `offset_of`."""
    own = [p.law for p in rig.at("sensor") if p.group == group]
    return any(
        isinstance(law, AbstractSensor) and law.remembers and not only_delays(law) for law in own
    )


def readings(rig: Rig, group: str, time: np.ndarray, values: np.ndarray, apply=_read) -> np.ndarray:
    """What the rig's sensors of one output group show of its `values` (t, c)."""
    shown = sensor_readings(rig, group, time, values, apply)  # pyright: ignore[reportArgumentType]
    return np.asarray(shown)


LONGEST_DELAY = SETTINGS.candidates.longest_delay
OPENING_SAMPLES = SETTINGS.prediction.opening_samples
OPENING_DEGREE = SETTINGS.prediction.opening_degree


def moving_readings(
    rig: Rig, group: str, time: np.ndarray, values: np.ndarray, rolls: bool, apply=_read
) -> np.ndarray:
    """`readings` of Omega or theta, in a run that `rolls` already at its first sample or does not.

    If it does, the motion before is a polynomial through the first samples: at rest there, a sensor
    that remembers would jump by all that it turns within its delay.
    """
    laws = (p.law for p in rig.at("sensor") if p.group == group)
    if not any(isinstance(law, AbstractSensor) and law.remembers for law in laws):
        return readings(rig, group, time, values, apply)
    past = np.zeros(0)
    if rolls:
        opening, step = slice(0, OPENING_SAMPLES), float(time[1] - time[0])
        past = step * np.arange(-math.ceil(LONGEST_DELAY / step), 0)
        course = np.polynomial.polynomial.polyfit(time[opening], values[opening], OPENING_DEGREE)
        before = np.polynomial.polynomial.polyval(past, course).T
        time, values = np.concatenate([time[0] + past, time]), np.concatenate([before, values])
    if remembers(rig, group):  # sees corners of other sensors' laws between the samples
        fine = np.linspace(time[0], time[-1], SENSOR_POINTS * (len(time) - 1) + 1)
        shown = readings(rig, group, fine, CubicSpline(time, values)(fine), apply)
        return shown[::SENSOR_POINTS][len(past) :]
    return readings(rig, group, time, values, apply)[len(past) :]


def follow(rule, moments: Any, memory: Any, step):
    """Outputs (t, ...) of a law with memory along `moments`: Heun's steps from its rest.

    `rule(moment, memory)` gives the output and the memory's rate; steps take `step` s.
    """
    first = jax.tree.map(lambda x: x[0], moments)
    state = rest_memory(lambda z: rule(first, z)[1], memory)

    def body(state, pair):
        now, then = pair
        rate = rule(now, state)[1]
        guess = jax.tree.map(lambda z, r: z + step * r, state, rate)
        after = rule(then, guess)[1]
        state = jax.tree.map(lambda z, r, q: z + step / 2 * (r + q), state, rate, after)
        return state, rule(then, state)[0]

    pairs = (jax.tree.map(lambda x: x[:-1], moments), jax.tree.map(lambda x: x[1:], moments))
    _, out = jax.lax.scan(body, state, pairs)
    start = rule(first, state)[0]
    return jax.tree.map(lambda a, b: jnp.concatenate([a[None], b]), start, out)
