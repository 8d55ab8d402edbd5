"""Rows of a machine's runs at vectors of numbers: which program gives them, in which batches."""

from collections.abc import Callable, Mapping, Sequence

import jax.numpy as jnp
import numpy as np

from ....machine import steps_for
from ..._settings import SETTINGS
from .batches import Batch, batches, widths
from .measured import Measured
from .numbers import Numbers
from .programs import START, TANGENT, VALUE, Programs, begun, ended
from .rows import Balance

MOST_STEPS = SETTINGS.free_model.most_steps
LANES = 16, 8, 4  # points side by side, by program: as many as mostly come; one shape, one program
HANDFUL = 4, 1, 1  # points, at most, that one by one take less time than filled up to `LANES`
OFTEN = (1.5e6, 1.5e6, 5e5)  # samples stepped by these, after which a set of laws has its own
FEW = 4  # laws of such a set, at most


class RowEvaluation:
    """Values and tangents of all rows of some runs, in physical units.

    `starts` (windows, states + 2) by free run say by how much its windows begin elsewhere than was
    measured: those that hold, unless others are tried.
    """

    def __init__(self, numbers: Numbers, measured: Measured, programs: Programs):
        self.numbers, self.measured, self.programs = numbers, measured, programs
        self.starts = {i: r.as_measured() for i, r in measured.free_runs.items()}
        self.asked: dict[tuple, float] = {}  # samples stepped so far by laws, program and lanes
        self._slopes = programs.slopes_along(numbers, measured.runs)
        splits = (measured.splits["train"], measured.splits["held-out"])
        self._widths = widths(measured.rows, splits)
        self._batches: dict[tuple[int, ...], list[Batch]] = {}
        self._balances: dict[int, tuple[Balance, Callable]] = {}

    def values(self, thetas: np.ndarray, which: Sequence[int], starts=None) -> np.ndarray:
        """Rows (points, rows) at `thetas`."""
        return self._table(VALUE, which, starts, thetas)

    def tangents(self, thetas: np.ndarray, ways: np.ndarray, which: Sequence[int]) -> np.ndarray:
        """Tangents (points, rows) of the rows at `thetas` along `ways`."""
        return self._table(TANGENT, which, None, thetas, ways)

    def start_tangents(self, theta, ways: np.ndarray, which: Sequence[int], starts) -> np.ndarray:
        """Tangents (k, rows) of the rows at `theta` along `ways` (k, states + 2) of the starts."""
        return self._table(START, which, starts, np.tile(theta, (len(ways), 1)), ways)

    def slopes(self, theta: np.ndarray) -> np.ndarray:
        """Slopes (m, n, n) of the rate at states that the runs pass."""
        return np.asarray(self._slopes(jnp.asarray(theta))[0])

    def _table(self, program: int, which: Sequence[int], starts: Mapping | None,
               *tables: np.ndarray) -> np.ndarray:  # fmt: skip
        """What a program gives of all rows of some runs."""
        starts = self.starts if starts is None else starts
        key, steps, rows = tuple(which), self.steps(tables[0]), self.measured.rows
        followed = np.where(steps > MOST_STEPS, 1, steps)
        if key not in self._batches:
            self._batches[key] = batches({i: rows[i] for i in which}, self._widths)
        only, lanes = self._program_for(tables[0], followed, which, program)
        by_run, running = {}, []
        for batch in self._batches[key]:
            run = self.programs.of(rows[batch.members[0]], only)[program]
            running.append([
                begun(run, self.numbers, data, followed, lanes, *tables)
                for data in batch.data(starts)
            ])  # fmt: skip
        for batch, parts in zip(self._batches[key], running, strict=True):
            by_run |= batch.by_run([ended(chunks) for chunks in parts])
        out = np.concatenate([by_run[i][:, rows[i].picked] for i in which], axis=1)
        out[steps > MOST_STEPS] = np.nan
        return out

    def _program_for(self, thetas, steps, which, program) -> tuple[frozenset[int] | None, int]:
        """(laws of the program, points side by side): often used laws have one of their own.

        To write it takes a second, and it saves to ask for all other laws at every step, which is
        little, as none is evaluated that no point has.  Points are one or `LANES`, for every other
        number of them would be a program more; a `HANDFUL` go one by one.
        """
        lanes = 1 if len(thetas) <= HANDFUL[program] else LANES[program]
        only = self.numbers.active(thetas)
        key = (only, program, lanes)
        stepped = float(np.sum(steps)) * max(1.0, lanes / len(thetas))
        samples = sum(self.measured.rows[i].count for i in which) * stepped
        self.asked[key] = self.asked.get(key, 0.0) + samples
        own = len(only) <= FEW and self.asked[key] > OFTEN[program]
        return only if own else None, lanes

    def steps(self, thetas: np.ndarray) -> np.ndarray:
        """Runge-Kutta steps between inputs that each vector of numbers needs; 1 in a balance.

        A law that is steep somewhere, as dry friction is at rest, sets them.
        """
        runs = self.measured.free_runs.values()
        if not runs:
            return np.ones(len(thetas), int)
        step = max(r.run.step / r.places for r in runs)
        counts, known = np.empty(len(thetas), int), {}
        for k, theta in enumerate(thetas):
            key = theta.tobytes()
            if key not in known:
                everywhere = self._slopes(jnp.asarray(theta))
                known[key] = steps_for(np.concatenate(everywhere), step)
            counts[k] = known[key]
        return counts

    def balance(self, i: int) -> tuple[Balance, Callable]:
        """The balance of run `i`, and its values at a vector of numbers."""
        if i not in self._balances:
            rows = self.measured.rows[i]
            if not isinstance(rows, Balance):
                rows = Balance(self.numbers, self.measured.runs[i])
            program, one = self.programs.of(rows)[VALUE], np.ones(1, int)
            self._balances[i] = (
                rows,
                lambda t: ended(begun(program, self.numbers, rows.data, one, 1, t[None]))[0],
            )
        return self._balances[i]
