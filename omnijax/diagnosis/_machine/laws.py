"""Laws evaluated over long arrays: one compiled call a law class."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from ...dynamics import rest_memory, sensor_readings
from ...laws import AbstractSensor, SensorSignal
from ...rig import Rig
from .clocks import LATE_LAWS, LoggerClock, read_late


@eqx.filter_jit
def _over(law, signal):
    return jax.vmap(law)(signal)


def along(law, signal: Any) -> Any:
    """`law` at every entry of `signal` (leading axis), as NumPy arrays.

    A number in the signal holds for all entries.
    """
    length = max(len(x) for x in jax.tree.leaves(signal) if np.ndim(x))
    signal = jax.tree.map(lambda x: x if np.ndim(x) else np.full(length, x), signal)
    return jax.tree.map(np.asarray, _over(law, signal))


@eqx.filter_jit
def sensed(law, signal: SensorSignal):
    """What a sensor's law adds to the values (t, c) of its signal."""
    return law(signal)


def _read(law, signal: SensorSignal):
    return read_late(law, signal) if isinstance(law, LoggerClock) else sensed(law, signal)


def on_time(law, signal: SensorSignal):
    """What a sensor's law adds to values of dR or a that are as late as `offset_of` says."""
    return 0.0 if isinstance(law, LATE_LAWS) else sensed(law, signal)


def remembers(rig: Rig, group: str) -> bool:
    """Whether a sensor of the group shows what was before, other than by `offset_of`."""
    own = [p.law for p in rig.at("sensor") if p.group == group]
    return any(
        isinstance(law, AbstractSensor) and law.remembers and not isinstance(law, LATE_LAWS)
        for law in own
    )


def readings(rig: Rig, group: str, time: np.ndarray, values: np.ndarray, apply=_read) -> np.ndarray:
    """What the rig's sensors of one output group show of its `values` (t, c)."""
    shown = sensor_readings(rig, group, time, values, apply)  # pyright: ignore[reportArgumentType]
    return np.asarray(shown)


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
