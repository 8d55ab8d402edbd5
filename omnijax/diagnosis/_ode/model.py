"""A machine of a few states with its runs as a model of the diagnosis."""

import dataclasses
from collections.abc import Callable, Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from ...laws import EFFECTS, AbstractLaw
from ...machine import AbstractMachine, PlacedLaw, slopes_of, steps_for
from .._search import (
    Candidate,
    Effect,
    Fit,
    Point,
    Prior,
    free_numbers,
    refit,
)
from .._settings import SETTINGS
from .before import matters
from .candidates import Scales, machine_candidates
from .colour import AbstractColoured, Colour, in_colour
from .floor import beside, best_known, inflation, turned
from .numbers import Numbers
from .orders import strongest_orders
from .reopened import reopened
from .rows import Balance, Batch, FreeRun, OdeRun, batches, smoothed, widths
from .undecided import undecided

STEEP = SETTINGS.free_model.steep
VALUE, TANGENT, START = range(3)  # programs over the rows
LANES = 16, 8, 4  # points side by side, by program: as many as mostly come; one shape, one program
HANDFUL = 4, 1, 1  # points, at most, that one by one take less time than filled up to `LANES`
OFTEN = (1.5e6, 1.5e6, 5e5)  # samples stepped by these, after which a set of laws has its own
FEW = 4  # laws of such a set, at most
BOUND = SETTINGS.free_model.bound
RANKING = SETTINGS.free_model.ranking
SIMPLER = SETTINGS.free_model.simpler
RESTARTS = SETTINGS.free_model.restarts
PARTS = SETTINGS.free_model.parts
ENOUGH = SETTINGS.free_model.enough
STEP = SETTINGS.free_model.step
ROOM = SETTINGS.free_model.room
ORDER = SETTINGS.free_model.order


@dataclasses.dataclass
class Programs:
    """What is compiled for a machine, its laws and its runs, however their input is held."""

    rows: dict[tuple, tuple] = dataclasses.field(default_factory=dict)
    slopes: Callable | None = None


