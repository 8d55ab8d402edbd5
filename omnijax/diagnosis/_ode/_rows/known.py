"""What a balance knows of states that nobody measures: behind a sensor or a drive, in it."""

import math
from collections.abc import Mapping, Sequence

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ....laws import ActuatorLag, ActuatorSignal, low_passed
from ....machine import (
    AbstractMachine,
    Axis,
    PlacedLaw,
    Ports,
    field_of_numbers,
    sensed,
    settled_memory,
)
from ..._settings import SETTINGS

STEPS = SETTINGS.free_known.steps
ROUNDS = SETTINGS.free_known.rounds
GAMMA = 1 - 1 / math.sqrt(2)  # of Rosenbrock's method: stable for rates of any size


def before_sensors(
    placed: Sequence[PlacedLaw], time: Float[Array, " t"], motion: Sequence[Float[Array, " t"]]
) -> tuple[Array, ...]:
    """Position, speed and acceleration (t,) that the laws of the sensors made of the measured."""
    if not any(one.port == "sensor" for one in placed):
        return tuple(motion)
    q, v, a = motion
    step, added = time[1] - time[0], jnp.zeros_like(q)
    for _ in range(ROUNDS):
        true = q - added
        added = sensed(tuple(placed), time, {"position": true})["position"] - true
    rate = rate_of(added, step)
    return q - added, v - rate, a - rate_of(rate, step)


def rate_of(x, step):
    """Time derivative (t,): central differences, of fourth order inside; NumPy's or traced."""
    xp = jnp if isinstance(x, jax.Array) else np
    fine = (8 * (x[3:-1] - x[1:-3]) - (x[4:] - x[:-4])) / (12 * step)
    coarse = xp.gradient(x) / step
    return xp.concatenate([coarse[:2], fine, coarse[-2:]])


def states(machine: AbstractMachine, q, v, step) -> Float[Array, "t n"]:
    """State at every sample of a machine whose position was measured.

    The second inertia of an axis is what the measured motion of the first makes of it.
    """
    if isinstance(machine, Axis) and machine.second_inertia is not None:
        return jnp.concatenate([jnp.stack([q, v], axis=1), _dragged(machine, q, v, step)], axis=1)
    start = jax.vmap(lambda q, v: machine.start({"position": (q, v)}))(q, v)
    return jnp.stack([jnp.asarray(x, float) for x in start], axis=1)


def _dragged(axis: Axis, q, v, step) -> Float[Array, "t 2"]:
    """Position and speed of the second inertia, `STEPS` Runge-Kutta steps a sample."""
    none, first = Ports((), ()), {"input": jnp.zeros(()), "gain": jnp.ones(()), "enable": 1.0}

    def rate(z, at):
        return jnp.stack(axis.rate(jnp.concatenate([at, z]), first, none)[2:])

    def after(z, ends):
        a, change = ends[0], (ends[1] - ends[0]) / STEPS
        h = step / STEPS
        for k in range(STEPS):
            begin, middle, end = a + k * change, a + (k + 0.5) * change, a + (k + 1) * change
            k1 = rate(z, begin)
            k2 = rate(z + h / 2 * k1, middle)
            k3 = rate(z + h / 2 * k2, middle)
            z = z + h / 6 * (k1 + 2 * k2 + 2 * k3 + rate(z + h * k3, end))
        return z, z

    measured = jnp.stack([q, v], axis=1)
    _, path = jax.lax.scan(after, measured[0], (measured[:-1], measured[1:]))
    return jnp.concatenate([measured[:1], path])


def memories(
    machine: AbstractMachine, placed: Sequence[PlacedLaw], time: Float[Array, " t"],
    x: Float[Array, "t n"], inputs: Mapping[str, Array],
) -> Float[Array, "t m"]:  # fmt: skip
    """The laws' memories at every sample, along the states `x` (t, n) and inputs (t,) by name.

    In closed form if slow drives (actuator lags) are the only laws with memory.
    """
    remembering = [one.law for one in placed if one.law.has_memory()]
    if not remembering:
        return jnp.zeros((len(x), 0))
    if isinstance(machine, Axis) and all(type(law) is ActuatorLag for law in remembering):
        return _lagging(machine, placed, time, x, inputs)
    return _followed(machine, tuple(placed), time, x, inputs)


def _lagging(axis: Axis, placed, time, x, inputs) -> Float[Array, "t m"]:
    """Torques (t, lags) that slow drives deliver, each from the torque of the actuators before."""
    q, v = x[:, 0], x[:, 1]
    torque, out = axis.motor(q, v, inputs), []
    for one in placed:
        if one.port != "actuator":
            continue
        state = None
        if one.law.has_memory():
            state = low_passed(time, torque[:, None], one.law.tau)[:, 0]
            out.append(state)
        torque = torque + one.gate * one.law(ActuatorSignal(torque, q, v), state)
    return jnp.stack(out, axis=1)


def _followed(machine, placed, time, x, inputs) -> Float[Array, "t m"]:
    """Memories (t, m) of any laws: `STEPS` steps of Rosenbrock's second-order method a sample.

    It is stable however fast a law forgets (Verwer's coefficient).
    """
    names, (field, join) = tuple(inputs), field_of_numbers(machine, placed)
    h = (time[1] - time[0]) / STEPS

    def rate(z, at):
        state, given = at
        return field((*state, z), dict(zip(names, given, strict=True)))[-1]

    def after(z, ends):
        begin, end = ends
        change = jax.tree.map(lambda a, b: (b - a) / STEPS, begin, end)
        for k in range(STEPS):
            here, then = (
                jax.tree.map(lambda a, d, k=j: a + k * d, begin, change) for j in (k, k + 1)
            )
            slope = jax.jacfwd(rate)(z, here)
            drift = jax.jvp(lambda at, z=z: rate(z, at), (here,), (change,))[1]
            stage = jnp.eye(len(z)) - GAMMA * h * slope
            first = jnp.linalg.solve(stage, rate(z, here) + GAMMA * drift)
            left = rate(z + h * first, then) - 2 * first - GAMMA * drift
            z = z + h / 2 * (3 * first + jnp.linalg.solve(stage, left))
        return z, z

    along = x, tuple(inputs[k] for k in names)
    begin = jax.tree.map(lambda a: a[0], along)
    memory = settled_memory(machine, placed, begin[0], dict(zip(names, begin[1], strict=True)))
    first = join(begin[0], memory)[-1]
    pairs = jax.tree.map(lambda a: a[:-1], along), jax.tree.map(lambda a: a[1:], along)
    _, path = jax.lax.scan(after, first, pairs)
    return jnp.concatenate([first[None], path])
