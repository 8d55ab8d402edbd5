"""How far the free run of an axis under a log's inputs is from what was measured."""

from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from ..._arrays import largest
from ..._errors import InputError
from ..._text import split_names
from ...machine import (
    FreeMotion,
    Log,
    MachineFile,
    between,
    free_motion,
    most_steps,
    places_of,
    settled,
    slopes_at_start,
    steps_for,
)
from .numbers import VariedNumbers

MISFITS = ("rms", "mae", "peak")  # of measured less simulated
LANES = 32  # designs side by side


def checked_misfits(metric: str | Sequence[str]) -> tuple[str, ...]:
    """Names of `MISFITS`, with commas between; `InputError` for another one."""
    names = split_names(metric)
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
        n, self.parts = len(log.time), places_of(self.hold)
        self.most = most_steps(n * self.parts)
        fine = {k: jnp.asarray(between(np.asarray(x), self.hold)) for k, x in log.inputs.items()}
        clock = jnp.arange(n) * log.step
        start = {k: tuple(map(jnp.asarray, pair)) for k, pair in log.start.items()}

        def slopes(values):
            machine, placed = self.numbers.at(self.paths, values)
            return slopes_at_start(machine, placed, start, fine, self.parts)

        def figures(values, steps):
            machine, placed = self.numbers.at(self.paths, values)
            made = free_motion(machine, placed, start, fine, log.step, steps, clock, self.hold)
            error = jnp.asarray(log.shown) - made.outputs[log.measured]
            size = {"rms": jnp.sqrt(jnp.mean(error**2)), "mae": jnp.mean(jnp.abs(error)),
                    "peak": largest(jnp.abs(error))}  # fmt: skip
            return jnp.stack([size[m] for m in self.metrics]), made._replace(outputs=(), states=())

        self._slopes = jax.jit(jax.vmap(slopes))
        self._figures = jax.jit(jax.vmap(figures, in_axes=(0, None)))
        self._derivatives = jax.jit(jax.jacfwd(lambda *x: figures(*x)[0]))

    @property
    def unit(self) -> str:
        """Unit of every metric."""
        return self.numbers.file.machine.outputs[self.log.measured]

    def at(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Figures (m, metrics) of designs (m, d), and the Runge-Kutta steps (m,) of each.

        NaN or inf where a run leaves all bounds; NaN where `most` steps are too few for it.
        """
        values, step = np.asarray(values, float), self.log.step / self.parts
        time = len(self.log.time) * self.log.step
        begun = [
            steps_for(s, step, time)
            for part, count in _chunks(values) for s in np.asarray(self._slopes(part))[:count]
        ]  # fmt: skip

        def run(which, steps):
            order, out = np.argsort(steps, kind="stable"), {}
            for here in np.split(order, range(LANES, len(order), LANES)):
                ((part, count),) = _chunks(values[which[here]])
                figures, made = jax.tree.map(np.asarray, self._figures(part, int(steps[here[-1]])))
                for k in range(count):
                    one = FreeMotion(*jax.tree.map(lambda x, k=k: x[k], made))
                    out[here[k]] = one.tried(step, time, figures[k])
            return [out[k] for k in range(len(which))]

        made, steps = settled(run, begun, self.most)
        lost = np.full(len(self.metrics), np.nan)
        return np.stack([lost if x is None else x for x in made]), steps

    def slopes(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Figures (metrics,) of one design (d,) and their derivatives (metrics, d)."""
        (figures,), (steps,) = self.at(values[None])
        if steps > self.most:
            return figures, np.full((len(self.metrics), len(values)), np.nan)
        return figures, np.asarray(self._derivatives(jnp.asarray(values, float), steps))


def _chunks(values: np.ndarray) -> list[tuple[Array, int]]:
    """Designs (m, d) as tables of `LANES` of them, the last one filled up, and how many count."""
    parts = [values[k : k + LANES] for k in range(0, len(values), LANES)]
    return [
        (jnp.asarray(np.concatenate([p, np.repeat(p[-1:], LANES - len(p), 0)])), len(p))
        for p in parts
    ]
