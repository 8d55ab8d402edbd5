"""A machine of a few states with its runs as a model of the diagnosis."""

import contextlib
import dataclasses
from collections.abc import Callable, Sequence

import numpy as np

from ...laws import EFFECTS, AbstractLaw
from ...machine import AbstractMachine, PlacedLaw
from .._search import Effect, Fit, Point, Prior, refit
from .._settings import SETTINGS
from ._candidates import Scales, machine_candidates, ranges_of, signatures, strongest_orders
from ._noise import AbstractColoured, Colour, RowNoise, beside, best_known, in_colour, turned
from ._rows import (
    Balance,
    FreeStarts,
    Measured,
    Numbers,
    OdeRun,
    Programs,
    RowEvaluation,
    Rows,
    matters,
)
from .undecided import undecided

NUMBER_PRICE = SETTINGS.free_model.number_price
PRIOR_STEP = SETTINGS.fit.prior_step
LINES = SETTINGS.free_model.lines


class OdeModel(AbstractColoured):
    """A machine, its runs, the laws that may be missing; rows by one criterion a run.

    `criterion(numbers, run)` gives the rows of a run; `noise` is the sensor's 1-sigma of what was
    measured, one or (runs,).
    `programs` are those of models of the same case, if there are any.

    Its parts: `measured` (runs and rows), `numbers` (what is free), `evaluation` (rows at a vector
    of numbers), `starts` (of free runs' windows), `row_noise` (what a row weighs).
    """

    budget = SETTINGS.free_model.budget
    repeats = frozenset({"motor-ripple", "current-ripple"})
    settings = dataclasses.replace(
        SETTINGS.search, both_anchors=True, runner_up_lead=SETTINGS.free_model.runner_up_lead,
        size_factor=SETTINGS.free_model.size_factor, size_noise=SETTINGS.free_model.size_noise,
    )  # fmt: skip
    frozen_keys = frozenset({"roller", "exponent", "modulus"})
    ranking = "ranking"

    def __init__(
        self,
        machine: AbstractMachine,
        priors: Sequence[Prior],
        runs: Sequence[OdeRun],
        laws: dict[str, type[AbstractLaw]],
        places: Sequence[tuple[str, str]],
        criterion: Callable[[Numbers, OdeRun], Rows],
        noise: np.ndarray | float,
        stated: tuple[PlacedLaw, ...] = (),
        programs: Programs | None = None,
    ):
        self.machine, self.priors, self.laws = machine, list(priors), laws
        self.noise = np.broadcast_to(noise, len(runs))
        room = [(laws[i], p) for i, p in places]
        room += [(laws[i], p) for i, p in places if "order" in laws[i].parameters] * (LINES - 1)
        self.places = list(places)
        self.numbers = numbers = Numbers(machine, self.priors, room, stated)
        self.measured = Measured(runs, lambda run: criterion(numbers, run))
        self.evaluation = RowEvaluation(numbers, self.measured, programs or Programs())
        self.starts = FreeStarts(self.evaluation)
        self.row_noise = RowNoise.of_sensor(self.noise, self.measured.rows)
        self.scales = Scales.of(machine, self.measured.of("train"), runs[0].cutoff)
        self.explained: Fit | None = None  # the refit by which the floor was set
        self.colour: Colour | None = None  # of the rows of a balance, where they are not white
        self._undecided: tuple[np.ndarray, np.ndarray] | None = None
        if self.steps_in_time:
            self.settings = dataclasses.replace(self.settings, strong_misfit=0.0)

    # rows ---------------------------------------------------------------------------------------

    def raw(self, points: Sequence[Point], split: str) -> np.ndarray:
        """Rows (points, rows) of a split in physical units."""
        thetas = np.stack([self.numbers.vector(p) for p in points])
        return self.evaluation.values(thetas, self.measured.splits[split])

    def left(self, point: Point, split: str) -> list[np.ndarray]:
        """By run of a split its rows (rows,) at a point, in sigma of each row."""
        return self.in_sigma(self.raw([point], split)[0], split)

    def by_run(self, rows: np.ndarray, split: str = "train") -> list[np.ndarray]:
        """Rows (..., rows) of a split by run."""
        return self.measured.parted(rows, self.measured.splits[split])

    def in_sigma(self, rows: np.ndarray, split: str) -> list[np.ndarray]:
        """Physical rows (..., rows) of a split by run, in sigma of each row."""
        sigmas = self.row_noise.sigma[self.measured.splits[split]]
        return [x / sigma for x, sigma in zip(self.by_run(rows, split), sigmas, strict=True)]

    def slopes(self, point: Point) -> np.ndarray:
        return self.evaluation.slopes(self.numbers.vector(point))

    def weights(self, split: str) -> np.ndarray:
        """1/sigma of every row of a split, as if `inflation` rows said as much as one."""
        return self.row_noise.weights(self.measured, split)

    def whitened(self, table: np.ndarray, split: str) -> np.ndarray:
        """Rows (k, rows) in sigma, less what the windows' free starts can make.

        Held-out rows also less what numbers can make that the train runs leave undecided.
        """
        if self.colour is not None:
            parts = self.in_sigma(table, split)
            return np.concatenate([self.colour.whitened(x) for x in parts], 1)
        out = table * self.weights(split)
        self.starts.project(out, self.measured.splits[split])
        if split == "held-out" and self._undecided is not None:
            ways, less = self._undecided
            out -= ((out @ ways) * less) @ ways.T
        return out

    def residuals(self, points, split):
        splits = self.measured.splits
        self.work += len(points) * len(splits[split]) / max(1, len(splits["train"]))
        return list(self.whitened(self.raw(points, split), split)) if points else []

    def tangents(self, point: Point, free) -> np.ndarray:
        """d residual / d (u, free numbers) on the train runs, exact."""
        slots = self.numbers.slots_of(point.effects)
        ways = list(self.numbers.ways(point))
        for f in free:
            way = np.zeros(self.numbers.size)
            way[slots[f.effect].part(f.key).start + (f.index or 0)] = 1.0
            ways.append(way)
        self.work += len(ways)
        if not ways:  # nothing is uncertain and no effect is there
            return np.zeros((self.measured.count("train"), 0))
        return self.along(point, np.stack(ways), "train").T

    def along(self, point: Point, ways: np.ndarray, split: str) -> np.ndarray:
        """Tangents (k, rows) of a split's rows in sigma along `ways` (k, numbers) at a point."""
        thetas = np.tile(self.numbers.vector(point), (len(ways), 1))
        table = self.evaluation.tangents(thetas, ways, self.measured.splits[split])
        return self.whitened(table, split)

    def dof(self, split):
        return max(1, round(self.measured.count(split) / self.row_noise.inflation))

    # what is prepared about a point -------------------------------------------------------------

    def rebase(self, point):
        """Free starts as the point's laws have them, and what each start changes in its window."""
        if self.steps_in_time:
            self.starts.refit(self.numbers.vector(point))
        self._undecided = None
        if len(point.u) and self.measured.splits["held-out"]:
            self._undecided = undecided(self.tangents(point, ()), self._held_out_slopes(point))

    def _held_out_slopes(self, point: Point) -> np.ndarray:
        """Changes (rows, numbers) of the held-out rows, in sigma, by the numbers' prior sigmas."""
        steps = [np.zeros_like(point.u), *(PRIOR_STEP * np.eye(len(point.u)))]
        points = [Point(point.u + step, point.effects) for step in steps]
        rows = self.whitened(self.raw(points, "held-out"), "held-out")
        return ((rows[1:] - rows[0]) / PRIOR_STEP).T

    @contextlib.contextmanager
    def _prepared(self):
        """A block in which `rebase` may be called; at its end the preparation is restored."""
        begun, bases, open_ = self.evaluation.starts, dict(self.starts.bases), self._undecided
        try:
            yield
        finally:
            self.evaluation.starts, self.starts.bases, self._undecided = begun, bases, open_

    def unsettled(self, point):
        return self.steps_in_time

    def frees(self, effect):
        """A late sensor or drive frees the motion before each window, which it still shows."""
        return any(matters([self.laws[effect.id]]))

    def astray(self, fit):
        """Free runs that miss by far more than noise: their starts have moved to hide the gap."""
        return self.steps_in_time and fit.chi2 > self.settings.near_noise * self.dof("train")

    def on_its_own(self, fit):
        """The fit refitted with starts of its own, which free the past that a late sensor shows.

        Where it began elsewhere, also from the end of the floor's refit of the same laws; the
        cheaper of both counts.
        """
        if not self.steps_in_time:
            return super().on_its_own(fit)
        begun, made = [self.remembered(fit.point), fit.point], []
        for point in begun[begun[0] is begun[1] :]:
            with self._prepared():
                made.append(super().on_its_own(turned(self, dataclasses.replace(fit, point=point))))
            if not self.astray(made[-1][0]):
                break
        return min(made, key=lambda x: x[0].cost)

    # noise --------------------------------------------------------------------------------------

    def set_floor(self, fit: Fit, tell: Callable[[str], None] = lambda text: None) -> None:
        """Weigh rows by what no law of the library explains on the train runs, and its colour.

        A real machine is never as good as its sensors: what is left after the best laws is the
        noise against which an effect must stand.  A balance is linear in the laws' strengths, so
        all tangents together say it; of free runs, laws refitted at finite strength do.
        """
        if self.steps_in_time:
            best = self.explained = best_known(self, fit, tell, self.balanced)
            left, used = best.residual, len(best.free)
        else:
            candidates = self.candidates(fit.point)
            table = np.concatenate([fit.jacobian.T, self.columns(fit.point, candidates)])
            left, used = beside(fit.residual, table)
        self.row_noise = self.row_noise.raised(self.by_run(left), used)

    def margin(self, fit, rival):
        """Of a balance that leaves two laws equal: as its rows say with their noise's colour.

        Where the held-out rows say so too.
        """
        margin = rival.cost - fit.cost
        if self.steps_in_time or abs(margin) > self.settings.equal_margin:
            return margin
        train, held = in_colour(self, rival).above(in_colour(self, fit))
        return train if train * held > 0 else margin

    def remembered(self, point):
        """Where the floor's refit of the same laws ended, or the point itself."""
        known = self.explained
        if known is None or _names(known.point) != _names(point):
            return point
        return known.point

    def foretold(self, point):
        """The first law of the floor's refit with all its lines, beside no other effect."""
        known = self.explained
        if known is None or point.effects or not known.point.effects:
            return []
        effects = known.point.effects
        return [known.point.with_effects(*(e for e in effects if e.name == effects[0].name))]

    # candidates ---------------------------------------------------------------------------------

    @property
    def steps_in_time(self) -> bool:
        """Whether rows are those of free runs: no law is a multiple of its tangent there."""
        return bool(self.measured.free_runs)

    def bends(self, id):
        """In free runs every law of the machine, not those of its sensors."""
        return self.steps_in_time and self.laws[id].port != "sensor"

    def candidates(self, point):
        orders = {}
        if any("order" in self.laws[i].parameters for i, _ in self.places):
            orders = strongest_orders(self, point)
        names = [e.name for e in point.effects]
        candidates = machine_candidates(self, self.scales, orders)
        return [c for c in candidates if names.count(c.name) < LINES]

    def columns(self, point, candidates):
        return signatures(self, point, candidates)

    def plainness(self, effect: Effect) -> float:
        """Share of its gain that a law keeps when laws are ranked: fewer numbers come first."""
        numbers = sum(k != "width" for k in effect.values)
        return 1 - NUMBER_PRICE * (numbers + (effect.id not in EFFECTS))

    def free(self, point):
        return ranges_of(self, point, self.scales, self.measured.resolution)

    def balanced(self) -> "OdeModel":
        """The same machine and runs by the balance of accelerations, with the laws of lines alone.

        Its rows weigh as much as what the machine without effects leaves there.
        """
        laws = {i: x for i, x in self.laws.items() if i in self.repeats}
        places = [(i, place) for i, place in self.places if i in laws]
        made = OdeModel(self.machine, self.priors, self.measured.runs, laws, places, Balance,
                        self.noise, self.numbers.stated)  # fmt: skip
        fit = refit(made, Point(np.zeros(len(self.priors))))
        left = max(1.0, float(np.sqrt(fit.chi2 / made.dof("train"))))
        made.row_noise = dataclasses.replace(made.row_noise, sigma=made.row_noise.sigma * left)
        return made


def _names(point: Point) -> list[str]:
    """Names of the effects of a point, those of several lines as often as there are lines."""
    return sorted(e.name for e in point.effects)
