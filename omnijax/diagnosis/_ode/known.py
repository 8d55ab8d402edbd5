"""What a balance knows of states that nobody measures: behind a sensor or a drive, in it."""

from collections.abc import Mapping, Sequence

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...laws import ActuatorLag, ActuatorSignal, low_passed
from ...machine import AbstractMachine, Axis, PlacedLaw, Ports, sensed
from .._settings import SETTINGS

FINE = SETTINGS.free_known.fine
ROUNDS = SETTINGS.free_known.rounds


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
    """Position and speed of the second inertia, `FINE` Runge-Kutta steps a sample."""
    none, first = Ports((), ()), {"input": jnp.zeros(()), "gain": jnp.ones(()), "enable": 1.0}

    def rate(z, at):
        return jnp.stack(axis.rate(jnp.concatenate([at, z]), first, none)[2:])

    def after(z, ends):
        a, change = ends[0], (ends[1] - ends[0]) / FINE
        h = step / FINE
        for k in range(FINE):
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
    machine: AbstractMachine, placed: Sequence[PlacedLaw], time: Float[Array, " t"], q, v,
    inputs: Mapping[str, Array],
) -> Float[Array, "t m"]:  # fmt: skip
    """The laws' memories at every sample: a slow drive's torque from the commanded one, else rest.

    Actuators follow one after the other, each on what the former delivers.
    """
    torque = machine.motor(q, v, inputs) if isinstance(machine, Axis) else jnp.zeros_like(q)
    out = []
    for one in placed:
        state, rest = None, one.law.initial()
        if rest is not None:
            state = jnp.broadcast_to(rest, (len(q), *jnp.shape(rest)))
        if isinstance(one.law, ActuatorLag):
            state = low_passed(time, torque[:, None], one.law.tau)[:, 0]
        if one.port == "actuator":
            torque = torque + one.gate * one.law(ActuatorSignal(torque, q, v), state)
        if state is not None:
            out.append(state.reshape(len(q), -1))
    return jnp.concatenate(out, axis=1) if out else jnp.zeros((len(q), 0))
