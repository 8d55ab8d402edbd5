"""The fit of a term beside a baseline: functions join as they pay for themselves."""

import copy
import dataclasses
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..._machine import Linearisation, RigModel
from ..._search import Fit, Point, refit
from ..._settings import SETTINGS
from ..._threads import each
from .term import Term, with_network
from .term_port import AbstractPort, TermGrid, axes_of

ROUNDS = SETTINGS.answer_learned.rounds
INNER = SETTINGS.answer_learned.inner
FOLLOWED_TO = SETTINGS.answer_learned.followed_to
ROUND_GAIN = SETTINGS.answer_learned.round_gain
DAMPINGS = SETTINGS.answer_learned.dampings
PRIOR_STEP = SETTINGS.fit.prior_step
DRAWN_PART = SETTINGS.answer_learned.drawn_part
LEAST_SQUARE = SETTINGS.answer_learned.least_square
DRAWN_ROWS = SETTINGS.answer_learned.drawn_rows
MEAN_ROWS = SETTINGS.answer_learned.mean_rows
RIDGE = {
    "basis": SETTINGS.answer_learned.basis_ridge,
    "network": SETTINGS.answer_learned.network_ridge,
}


class Curve(NamedTuple):
    """A part of a term over an input, with 1-sigma of it, in the port's units."""

    x: np.ndarray
    y: np.ndarray
    sigma: np.ndarray


@dataclasses.dataclass(frozen=True)
class Unexplained:
    """What every port's term is fitted around: the baseline's runs, residuals and tangents."""

    u: np.ndarray
    bases: dict[str, list[Linearisation]]
    rest: dict[str, np.ndarray]
    tangents: dict[str, np.ndarray]
    before: np.ndarray  # held-out rows of the fit itself, or of what it shifts to without a term

    @staticmethod
    def of(model: RigModel, fit: Fit) -> "Unexplained":
        """The baseline of a fit on train and held-out runs.

        What is `limited` (the offsets of clocks, driven about by what is unexplained) is held at
        what is stated, where the ports' responses are, the rest fitted beside it; it shifts with
        the term.
        """
        splits = ("train", "held-out")
        point = _with_limited_held(model, fit.point)
        rest = {s: model.residuals([point], s)[0] for s in splits}
        tangents = {s: _tangents(model, point, s) for s in splits}
        shift = alone(point.u, rest["train"], tangents["train"])
        before = (
            model.residuals([fit.point], "held-out")[0],
            rest["held-out"] + tangents["held-out"] @ shift,  # no term is credited with that
        )
        bases = {s: model.bases(point, s) for s in splits}
        return Unexplained(point.u, bases, rest, tangents, min(before, key=lambda x: x @ x))


def alone(u: np.ndarray, rest: np.ndarray, T: np.ndarray) -> np.ndarray:
    """What a baseline at `u` with tangents `T` (rows, priors) shifts to beside no term."""
    return -np.linalg.solve(T.T @ T + np.eye(T.shape[1]), T.T @ rest + u)


