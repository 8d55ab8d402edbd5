"""A machine's motion from its inputs: Runge-Kutta steps of fourth order, many windows at once."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._errors import RunError
from ..laws import SensorSignal
from ._base import AbstractMachine
from ._field import field_of_numbers, settled_memory
from ._file import MachineFile
from ._log import Log
from ._ports import PlacedLaw, delayed_inputs
from ._steps import (
    SURELY,
    Tried,
    most_steps,
    settled,
    slopes_of,
    steepest_slopes,
    steps_for,
)

STAGES = np.array([0.0, 0.5, 0.5, 1.0]), np.array([1.0, 2.0, 2.0, 1.0])  # ahead, weight
OVERSAMPLED = 4  # places a sample of a band-limited input


def states_along(
    machine: AbstractMachine,
    placed: tuple[PlacedLaw, ...],
    start: Float[Array, " n"],
    inputs: Mapping[str, Float[Array, " f"]],
    step: Any,
    steps: Any,
    parts: int,
    hold: str = "linear",
    memory: tuple[Any, ...] | None = None,
) -> Float[Array, "t n"]:
    """States at the samples of one window; the laws' memories begin settled, or at `memory`.

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

    if memory is None:
        memory = settled_memory(machine, placed, start, {k: x[0] for k, x in inputs.items()})
    *x0, rest = join(start, memory)
    _, path = jax.lax.scan(body, (*x0, rest), (left, right))
    path = [jnp.append(x, p[parts - 1 :: parts]) for x, p in zip(x0, path, strict=True)]
    return jnp.stack(path, 1)


def outputs_along(
    machine: AbstractMachine, states: Float[Array, "t n"], inputs: Mapping[str, Any], parts: int
) -> dict[str, Float[Array, " t"]]:
    """Outputs (t,) at the samples, before the sensors, of `states_along` the same `inputs`."""
    sampled = {k: u[::parts] for k, u in inputs.items()}
    return dict(jax.vmap(machine.read)(states, sampled))


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


class FreeMotion(NamedTuple):
    """A free run: outputs and states at its samples, and the steepest slopes that it met."""

    outputs: Any  # as the sensors show them (t,) by name
    states: Any  # (t, n)
    slopes: Any  # (k, n, n)
    steep: Any  # (k,), the samples of these slopes
    finite: Any  # whether all states are

    def tried(self, step: float, time: float, made: Any) -> Tried:
        """What these steps gave, as `settled` asks it; `step` s between two places of `time` s."""
        return Tried(made, steps_for(np.asarray(self.slopes), step, time), bool(self.finite))


def start_state(machine: AbstractMachine, first: Mapping[str, tuple]) -> Float[Array, " n"]:
    """The state at which the outputs have the values and rates `first`."""
    return jnp.stack([jnp.asarray(v, float) for v in machine.start(first)])


def begun(machine, first, inputs, parts: int) -> tuple[Array, dict[str, Array]]:
    """States (m, n) where a run begins, and at rest at 0, with some of its inputs (m,)."""
    x0 = start_state(machine, first)
    n = len(next(iter(inputs.values()))) // parts
    some = parts * np.linspace(0, n - 1, min(n, 20)).astype(int)
    states = jnp.concatenate([x0[None], jnp.zeros((len(some) - 1, len(x0)))])
    return states, {k: x[some] for k, x in inputs.items()}


def slopes_at_start(machine, placed, first, inputs, parts: int) -> Float[Array, "m n n"]:
    """Slopes where a run begins, and at rest at 0, under some of its inputs."""
    return slopes_of(machine, placed, *begun(machine, first, inputs, parts))


def free_motion(machine, placed, first, inputs, step, steps, clock, hold: str) -> FreeMotion:
    """A free run with some Runge-Kutta steps between two places of its inputs; traced."""
    parts = places_of(hold)
    fine = jnp.linspace(0.0, clock[-1], parts * (len(clock) - 1) + 1)
    late = delayed_inputs(placed, fine, inputs)
    x0 = start_state(machine, first)
    states = states_along(machine, placed, x0, late, step, steps, parts, hold)
    outputs = sensed(placed, clock, outputs_along(machine, states, late, parts))
    sampled = {k: x[::parts] for k, x in late.items()}
    slopes, steep, finite = steepest_slopes(machine, placed, states, sampled)
    return FreeMotion(outputs, states, slopes, steep, finite)