class OdeModel(AbstractColoured):
    """A machine, its runs, the laws that may be missing; rows by one criterion a run.

    `criterion(numbers, run)` gives the rows of a run; `noise` is the sensor's 1-sigma of position.
    `programs` are those of models of the same case, if there are any.
    """

    budget = 4000.0
    repeats = frozenset({"motor-ripple", "current-ripple"})
    settings = dataclasses.replace(SETTINGS.search, lead=0.1, both=True, share=2.0, slack=0.0)
    frozen_keys = frozenset({"roller", "exponent", "modulus"})

    def __init__(
        self,
        machine: AbstractMachine,
        priors: Sequence[Prior],
        runs: Sequence[OdeRun],
        laws: dict[str, type[AbstractLaw]],
        places: Sequence[tuple[str, str]],
        criterion: Callable[[Numbers, OdeRun], Balance | FreeRun],
        noise: float,
        stated: tuple[PlacedLaw, ...] = (),
        programs: Programs | None = None,
    ):
        self.machine, self.priors, self.laws, self.noise = machine, list(priors), laws, noise
        room = [(laws[i], p) for i, p in places]
        room += [(laws[i], p) for i, p in places if "order" in laws[i].parameters] * (ROOM - 1)
        self.places = list(places)
        self.numbers = Numbers(machine, self.priors, room, stated)
        self.runs = list(runs)
        self.rows = [criterion(self.numbers, run) for run in runs]
        splits = {role: [i for i, run in enumerate(runs) if run.role == role]
                  for role in ("train", "held-out")}  # fmt: skip
        apart = max(1, len(splits["train"]) // RANKING)
        splits["ranking"] = splits["train"][::apart]  # the first of train's rows
        splits["train"] = [i for k in range(apart) for i in splits["train"][k::apart]]
        self.splits, self.ranking = splits, "ranking"
        self.scales = Scales.of(machine, [runs[i] for i in splits["train"]], runs[0].cutoff)
        self.scale = np.array([max(noise, 1e-300) * r.gain() for r in self.rows])
        self.inflation, self.floor = 1.0, 1.0
        self.explained: Fit | None = None  # the refit by which the floor was set
        self.colour: Colour | None = None  # of the rows of a balance, where they are not white
        if self.steps_in_time:
            self.settings = dataclasses.replace(self.settings, strong=0.0)
        programs = programs or Programs()
        self._compiled = programs.rows
        self._asked: dict[tuple, float] = {}  # samples stepped so far by laws, program and lanes
        programs.slopes = programs.slopes or _slopes_along(self.numbers, self.runs)
        self._slopes = programs.slopes
        self._batches: dict[tuple[int, ...], list[Batch]] = {}
        self._widths = widths(self.rows, (splits["train"], splits["held-out"]))
        self._starts: dict[int, list] = {}
        self._undecided: tuple[np.ndarray, np.ndarray] | None = None
        self._balances: dict[int, tuple[Balance, Callable]] = {}

    # rows ---------------------------------------------------------------------------------------

    def raw(self, thetas: np.ndarray, which: Sequence[int]) -> np.ndarray:
        """Rows (points, rows) in physical units."""
        return self._rows(VALUE, which, thetas)

    def pushed(self, thetas: np.ndarray, ways: np.ndarray, which: Sequence[int]) -> np.ndarray:
        """Tangents (points, rows) of the rows at `thetas` along `ways`."""
        return self._rows(TANGENT, which, thetas, ways)

    def _rows(self, program: int, which: Sequence[int], *tables: np.ndarray) -> np.ndarray:
        """Values, tangents, or slopes along the windows' starts, of all rows of some runs."""
        key, steps = tuple(which), self.steps(tables[0])
        followed = np.where(steps > STEEP, 1, steps)
        if key not in self._batches:
            self._batches[key] = batches({i: self.rows[i] for i in which}, self._widths)
        only, lanes = self._program_for(tables[0], followed, which, program)
        by_run, begun = {}, []
        for batch in self._batches[key]:
            run = self._programs(self.rows[batch.members[0]], only)[program]
            begun.append([
                _begun(run, self.numbers, data, followed, lanes, *tables) for data in batch.parts
            ])  # fmt: skip
        for batch, parts in zip(self._batches[key], begun, strict=True):
            by_run |= batch.by_run([_ended(chunks) for chunks in parts])
        out = np.concatenate([by_run[i][:, self.rows[i].picked] for i in which], axis=1)
        out[steps > STEEP] = np.nan
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
        samples = sum(self.rows[i].count for i in which) * stepped
        self._asked[key] = self._asked.get(key, 0.0) + samples
        own = len(only) <= FEW and self._asked[key] > OFTEN[program]
        return only if own else None, lanes

    def _programs(self, rows, only: frozenset[int] | None = None):
        """(values, tangents) of rows like these, compiled once."""
        key = (rows.kind, only)
        if key not in self._compiled:
            self._compiled[key] = _compiled(rows, only)
        return self._compiled[key]

    def steps(self, thetas: np.ndarray) -> np.ndarray:
        """Runge-Kutta steps between inputs that each vector of numbers needs; 1 in a balance.

        A law that is steep somewhere, as dry friction is at rest, sets them.
        """
        runs = [r for r in self.rows if isinstance(r, FreeRun)]
        if not runs:
            return np.ones(len(thetas), int)
        step = max(r.run.step / r.places for r in runs)
        counts, known = np.empty(len(thetas), int), {}
        for k, theta in enumerate(thetas):
            key = theta.tobytes()
            if key not in known:
                known[key] = steps_for(np.asarray(self._slopes(jnp.asarray(theta))), step)
            counts[k] = known[key]
        return counts

    def weights(self, split: str) -> np.ndarray:
        """1/sigma of every row of a split, as if `inflation` rows said as much as one."""
        sigma = self.scale * np.sqrt(self.inflation)
        return np.concatenate([
            np.full(self.rows[i].count, 1 / sigma[i]) for i in self.splits[split]
        ])  # fmt: skip

    def whitened(self, table: np.ndarray, split: str) -> np.ndarray:
        """Rows (k, rows) in sigma, less what the windows' free starts can make.

        Held-out rows also less what numbers can make that the train runs leave undecided.
        """
        if self.colour is not None:
            return np.concatenate([self.colour.whitened(x) for x in self.by_run(table, split)], 1)
        out, at = table * self.weights(split), 0
        for i in self.splits[split]:
            basis = self._starts.get(i)
            part = slice(at, at + self.rows[i].count)
            if basis is not None:
                for rows, q in basis:
                    where = np.arange(part.start, part.stop)[rows]
                    out[:, where] -= (out[:, where] @ q) @ q.T
            at = part.stop
        if split == "held-out" and self._undecided is not None:
            ways, less = self._undecided
            out -= ((out @ ways) * less) @ ways.T
        return out

    def rebase(self, point):
        """Free starts as the point's laws have them, and what each start changes in its window.

        A start that is off bends all that hangs on the state nonlinearly: a play, a line of the
        angle.  So starts are refitted, not only projected out.
        """
        if which := self._begun_freely():
            self._begin(point, which)
        self._undecided = None
        if len(point.u) and self.splits["held-out"]:
            self._undecided = undecided(self.tangents(point, ()), self._held_out_slopes(point))

    def _held_out_slopes(self, point: Point) -> np.ndarray:
        """Changes (rows, numbers) of the held-out rows, in sigma, by the numbers' prior sigmas."""
        steps = [np.zeros_like(point.u), *(STEP * np.eye(len(point.u)))]
        points = [Point(point.u + step, point.effects) for step in steps]
        thetas = np.stack([self.numbers.vector(p) for p in points])
        rows = self.whitened(self.raw(thetas, self.splits["held-out"]), "held-out")
        return ((rows[1:] - rows[0]) / STEP).T

    def _begin(self, point: Point, which: Sequence[int]) -> None:
        """Free starts of some runs, and their tangents."""
        theta = self.numbers.vector(point)

        def left() -> dict[int, np.ndarray]:
            self._batches.clear()  # their data hold the starts
            return self._left(theta, which)

        def slopes() -> dict[int, np.ndarray]:
            self._batches.clear()
            return self._start_slopes(theta, which)

        self._settled_starts(theta, which)
        if reopened(self._free_runs(which), left, slopes):
            self._settled_starts(theta, which)
        self._batches.clear()
        for i, part in self._start_slopes(theta, which).items():
            rows = self.rows[i]
            if isinstance(rows, FreeRun) and np.all(np.abs(part) < 1e100):
                self._starts[i] = rows.bases(part)

    def _settled_starts(self, theta, which: Sequence[int]) -> None:
        """Steps of Gauss and Newton of the starts, as long as they gain."""
        for _ in range(RESTARTS):
            if not self._moved_starts(theta, which):
                break

    def unsettled(self, point):
        return bool(self._begun_freely())

    def frees(self, effect):
        """A late sensor or drive: of the time before a window."""
        return any(matters([self.laws[effect.id]]))

    def _begun_freely(self) -> list[int]:
        """Runs with windows whose starts are free: of free runs all."""
        return [i for i, r in enumerate(self.rows) if isinstance(r, FreeRun)]

    def _start_slopes(self, theta, which: Sequence[int]) -> dict[int, np.ndarray]:
        """By run what each number (numbers, rows) of its windows' starts and pasts changes."""
        placed = self.numbers.build(theta, self.numbers.active(theta[None]))[1]
        states = len(self.machine.start({"position": (0.0, 0.0)}))
        free = np.array([True] * states + list(matters([one.law for one in placed])))
        ways = np.eye(len(free))[free]
        made = self._rows(START, which, np.tile(theta, (len(ways), 1)), ways)
        return self._split(ways.T @ made, which)

    def _split(self, rows: np.ndarray, which: Sequence[int]) -> dict[int, np.ndarray]:
        """Rows (k, rows) by run."""
        ends = np.cumsum([self.rows[i].count for i in which])[:-1]
        return dict(zip(which, np.split(rows, ends, axis=1), strict=True))

    def _moved_starts(self, theta, which: Sequence[int]) -> bool:
        """Move the starts by one step of Gauss and Newton; False where next to nothing is gained.

        A window whose squares grow by it takes a part of the step, or keeps its start.
        """
        runs = self._free_runs(which)
        slopes, first = self._start_slopes(theta, which), self._left(theta, which)
        least = {i: r.squares(first[i]) for i, r in runs.items()}
        known = {i: r.starts for i, r in runs.items()}
        steps = {
            i: r.better_starts(slopes[i], first[i]) - r.starts for i, r in runs.items()
            if np.all(np.abs(slopes[i]) < 1e100) and np.all(np.abs(first[i]) < 1e100)
        }  # fmt: skip
        best, total = {i: x.copy() for i, x in known.items()}, sum(x.sum() for x in least.values())
        for part in PARTS:
            for i, step in steps.items():
                runs[i].start_at(known[i] + part * step)
            self._batches.clear()
            left = self._left(theta, which)
            for i in steps:
                squares = runs[i].squares(left[i])
                better = squares < least[i]
                best[i][better] = runs[i].starts[better]
                least[i] = np.minimum(squares, least[i])
        for i, r in runs.items():
            r.start_at(best[i])
        self._batches.clear()
        return sum(x.sum() for x in least.values()) < (1 - ENOUGH) * total

    def _free_runs(self, which: Sequence[int]) -> dict[int, FreeRun]:
        """Those of some runs that are simulated."""
        return {i: r for i in which if isinstance(r := self.rows[i], FreeRun)}

    def _left(self, theta, which: Sequence[int]) -> dict[int, np.ndarray]:
        """By run what its rows (rows,) are at a vector of numbers."""
        return {i: x[0] for i, x in self._split(self.raw(theta[None], which), which).items()}

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
        independent = max(len(left) / inflation(self.by_run(left)) - used, 1.0)
        spread = float(left @ left) / len(left) * (1 + used / independent)
        self.floor = max(1.0, float(np.sqrt(spread)))
        self.scale = self.scale * self.floor
        self.inflation = inflation(self.by_run(left))

    def by_run(self, rows: np.ndarray, split: str = "train") -> list[np.ndarray]:
        """Rows (..., rows) of a split by run."""
        counts = [self.rows[i].count for i in self.splits[split]]
        return np.split(rows, np.cumsum(counts)[:-1], axis=-1)

    def left(self, point: Point, split: str) -> list[np.ndarray]:
        """By run of a split its rows (rows,) at a point, in physical units."""
        return self.by_run(self.raw(self.numbers.vector(point)[None], self.splits[split])[0], split)

    def slopes(self, point: Point) -> np.ndarray:
        """Slopes (m, n, n) of the rate at states that the runs pass."""
        return np.asarray(self._slopes(jnp.asarray(self.numbers.vector(point))))

    def margin(self, fit, rival):
        """Of a balance that leaves two laws equal: as its rows say with their noise's colour.

        Where the held-out rows say so too.
        """
        margin = rival.cost - fit.cost
        if self.steps_in_time or abs(margin) > self.settings.equal:
            return margin
        train, held = in_colour(self, rival).above(in_colour(self, fit))
        return train if train * held > 0 else margin

    def astray(self, fit):
        """Free runs whose starts stand for what is missing: far from the noise, all of them."""
        return self.steps_in_time and fit.chi2 > self.settings.nearly * self.dof("train")

    def on_its_own(self, fit):
        """With its own starts: what a late sensor shows of the past is free only there.

        From where the floor's refit of the same laws ended too: the better of both.
        """
        runs = [r for i in self._begun_freely() if isinstance(r := self.rows[i], FreeRun)]
        if not runs:
            return super().on_its_own(fit)
        starts = [r.starts for r in runs]
        bases, open_ = dict(self._starts), self._undecided
        begun, made = [self.remembered(fit.point), fit.point], []
        for point in begun[begun[0] is begun[1] :]:
            made.append(super().on_its_own(turned(self, dataclasses.replace(fit, point=point))))
            for r, moved in zip(runs, starts, strict=True):
                r.start_at(moved)
            self._batches.clear()
            if not self.astray(made[-1][0]):
                break
        self._starts, self._undecided = bases, open_
        return min(made, key=lambda x: x[0].cost)

    @property
    def steps_in_time(self) -> bool:
        """Whether rows are those of free runs: no law is a multiple of its tangent there."""
        return any(isinstance(r, FreeRun) for r in self.rows)

    def bends(self, id):
        """In free runs every law of the machine, not those of its sensors."""
        return self.steps_in_time and self.laws[id].port != "sensor"

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

    def floor_said(self) -> str:
        """The floor in words."""
        return (
            f"What no law of the library explains on the train runs is {self.floor:.3g} times the "
            f"sensor's noise, and {self.inflation:.3g} of its rows say as much as one: each effect "
            "had to stand against that."
        )

    def residuals(self, points, split):
        self.work += len(points) * len(self.splits[split]) / max(1, len(self.splits["train"]))
        if not points:
            return []
        thetas = np.stack([self.numbers.vector(p) for p in points])
        return list(self.whitened(self.raw(thetas, self.splits[split]), split))

    def tangents(self, point: Point, free) -> np.ndarray:
        """d residual / d (u, free numbers) on the train runs, exact."""
        theta, slopes = self.numbers.vector(point), self.numbers.slopes(point)
        ways = [slope * np.eye(self.numbers.size)[k] for k, slope in enumerate(slopes)]
        slots = self.numbers.slots_of(point.effects)
        for f in free:
            way = np.zeros(self.numbers.size)
            way[slots[f.effect].part(f.key).start + (f.index or 0)] = 1.0
            ways.append(way)
        self.work += len(ways)
        if not ways:  # nothing is uncertain and no effect is there
            return np.zeros((sum(self.rows[i].count for i in self.splits["train"]), 0))
        table = self.pushed(np.tile(theta, (len(ways), 1)), np.stack(ways), self.splits["train"])
        return self.whitened(table, "train").T

    def dof(self, split):
        return max(1, round(sum(self.rows[i].count for i in self.splits[split]) / self.inflation))

    # candidates ---------------------------------------------------------------------------------

    def candidates(self, point):
        orders = {}
        if any("order" in self.laws[i].parameters for i, _ in self.places):
            orders = strongest_orders(self, point)
        names = [e.name for e in point.effects]
        candidates = machine_candidates(self, self.scales, orders)
        return [c for c in candidates if names.count(c.name) < ROOM]

    def balanced(self) -> "OdeModel":
        """The same machine and runs by the balance of accelerations, with the laws of lines alone.

        Its rows weigh as much as what the machine without effects leaves there.
        """
        laws = {i: x for i, x in self.laws.items() if i in self.repeats}
        places = [(i, place) for i, place in self.places if i in laws]
        made = OdeModel(self.machine, self.priors, self.runs, laws, places, Balance, self.noise,
                        self.numbers.stated)  # fmt: skip
        fit = refit(made, Point(np.zeros(len(self.priors))))
        made.scale = made.scale * max(1.0, float(np.sqrt(fit.chi2 / made.dof("train"))))
        return made

    def balance(self, i: int) -> tuple[Balance, Callable]:
        """The balance of run `i`, and its values at a vector of numbers."""
        if i not in self._balances:
            rows = self.rows[i]
            if not isinstance(rows, Balance):
                rows = Balance(self.numbers, self.runs[i])
            program, one = self._programs(rows)[0], np.ones(1, int)
            self._balances[i] = (
                rows,
                lambda t: _lanes(program, self.numbers, rows.data, one, 1, t[None])[0],
            )
        return self._balances[i]

    @property
    def resolution(self) -> float:
        """Orders that the travel of the train runs tells apart: 2 pi over it, 1/rad or 1/m."""
        q = np.concatenate([self.runs[i].outputs["position"] for i in self.splits["train"]])
        return 2 * np.pi / (float(np.ptp(q)) or 1.0)

    @property
    def cutoff(self) -> float:
        """Hz, of the low pass that gives measured speeds."""
        return self.runs[0].cutoff

    def columns(self, point, candidates):
        theta, thetas, ways, finite = self.numbers.vector(point), [], [], []
        base = None
        for c in candidates:
            slot = self._slot_beside(point, c)
            for placed in c.columns:
                here, way = theta.copy(), np.zeros_like(theta)
                here[slot.begin] = 1.0
                strong = [k for k, p in slot.law.parameters.items() if p.linear]
                for key, p in slot.law.parameters.items():
                    value = np.asarray(getattr(placed.law, key), float)
                    if p.linear:
                        way[slot.part(key)] = value
                        here[slot.part(key)] = 0.0
                    else:
                        here[slot.part(key)] = value
                finite.append(not strong)
                thetas.append(here)
                ways.append(way)
        thetas, ways, finite = np.stack(thetas), np.stack(ways), np.array(finite)
        which = self.splits["train"]
        out = np.zeros((len(thetas), sum(self.rows[i].count for i in which)))
        if (~finite).any():
            out[~finite] = -self.whitened(
                self.pushed(thetas[~finite], ways[~finite], which), "train"
            )
        if finite.any():
            base = self.raw(theta[None], which)
            out[finite] = self.whitened(base - self.raw(thetas[finite], which), "train")
        out[~np.all(np.abs(out) < 1e100, axis=1)] = 0.0
        return out

    def _slot_beside(self, point: Point, candidate: Candidate):
        """The slot that a candidate takes beside the point's effects."""
        taken = self.numbers.slots_of(point.effects)
        for slot in self.numbers.slots:
            if slot not in taken and (slot.law.id, slot.place) == (candidate.id, candidate.place):
                return slot
        for slot in self.numbers.slots:  # of the effect itself: its own slot
            if (slot.law.id, slot.place) == (candidate.id, candidate.place):
                return slot
        raise ValueError(candidate.name)

    def plainness(self, effect: Effect) -> float:
        """Share of its gain that a law keeps when laws are ranked: fewer numbers come first."""
        numbers = sum(k != "width" for k in effect.values)
        return 1 - SIMPLER * (numbers + (effect.id not in EFFECTS))

    def free(self, point):
        """Gains within half of what is stated, orders and times about where they begin."""
        out = []
        for f in free_numbers(self, point):
            value = point.effects[f.effect].values[f.key]
            low, high = f.low, f.high
            if f.key == "g":
                low, high = -BOUND, BOUND
            if f.key == "order":  # over few turns a line is wide
                wide = max(ORDER * float(value), self.resolution / 2)
                low, high = max(float(value) - wide, 0.0), float(value) + wide
            if f.key in ("width", "speed"):  # as narrow as shows, as wide as the speeds
                low, high = 0.005 * self.scales.speed, 2.0 * self.scales.speed
            if f.key == "limit":
                low, high = float(value) / 2, float(value) * 2
                if self.laws[point.effects[f.effect].id].port == "actuator":
                    high = max(float(self.scales.torques[-1]), float(value))
            if f.key in ("tau", "delay"):
                low, high = max(low, float(value) / 30), min(high, float(value) * 30)
            out.append(type(f)(f.effect, f.key, f.index, low, high))
        return out


def _names(point: Point) -> list[str]:
    """Names of the effects of a point, those of several lines as often as there are lines."""
    return sorted(e.name for e in point.effects)


def _compiled(rows, only: frozenset[int] | None):
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
                return rows.from_starts(t, d, steps, shift, only, used(on))

            return jax.jvp(moved, (jnp.zeros_like(w),), (w,))[1]

        return rows.each(one, data, thetas, ways)

    return value, tangent, start


def _slopes_along(numbers: Numbers, runs: Sequence[OdeRun], count: int = 24):
    """Slopes of the rate at a vector of numbers, at states that the runs pass and at rest there."""
    states, inputs = [], []
    for run in runs[:8]:
        q, v, _ = smoothed(run.outputs["position"], run.step, run.cutoff)
        for i in np.linspace(0, len(q) - 1, max(2, count // len(runs[:8]))).astype(int):
            for speed in (v[i], 0.0):
                states.append((q[i], speed))
                inputs.append({k: x[i] for k, x in run.inputs.items()})
    stacked = {k: jnp.asarray([u[k] for u in inputs]) for k in inputs[0]}
    q, v = map(jnp.asarray, np.array(states).T)

    @jax.jit
    def slopes(theta):
        machine, placed = numbers.build(theta)

        def state(q, v):
            return jnp.stack([jnp.asarray(x, float) for x in machine.start({"position": (q, v)})])

        return slopes_of(machine, placed, jax.vmap(state)(q, v), stacked)

    return slopes


def _lanes(
    program, numbers: Numbers, data, steps: np.ndarray, lanes: int, *tables: np.ndarray
) -> np.ndarray:
    """A program over tables (points, ...) in chunks of `lanes` points: (points, rows).

    Points that need about as many `steps` run side by side.
    """
    return _ended(_begun(program, numbers, data, steps, lanes, *tables))


class _Chunk(NamedTuple):
    """Rows (lanes, rows) that may still be computed, of the points `here`."""

    here: np.ndarray
    made: jax.Array


def _begun(program, numbers: Numbers, data, steps, lanes: int, *tables) -> list[_Chunk]:
    """The chunks of `_lanes`, not waited for: XLA computes as many at a time as there are cores."""
    order, out = np.argsort(steps, kind="stable"), []
    for begin in range(0, len(order), lanes):
        here = order[begin : begin + lanes]
        padded = [t[np.resize(here, lanes)] for t in tables]
        on, most = jnp.asarray(numbers.on(padded[0])), jnp.asarray(int(steps[here].max()))
        out.append(_Chunk(here, program(data, most, on, *map(jnp.asarray, padded))))
    return out


def _ended(chunks: Sequence[_Chunk]) -> np.ndarray:
    """Rows (points, rows) of chunks, in the order of their points."""
    rows = np.concatenate([np.asarray(made)[: len(here)] for here, made in chunks])
    back = np.argsort(np.concatenate([here for here, _ in chunks]))
    return rows[back]
