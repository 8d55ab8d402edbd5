"""How far the free run of an axis under a log's inputs is from what was measured."""

from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np

from ..._arrays import largest
from ..._errors import InputError
from ...machine import (
    Log,
    MachineFile,
    between,
    delayed_inputs,
    motion,
    places_of,
    sensed,
    slopes_of,
    steps_between,
)
from .numbers import VariedNumbers

MISFITS = ("rms", "mae", "peak")  # of measured less simulated
LANES = 32  # designs side by side


def checked_misfits(metric: str | Sequence[str]) -> tuple[str, ...]:
    """Names of `MISFITS`, with commas between; `InputError` for another one."""
    names = [m.strip() for m in metric.split(",")] if isinstance(metric, str) else list(metric)
    wrong = [m for m in names if m not in MISFITS]
    if wrong or not names:
        raise InputError(
            f"`metric` of an axis must be among {', '.join(MISFITS)} (of measured less "
            f"simulated), but is {(wrong or ['nothing'])[0]!r}."
        )
    return tuple(dict.fromkeys(names))


class Misfit:
    """Figures of measured less simulated output over some numbers of a machine file."""

    def __init__(self, file: MachineFile, log: Log, paths: Sequence[str], metrics: Sequence[str]):
        self.numbers, self.log, self.metrics = VariedNumbers.of(file), log, tuple(metrics)
        self.paths, self.hold = self.numbers.checked(paths), file.compare.hold
        q, n = log.outputs["position"], len(log.time)
        self.parts = places_of(self.hold)
        fine = {k: jnp.asarray(between(np.asarray(x), self.hold)) for k, x in log.inputs.items()}
        clock = jnp.arange(n) * log.step
        start = {k: tuple(map(jnp.asarray, pair)) for k, pair in log.start.items()}
        some = np.linspace(0, n - 1, min(n, 20)).astype(int)
        few = {k: jnp.asarray(x[some]) for k, x in log.inputs.items()}
        there = (jnp.asarray(q[some]), jnp.zeros(len(some)))

        def state(machine, first):
            return jnp.stack([jnp.asarray(x, float) for x in machine.start(first)])

        def slopes(values):
            machine, placed = self.numbers.at(self.paths, values)
            states = jax.vmap(lambda *x: state(machine, {"position": x}))(*there)
            return slopes_of(machine, placed, states, few)

        def figures(values, steps):
            machine, placed = self.numbers.at(self.paths, values)
            times = jnp.linspace(0.0, clock[-1], self.parts * (n - 1) + 1)
            late = delayed_inputs(placed, times, fine)
            out = motion(machine, placed, state(machine, start), late, log.step, steps,
                         self.parts, self.hold)  # fmt: skip
            error = jnp.asarray(log.shown) - sensed(placed, clock, out)[log.measured]
            size = {"rms": jnp.sqrt(jnp.mean(error**2)), "mae": jnp.mean(jnp.abs(error)),
                    "peak": largest(jnp.abs(error))}  # fmt: skip
            return jnp.stack([size[m] for m in self.metrics])

        self._slopes = jax.jit(jax.vmap(slopes))
        self._figures = jax.jit(jax.vmap(figures, in_axes=(0, None)))
        self._derivatives = jax.jit(jax.jacfwd(figures))

    @property
    def unit(self) -> str:
        """Unit of every metric."""
        return self.numbers.file.machine.outputs[self.log.measured]

    def steps(self, values: np.ndarray) -> int:
        """Runge-Kutta steps between two samples that all of some designs (m, d) can do with."""
        slopes = np.asarray(self._slopes(jnp.asarray(values, float)))
        step = self.log.step / self.parts
        return max(steps_between(s, step) for s in slopes)

    def at(self, values: np.ndarray) -> np.ndarray:
        """Figures (m, metrics) of designs (m, d); NaN or inf where a run leaves all bounds."""
        out = []
        for begin in range(0, len(values), LANES):
            part = values[begin : begin + LANES]
            filled = np.concatenate([part, np.repeat(part[-1:], LANES - len(part), 0)])
            figures = self._figures(jnp.asarray(filled, float), self.steps(filled))
            out.append(np.asarray(figures)[: len(part)])
        return np.concatenate(out)

    def slopes(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Figures (metrics,) of one design (d,) and their derivatives (metrics, d)."""
        steps = self.steps(values[None])
        (figures,) = self.at(values[None])
        return figures, np.asarray(self._derivatives(jnp.asarray(values, float), steps))
