"""What is compiled for a machine, its laws and its runs."""

import dataclasses
from collections.abc import Callable, Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from ...._errors import RunError
from ....machine import free_motion_of, slopes_of
from ..._settings import SETTINGS
from .numbers import Numbers
from .rows import Balance, FreeRun, OdeRun, smoothed

INSTANTS = SETTINGS.free_model.instants
SLOPED_RUNS = SETTINGS.free_model.sloped_runs
VALUE, TANGENT, START = range(3)  # programs over the rows


@dataclasses.dataclass
class Programs:
    """What is compiled for models of one case, however their input is held.

    `rows` are (values, tangents, tangents along the starts) by kind of row and laws, `slopes` those
    of the rate.
    """

    rows: dict[tuple, tuple] = dataclasses.field(default_factory=dict)
    slopes: Callable | None = None

    def of(self, rows: Balance | FreeRun, only: frozenset[int] | None = None) -> tuple:
        """The programs of rows like these with the laws of the slots `only`, compiled once."""
        key = (rows.kind, only)
        if key not in self.rows:
            self.rows[key] = compiled(rows, only)
        return self.rows[key]

    def slopes_along(self, numbers: Numbers, runs: Sequence[OdeRun]) -> Callable:
        """`slopes_along` of the first of these models."""
        self.slopes = self.slopes or slopes_along(numbers, runs)
        return self.slopes


def compiled(rows: Balance | FreeRun, only: frozenset[int] | None):
    """(values, tangents, those along starts) of many points of one run, laws of the slots `only`.

    Without those, of all slots; the laws of those that are `on` (slots,) are evaluated.

    They go with the model: `equinox.filter_jit` would keep them, and all that they hold, for good;
    a process has room for some 65 000 memory maps, which a dozen of diagnoses fill.
    """

    def used(on):
        return on if only is None else None

    @jax.jit
    def value(data, steps, on, thetas):
        return rows.each(lambda d, t: rows.rows(t, d, steps, only, used(on)), data, thetas)

    @jax.jit
    def tangent(data, steps, on, thetas, ways):
        def one(d, t, w):
            return jax.jvp(lambda x: rows.rows(x, d, steps, only, used(on)), (t,), (w,))[1]

        return rows.each(one, data, thetas, ways)

    @jax.jit
    def start(data, steps, on, thetas, ways):
        def one(d, t, w):
            def moved(shift):
                assert isinstance(rows, FreeRun)  # a balance has no start
                return rows.simulated(t, d, steps, shift, only, used(on))

            return jax.jvp(moved, (jnp.zeros_like(w),), (w,))[1]

        return rows.each(one, data, thetas, ways)

    return value, tangent, start


def slopes_along(numbers: Numbers, runs: Sequence[OdeRun]) -> Callable:
    """Slopes (m, n, n) of the rate at a vector of numbers: where the runs pass, and elsewhere.

    A few instants are taken, of the first runs.  Elsewhere is at rest at the same places, where dry
    friction is steep.  Of a machine that has states beside a position and its speed they are those
    of its free runs as it is stated, and elsewhere are its own slopes there: a law that frees it
    inside a play says nothing of the play's ends.
    """
    moving, resting, hidden = [], [], len(numbers.machine.start({"position": (0.0, 0.0)})) > 2
    for run in runs[:SLOPED_RUNS]:
        measured = _measured(run, max(2, INSTANTS // len(runs[:SLOPED_RUNS])))
        passed = _met(numbers, run, measured) if hidden else _states(numbers, measured)
        still = [] if hidden else _states(numbers, [(i, q, 0.0) for i, q, _ in measured])
        for here, states in ((moving, passed), (resting, still)):
            here += [(x, {k: u[i] for k, u in run.inputs.items()}) for i, x in states]
    met = jnp.asarray(np.array([x for x, _ in moving + resting]))
    given = {k: jnp.asarray([u[k] for _, u in moving + resting]) for k in moving[0][1]}

    @jax.jit
    def slopes(theta):
        made = slopes_of(*numbers.build(theta), met, given)
        return made[: len(moving)], made[len(moving) :]

    if not hidden:
        return slopes
    rest, _ = slopes(jnp.asarray(numbers.rest_vector()))
    return lambda theta: (slopes(theta)[0], rest)


Instant = tuple[int, float, float]  # sample, position, speed


def _measured(run: OdeRun, some: int) -> list[Instant]:
    """Positions and speeds measured at some samples of a run, the first among them."""
    q, v, _ = smoothed(run.outputs["position"], run.step, run.cutoff)
    which = np.linspace(0, len(q) - 1, some).astype(int).tolist()
    return [(i, float(q[i]), float(v[i])) for i in which]


def _states(numbers: Numbers, measured: Sequence[Instant]) -> list[tuple[int, np.ndarray]]:
    """Samples with the states measured there."""
    begun = [(i, numbers.machine.start({"position": (q, v)})) for i, q, v in measured]
    return [(i, np.array([float(x) for x in state])) for i, state in begun]


def _met(
    numbers: Numbers, run: OdeRun, measured: Sequence[Instant]
) -> list[tuple[int, np.ndarray]]:
    """Samples of a run with the states of its free run there, and those that are steepest.

    Those that are measured where the free run cannot be followed.
    """
    machine, placed = numbers.build(numbers.rest_vector(), ())
    first = {"position": measured[0][1:]}
    try:
        made = free_motion_of(machine, placed, first, run.inputs, run.step, run.hold)
    except RunError:
        return _states(numbers, measured)
    states = np.asarray(made.states)
    which = [*(i for i, *_ in measured), *np.asarray(made.steep)]
    return [(i, states[i]) for i in which if np.all(np.isfinite(states[i]))]


class Chunk(NamedTuple):
    """Rows (lanes, rows) that may still be computed, of the points `here`."""

    here: np.ndarray
    made: jax.Array


def begun(program, numbers: Numbers, data, steps, lanes: int, *tables) -> list[Chunk]:
    """A program over tables (points, ...) in chunks of `lanes` points, not waited for.

    XLA computes as many at a time as there are cores.  Points that need about as many `steps` run
    side by side.
    """
    order, out = np.argsort(steps, kind="stable"), []
    for begin in range(0, len(order), lanes):
        here = order[begin : begin + lanes]
        padded = [t[np.resize(here, lanes)] for t in tables]
        on, most = jnp.asarray(numbers.on(padded[0])), jnp.asarray(int(steps[here].max()))
        out.append(Chunk(here, program(data, most, on, *map(jnp.asarray, padded))))
    return out


def ended(chunks: Sequence[Chunk]) -> np.ndarray:
    """Rows (points, rows) of chunks, in the order of their points."""
    rows = np.concatenate([np.asarray(made)[: len(here)] for here, made in chunks])
    back = np.argsort(np.concatenate([here for here, _ in chunks]))
    return rows[back]
