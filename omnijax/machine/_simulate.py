"""A machine's motion from its inputs: Runge-Kutta steps of fourth order, many windows at once."""

import math
from collections.abc import Mapping
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..laws import SensorSignal
from ._base import AbstractMachine
from ._field import field_of_numbers, vector_field
from ._file import MachineFile
from ._log import Log
from ._ports import PlacedLaw, delayed_inputs, resting

STABLE = 2.2  # decay of a mode within a Runge-Kutta step that is surely stable
EXACT = 0.3  # rad of a mode within a step: its frequency is right to 1e-4
MOST = 256  # steps between two samples of a free run
STAGES = np.array([0.0, 0.5, 0.5, 1.0]), np.array([1.0, 2.0, 2.0, 1.0])  # ahead, weight
OVERSAMPLED = 4  # places a sample of a band-limited input


def motion(
    machine: AbstractMachine,
    placed: tuple[PlacedLaw, ...],
    start: Float[Array, " n"],
    inputs: Mapping[str, Float[Array, " f"]],
    step: Any,
    steps: Any,
    parts: int,
    hold: str = "linear",
    memory: tuple[Any, ...] | None = None,
) -> dict[str, Float[Array, " t"]]:
    """Outputs at the samples of one window, before the sensors; the laws' memories begin at rest.

    `inputs` stand at `parts` places a sample, f = parts (t - 1) + 1, linear between them, or held
    at their first value; `steps`, which may be traced, Runge-Kutta steps lead from one to the next.
    """
    rate, join = field_of_numbers(machine, placed)
    h, names = step / parts / steps, tuple(inputs)
    fine = tuple(inputs[k] for k in names)
    left = tuple(u[:-1] for u in fine)
    right = left if hold == "held" else tuple(u[1:] for u in fine)

    def at(values):
        return dict(zip(names, values, strict=True))

    def moved(z, h, slope):
        return tuple(x + h * dx for x, dx in zip(z, slope, strict=True))

    def body(z, ends):
        begin, end = ends

        def given(ahead):
            return at([a + ahead / steps * (b - a) for a, b in zip(begin, end, strict=True)])

        def forth(k, z):
            def stage(carry, pair):  # one body for four stages: a quarter of the program
                slope, total = carry
                ahead, weight = pair
                slope = rate(moved(z, ahead * h, slope), given(k + ahead))
                return (slope, moved(total, weight, slope)), None

            zero = tuple(jnp.zeros_like(x) for x in z)
            (_, total), _ = jax.lax.scan(stage, (zero, zero), STAGES)
            return moved(z, h / 6, total)

        z = jax.lax.fori_loop(0, steps, forth, z)
        return z, z[:-1]

    *x0, rest = join(start, resting(placed) if memory is None else memory)
    _, path = jax.lax.scan(body, (*x0, rest), (left, right))
    path = [jnp.append(x, p[parts - 1 :: parts]) for x, p in zip(x0, path, strict=True)]
    sampled = tuple(u[::parts] for u in fine)
    return dict(jax.vmap(lambda x, u: machine.read(x, at(u)))(jnp.stack(path, 1), sampled))


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


def slopes_of(machine, placed, states, inputs) -> Float[Array, "m n n"]:
    """Slopes of the rate at some `states` (m, n) under `inputs` (m,): what steps must follow."""
    rate, join, _ = vector_field(machine, placed)
    return jax.vmap(lambda x, u: jax.jacfwd(rate)(join(x), u))(states, inputs)


_slopes = eqx.filter_jit(slopes_of)


def steps_for(slopes: np.ndarray, step: float) -> int:
    """Runge-Kutta steps within `step` s that follow every mode of `slopes` (m, n, n)."""
    if not np.all(np.abs(slopes) < 1e100):
        return 10**9
    modes = step * np.linalg.eigvals(slopes)
    need = max(np.max(np.abs(modes.real), initial=0.0) / STABLE,
               np.max(np.abs(modes.imag), initial=0.0) / EXACT)  # fmt: skip
    return int(np.clip(math.ceil(need), 1, 10**9))


def places_of(hold: str) -> int:
    """Places a sample at which an input is given, to be linear between them."""
    return OVERSAMPLED if hold == "band-limited" else 1


def between(values: np.ndarray, hold: str = "linear") -> np.ndarray:
    """A sampled input (t,) at `places_of(hold)` places a sample."""
    count = places_of(hold)
    if count == 1:
        return values
    from scipy.signal import resample_poly

    return resample_poly(values, count, 1)[: (len(values) - 1) * count + 1]


def steps_between(slopes: np.ndarray, step: float) -> int:
    """`steps_for`, no more than a free run takes between two places of its inputs."""
    return min(MOST, steps_for(slopes, step))


@eqx.filter_jit
def _whole(machine, placed, first, inputs, step, steps, clock, hold):
    x0, parts = jnp.stack([jnp.asarray(v, float) for v in machine.start(first)]), places_of(hold)
    fine = jnp.linspace(0.0, clock[-1], parts * (len(clock) - 1) + 1)
    late = delayed_inputs(placed, fine, inputs)
    return sensed(placed, clock, motion(machine, placed, x0, late, step, steps, parts, hold))


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
    here = {k: jnp.asarray(x[some]) for k, x in inputs.items()}
    states = jnp.asarray(np.concatenate([[x0], np.zeros((len(some) - 1, len(x0)))]))
    slopes = np.asarray(_slopes(machine, placed, states, here))
    steps = steps_between(slopes, step / places_of(hold))
    fine = {k: jnp.asarray(between(np.asarray(x), hold)) for k, x in inputs.items()}
    first = {k: tuple(jnp.asarray(v, float) for v in pair) for k, pair in first.items()}
    out = _whole(machine, placed, first, fine, step, steps, jnp.arange(n) * step, hold)
    return {k: np.asarray(v) for k, v in out.items()}


def free_run_of(file: MachineFile, log: Log) -> dict[str, np.ndarray]:
    """Outputs (t,) of a file's machine under the inputs of a log, from the log's first sample."""
    return free_run(file.machine, file.placed, log.start, log.inputs, log.step, file.compare.hold)