class TermFit:
    """Gauss-Newton of a term and the baseline's shift; the term feels what it does itself."""

    def __init__(self, model: RigModel, around: Unexplained, port: AbstractPort):
        self.model, self.around, self.port = model, around, port
        self.shift = np.zeros(len(model.priors))
        raw = np.concatenate([port.inputs(b) for b in around.bases["train"]])
        weights = np.zeros(len(port.columns(raw[:2])))
        self.term = Term(port, port.scales(raw), weights)
        self.active = np.zeros(len(weights), bool)  # which functions of the basis are in
        self.spread = np.zeros((0, 0))  # covariance of all weights, before what is left counts

    def run(self, start: "TermFit | None" = None) -> "TermFit":
        """Fit; from a `start` with a network beside its basis.

        A basis that does not pay for its functions in the end, of which each had promised to, is no
        term: it never ends worse than none.
        """
        before = float(self.around.before @ self.around.before)
        if start is not None:
            self.term, self.shift = with_network(start.term, start.inputs), start.shift
            self.active = start.active
        here = self.left(self.term, "train")
        for _ in range(ROUNDS):
            gain, here = self.improve(*here)
            if gain < ROUND_GAIN:
                break
        if start is None:
            here = self._or_none(*here)
        self.after = {"train": here[0], "held-out": self.left(self.term, "held-out")[0]}
        held = float(self.after["held-out"] @ self.after["held-out"])
        self.closed = (before - held) / max(before - self.model.dof("held-out"), 1.0)
        self.inputs_by_run = here[1]
        self.cost = self._cost(here[0])
        self.spread *= max(1.0, float(here[0] @ here[0]) / self.model.dof("train"))
        return self

    def _cost(self, rows: np.ndarray) -> float:
        """Of train rows beside the term and the shift, with the price of its functions."""
        u = self.around.u + self.shift
        return float(rows @ rows + u @ u) + float(np.log(len(rows))) * int(self.active.sum())

    def _or_none(
        self, rows: np.ndarray, inputs: list[np.ndarray]
    ) -> tuple[np.ndarray, list[np.ndarray]]:
        """Train rows and inputs beside the term; without it where it costs more than none."""
        cost, here = self._cost(rows), (self.term, self.shift, self.active, self.spread)
        self.shift = alone(self.around.u, self.around.rest["train"], self.around.tangents["train"])
        self.term = self.term.moved(-self.term.weights)
        self.active, self.spread = np.zeros_like(self.active), np.zeros_like(self.spread)
        left, still = self.left(self.term, "train")
        if cost >= self._cost(left):
            return left, still
        self.term, self.shift, self.active, self.spread = here
        return rows, inputs

    @property
    def inputs(self) -> np.ndarray:
        """Scaled inputs (points, k) of all fitted runs."""
        return np.concatenate(self.inputs_by_run)

    def some_inputs(self, count: int) -> np.ndarray:
        """About `count` of them, evenly."""
        inputs = self.inputs
        return inputs[:: max(1, len(inputs) // count)]

    @property
    def sigma(self) -> np.ndarray:
        """1-sigma (weights,) of the basis' coefficients."""
        return np.sqrt(np.diag(self.spread)[: len(self.term.weights)])

    def curve(self, grid: TermGrid) -> Curve:
        """A part of the term along a grid, with its band: the mean over what else varies.

        Source: partial dependence (Friedman, Greedy function approximation, 2001).
        """
        some = self.some_inputs(MEAN_ROWS)
        u = np.repeat(some[:, None], len(grid.x), axis=1)  # (others, points, k)
        for k, values in grid.varied.items():
            u[:, :, k] = values
        flat = u.reshape(-1, u.shape[2])

        def mean(x: np.ndarray) -> np.ndarray:
            return x[:, grid.part].reshape(len(some), -1).mean(axis=0)

        J = np.stack([mean(x) for x in self.term.tangents(flat)])
        band = np.sqrt(np.maximum(np.einsum("kt,kl,lt->t", J, self.spread, J), 0.0))
        return Curve(grid.x, mean(self.term.force(flat)), band)

    def grid(self, part: int) -> TermGrid:
        """The grid of the input that a part hangs on most, of those like its own."""
        inputs = self.port.like_own(part)
        missed = self.missed(self.some_inputs(DRAWN_ROWS), part, inputs)
        return self.port.grid(part, self.term.scales, inputs[int(np.argmax(missed))])

    def missed(self, u: np.ndarray, part: int, inputs: Sequence[int]) -> list[float]:
        """What a part of the term loses of its square by each of some inputs being 0."""
        whole = self.term.force(u)[:, part]
        without = (self.term.force(u * (np.arange(u.shape[1]) != k))[:, part] for k in inputs)
        return [float(np.sum((whole - x) ** 2)) for x in without]

    def change(self, parts: Sequence[int] | None = None) -> np.ndarray:
        """What the term, or some of its parts, changes of the fitted runs' rows."""
        out = []
        for base, u in zip(self.around.bases["train"], self.inputs_by_run, strict=True):
            force = self.term.force(u)
            if parts is not None:
                force = force * np.isin(np.arange(force.shape[1]), parts)
            rows = self.model.machine.rows[base.index]
            out.append(rows.project(rows.vector(*self.port.push(base, force))))
        return np.concatenate(out)

    def strongest(self) -> list[int]:
        """The parts that change the rows most, drawn over one unit, the strongest first."""
        sizes = [np.linalg.norm(self.change([i])) for i in range(len(self.port.parts))]
        order = [int(i) for i in np.argsort(sizes)[::-1] if sizes[i] >= DRAWN_PART * max(sizes)]
        units = [[unit for _, unit in axes_of(self.port, self.grid(i))] for i in order]
        return [i for i, own in zip(order, units, strict=True) if own == units[0]]

    def left(
        self, term: Term, split: str, shift: np.ndarray | None = None
    ) -> tuple[np.ndarray, list[np.ndarray]]:
        """Residual rows beside the term and the shift, and the term's scaled inputs by run."""

        def one(base: Linearisation):
            felt, force, u = None, np.zeros(0), np.zeros(0)
            for turn in range(INNER):
                u = np.clip(term.port.inputs(base, felt) / term.scales, -FOLLOWED_TO, FOLLOWED_TO)
                force = term.force(u)
                felt = term.port.felt(base, force) if turn < INNER - 1 else None
                if felt is None:
                    break
            rows = self.model.machine.rows[base.index]
            return rows.project(rows.vector(*term.port.push(base, force))), u

        parts, inputs = zip(*each(one, self.around.bases[split]), strict=True)
        shift = self.shift if shift is None else shift
        rest, tangents = self.around.rest[split], self.around.tangents[split]
        return rest - np.concatenate(parts) + tangents @ shift, list(inputs)

    def improve(
        self, now: np.ndarray, inputs: list[np.ndarray]
    ) -> tuple[float, tuple[np.ndarray, list[np.ndarray]]]:
        """One damped step from train rows `now` and the term's `inputs` there.

        The share of the misfit that it takes away, and rows and inputs after it.
        """
        table = self._columns(inputs)
        P, extra = len(self.shift), len(table) - len(self.shift)
        scale = np.linalg.norm(table[:extra], axis=1)
        scale[scale == 0] = 1.0
        table[:extra] /= scale[:, None]
        gram, right = table @ table.T, table @ now
        right[extra:] -= self.around.u + self.shift
        k, free = len(self.term.weights), np.ones(len(table), bool)
        ridge = np.repeat([RIDGE["basis"], RIDGE["network"]], [k, extra - k])
        price = float(np.log(len(now))) * max(1.0, float(now @ now) / self.model.dof("train"))
        free[:k] = self.active
        prior = np.diag(np.concatenate([ridge, np.ones(P)]))
        free = worthwhile(gram + prior, right, free, price)
        self.active, free = free[:k], np.flatnonzero(free)
        inner = np.ix_(free, free)
        self.spread, step = np.zeros((len(table), len(table))), np.zeros(len(table))
        self.spread[inner] = np.linalg.inv((gram + prior)[inner])
        self.spread = self.spread[:extra, :extra] / np.outer(scale, scale)
        for damping in DAMPINGS:
            weights = np.diag(np.concatenate([ridge * damping, np.ones(P)]))
            step[free] = np.linalg.solve((gram + weights)[inner], right[free])
            term, shift = self.term.moved(step[:extra] / scale), self.shift + step[extra:]
            new, felt = self.left(term, "train", shift)
            if new @ new <= now @ now:
                self.term, self.shift = term, shift
                return 1 - float(new @ new) / float(now @ now), (new, felt)
        return 0.0, (now, inputs)

    def _columns(self, inputs: list[np.ndarray]) -> np.ndarray:
        """Changes of the train rows (weights + priors, rows) with every weight and every prior."""
        bases, machine = self.around.bases["train"], self.model.machine
        ends = np.cumsum([0, *(machine.rows[base.index].size for base in bases)])
        forces = len(self.term.tangents(inputs[0][:1]))
        table = np.empty((forces + len(self.shift), ends[-1]))
        table[forces:] = -self.around.tangents["train"].T

        def fill(k: int) -> None:
            part = table[:forces, ends[k] : ends[k + 1]]
            pushed(self.model, self.port, bases[k], self.term.tangents(inputs[k]), part)

        each(fill, range(len(bases)))
        return table


def pushed(
    model: RigModel, port: AbstractPort, base: Linearisation, outputs: Sequence[np.ndarray],
    into: np.ndarray,
) -> None:  # fmt: skip
    """What `outputs` (k of (points, parts)) of a port change of a run's rows, `into` (k, rows)."""
    rows = model.machine.rows[base.index]
    for row, output in zip(into, outputs, strict=True):
        row[:] = rows.vector(*port.push(base, output))
    rows.take_off(into)


def worthwhile(gram: np.ndarray, right: np.ndarray, free: np.ndarray, price: float) -> np.ndarray:
    """Which columns a least-squares step may use: `free` ones, and others as they pay their price.

    `gram` (k, k) and `right` (k,) are its normal equations.  One after the other joins, by more
    than `price`, that lowers the cost most; of those within the price of it the first.
    """
    free = free.copy()
    length = np.diag(gram)
    while not free.all():
        rest, apart = right, length
        if free.any():
            inner = np.linalg.inv(gram[np.ix_(free, free)])
            rest = right - gram[:, free] @ (inner @ right[free])
            apart = length - np.einsum("ka,ab,kb->k", gram[:, free], inner, gram[:, free])
        new = ~free & (apart > LEAST_SQUARE * length)
        gain = np.where(new, rest**2 / np.where(new, apart, 1.0), 0.0)
        if gain.max() < price:
            break
        free[int(np.argmax(gain >= max(price, gain.max() - price)))] = True
    return free


def _with_limited_held(model: RigModel, point: Point) -> Point:
    """The point fitted again with what is `limited` at what is stated."""
    limited = [p.limited for p in model.priors]
    if not np.any(point.u[limited]):
        return point
    held = copy.copy(model)
    held.priors = [dataclasses.replace(p, hard=0.0) if p.limited else p for p in model.priors]
    return refit(held, Point(np.where(limited, 0.0, point.u), point.effects)).point


def _tangents(model: RigModel, point: Point, split: str) -> np.ndarray:
    """d residual / du on the runs of a split."""
    (residual,) = model.residuals([point], split)
    P = len(point.u)
    points = [Point(point.u + PRIOR_STEP * e, point.effects) for e in np.eye(P)]
    with model.aside():
        moved = model.residuals(points, split) if P else []
    if not P:
        return residual[:, None][:, :0]
    return np.stack([(r - residual) / PRIOR_STEP for r in moved], 1)
