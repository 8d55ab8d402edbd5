"""A machine's motion from its inputs: Runge-Kutta steps of fourth order, many windows at once."""

import math
from collections.abc import Mapping

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float

from ..laws import SensorSignal
from ._base import AbstractMachine
from ._ports import PlacedLaw, Ports, delayed_inputs, resting

STABLE = 1.0  # |rate of a mode| times the step at which Runge-Kutta steps are safe and exact
MOST = 64  # steps between two samples


def vector_field(machine: AbstractMachine, placed: tuple[PlacedLaw, ...]):
    """(rate(z, u) of the state with the laws' memories as one vector, join(x), split(z))."""
    rest, unravel = ravel_pytree(resting(placed))
    size = len(rest)

    def split(z):
        return z[: len(z) - size], unravel(z[len(z) - size :])

    def rate(z, u):
        x, memory = split(z)
        ports = Ports(placed, memory)
        dx = jnp.stack([jnp.asarray(v, float) for v in machine.rate(x, u, ports)])
        return jnp.concatenate([dx, ravel_pytree(tuple(ports.rates))[0]])

    return rate, lambda x: jnp.concatenate([jnp.asarray(x, float), rest]), split


def motion(
    machine: AbstractMachine,
    placed: tuple[PlacedLaw, ...],
    start: Float[Array, " n"],
    inputs: Mapping[str, Float[Array, " f"]],
    step: float,
    parts: int,
) -> dict[str, Float[Array, " t"]]:
    """Outputs at the samples of one window, before the sensors.

    `inputs` stand at every half of the `parts` steps between samples, 2 parts (t - 1) + 1 values.
    """
    rate, join, split = vector_field(machine, placed)
    h, names = step / parts, tuple(inputs)
    fine = jnp.stack([inputs[k] for k in names], axis=1)
    blocks = jnp.stack([fine[k : k - 2 * parts or None : 2 * parts] for k in range(2 * parts)]
                       + [fine[2 * parts :: 2 * parts]], axis=1)  # fmt: skip

    def at(row):
        return dict(zip(names, row, strict=True))

    def body(z, block):
        for k in range(parts):
            a, b, c = (at(block[2 * k + j]) for j in range(3))
            k1 = rate(z, a)
            k2 = rate(z + h / 2 * k1, b)
            k3 = rate(z + h / 2 * k2, b)
            k4 = rate(z + h * k3, c)
            z = z + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        return z, z

    first = join(start)
    _, path = jax.lax.scan(body, first, blocks)
    path = jnp.concatenate([first[None], path])
    return dict(jax.vmap(lambda z, u: machine.read(split(z)[0], at(u)))(path, fine[:: 2 * parts]))


def sensed(placed: tuple[PlacedLaw, ...], time, outputs: Mapping[str, Array]) -> dict[str, Array]:
    """Outputs as the sensors show them."""
    out = dict(outputs)
    for one in placed:
        if one.port != "sensor":
            continue
        for name in outputs if one.place not in outputs else [one.place]:
            signal = SensorSignal(time, out[name][:, None])
            out[name] = out[name] + one.gate * one.law(signal, None)[:, 0]
    return out


@eqx.filter_jit
def _stiffness(machine, placed, states, inputs):
    rate, join, _ = vector_field(machine, placed)
    return jax.vmap(lambda x, u: jax.jacfwd(rate)(join(x), u))(states, inputs)


def steps_between(machine, placed, states, inputs, step: float) -> int:
    """Runge-Kutta steps between two samples: from the fastest mode at some `states` (m, n)."""
    found = np.asarray(_stiffness(machine, placed, jnp.asarray(states), inputs))
    fastest = np.max(np.abs(np.linalg.eigvals(found)), initial=0.0)
    return int(np.clip(math.ceil(step * fastest / STABLE), 1, MOST))


def between(values: np.ndarray, count: int, hold: str = "linear") -> np.ndarray:
    """A sampled input (t,) at `count` places a sample: linear, held, or band-limited."""
    if hold == "band-limited":
        from scipy.signal import resample_poly

        return resample_poly(values, count, 1)[: (len(values) - 1) * count + 1]
    place = np.arange((len(values) - 1) * count + 1) / count
    if hold == "held":
        return values[np.floor(place).astype(int)]
    return np.interp(place, np.arange(len(values)), values)


@eqx.filter_jit
def _whole(machine, placed, first, inputs, step, parts, clock):
    x0 = jnp.stack([jnp.asarray(v, float) for v in machine.start(first)])
    fine = jnp.linspace(0.0, clock[-1], 2 * parts * (len(clock) - 1) + 1)
    late = delayed_inputs(placed, fine, inputs)
    return sensed(placed, clock, motion(machine, placed, x0, late, step, parts))


def free_run(
    machine: AbstractMachine,
    placed: tuple[PlacedLaw, ...],
    first: Mapping[str, tuple],
    inputs: Mapping[str, np.ndarray],
    step: float,
    hold: str = "linear",
) -> dict[str, np.ndarray]:
    """Outputs (t,) from the inputs (t,) alone, from the state `first` (value, rate by output)."""
    n = len(next(iter(inputs.values())))
    some = np.linspace(0, n - 1, min(n, 20)).astype(int)
    x0 = np.array([float(v) for v in machine.start(first)])
    here = {k: x[some] for k, x in inputs.items()}
    parts = steps_between(machine, placed, np.tile(x0, (len(some), 1)), here, step)
    parts = 1 << (parts - 1).bit_length()  # few programs
    fine = {k: jnp.asarray(between(np.asarray(x), 2 * parts, hold)) for k, x in inputs.items()}
    first = {k: tuple(jnp.asarray(v, float) for v in pair) for k, pair in first.items()}
    out = _whole(machine, placed, first, fine, step, parts, jnp.arange(n) * step)
    return {k: np.asarray(v) for k, v in out.items()}