_free_motion, _slopes_at_start = eqx.filter_jit(free_motion), eqx.filter_jit(slopes_at_start)


def free_motion_of(
    machine: AbstractMachine,
    placed: tuple[PlacedLaw, ...],
    first: Mapping[str, tuple],
    inputs: Mapping[str, np.ndarray],
    step: float,
    hold: str = "linear",
) -> FreeMotion:
    """The motion of `free_run`.  Raises `RunError` where no possible steps follow it."""
    n, parts = len(next(iter(inputs.values()))), places_of(hold)
    fine = {k: jnp.asarray(between(np.asarray(x), hold)) for k, x in inputs.items()}
    first = {k: tuple(jnp.asarray(v, float) for v in pair) for k, pair in first.items()}
    clock, most = jnp.arange(n) * step, most_steps(n * parts)
    last = [begun(machine, first, fine, parts)]

    def run(_, steps):
        made = _free_motion(machine, placed, first, fine, step, int(steps[0]), clock, hold)
        last[0] = made.states[made.steep], {k: x[::parts][made.steep] for k, x in fine.items()}
        return [made.tried(step / parts, n * step, made)]

    slopes = np.asarray(_slopes_at_start(machine, placed, first, fine, parts))
    (made,), _ = settled(run, [steps_for(slopes, step / parts, n * step)], most)
    if made is None:
        raise RunError(too_stiff(machine, placed, *last[0], step / parts, most))
    return made


def too_stiff(machine, placed, states, inputs, step: float, most: int) -> str:
    """A sentence on a free run that no possible steps follow, and on what makes it so steep."""

    def needs(laws) -> float:
        slopes = np.asarray(slopes_of(machine, laws, states, inputs))
        slopes = slopes[np.all(np.abs(slopes) < SURELY, axis=(1, 2))]
        return float(np.max(np.abs(np.linalg.eigvals(slopes)), initial=0.0))

    fastest = needs(placed)
    rest = {one.law.id: needs(tuple(p for p in placed if p is not one)) for one in placed}
    by = min(rest, key=rest.__getitem__, default=None)
    cause = f"the effect `{by}`" if by and rest[by] < fastest / 2 else "the machine's own numbers"
    return (f"the free run of this machine cannot be followed: {cause} make its fastest mode "
            f"{fastest:.3g} 1/s, which needs more than {most} Runge-Kutta steps in "
            f"{1e3 * step:.3g} ms.")  # fmt: skip


def free_run(
    machine: AbstractMachine,
    placed: tuple[PlacedLaw, ...],
    first: Mapping[str, tuple],
    inputs: Mapping[str, np.ndarray],
    step: float,
    hold: str = "linear",
) -> dict[str, np.ndarray]:
    """Outputs (t,) from the inputs (t,) alone, from the state `first` (value, rate by output).

    Not finite where the motion leaves all bounds; `RunError` where no possible steps follow it.
    """
    made = free_motion_of(machine, placed, first, inputs, step, hold)
    return {k: np.asarray(v) for k, v in made.outputs.items()}


def free_run_of(file: MachineFile, log: Log) -> dict[str, np.ndarray]:
    """Outputs (t,) of a file's machine under the inputs of a log, from the log's first sample.

    `RunError` where they leave all bounds.
    """
    out = free_run(file.machine, file.placed, log.start, log.inputs, log.step, file.compare.hold)
    fine = np.all([np.isfinite(x) for x in out.values()], axis=0)
    if not fine.all():
        raise RunError(f"the free run of this machine leaves all bounds at "
                       f"{log.time[np.argmin(fine)]:.4g} s.")  # fmt: skip
    return out
