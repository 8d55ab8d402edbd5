"""The sphere on wheels as a model of the diagnosis."""

import dataclasses
import functools
from collections.abc import Iterator, Sequence
from typing import cast

import numpy as np

from ...laws import AbstractLaw
from ...recording import channels
from ...rig import Placed, Rig
from .._search import (
    STEPPED,
    AbstractModel,
    Candidate,
    Effect,
    Free,
    Level,
    Point,
    deviance,
    free_numbers,
    number,
    strengths,
    white_level,
)
from .._settings import SETTINGS
from .._threads import each
from ._candidates import (
    Context,
    candidates,
    held_law,
    held_sizes,
    rig_priors,
    with_parameters,
    with_sensors,
)
from ._elastic import LANES, elastic_number
from ._noise import ELASTIC_CHANNELS, DataRows, RunWaves, TurningNoise, rotation_channels
from ._preparation import by_parts, readmitted, said_of_outliers, split_runs, with_start_angles
from ._signatures import Linearisation, base_of, signatures
from ._where import strongest_orders
from .clocks import READ_LATE, beside_mean, clock_priors, with_clocks
from .lines_together import points_with_lines
from .machine import Machine
from .own_clocks import fit_clocks
from .runs import COARSE, FINE, STEPS, Run, with_noise
from .tree_hash import digest

BUDGET = SETTINGS.rig_model.budget
LINEAR_COST = SETTINGS.rig_model.linear_cost
ENCODER_STEP = SETTINGS.rig_model.encoder_step
TOGETHER = 32  # signatures that are whitened together
TOLD = 4 * TOGETHER  # after so many the progress line goes on
FLOOR_LINES = SETTINGS.rig_model.floor_lines
EXACT_COST = SETTINGS.rig_model.exact_cost
SHUFFLED_BLOCKS = SETTINGS.model.shuffled_blocks
LEAST_LAG = SETTINGS.rig_model.least_lag
WIDEST_FRICTION = SETTINGS.rig_model.widest_friction
LIMIT_QUANTILE = SETTINGS.rig_model.limit_quantile
NEAR_ERRORS = SETTINGS.rig_model.near_errors


class RigModel(AbstractModel):
    """A rig, its runs and their noise; `splits` gives the runs' indices by role."""

    budget = BUDGET
    ranking = "first train"
    repeats = frozenset({"motor-ripple", "current-ripple"})
    frozen_keys = frozenset({"roller", "exponent", "modulus"})

    def __init__(self, rig: Rig, runs: list[Run], noise: dict[str, float],
                 laws: dict[str, type[AbstractLaw]], window: float = 1.0):  # fmt: skip
        self.rig, self.laws, self.noise, self.window = rig, laws, noise, window
        self.groups = tuple(
            g for g in ("dR", "theta", "Omega", "a") if any(g in r.outputs for r in runs)
        )
        self.splits = split_runs(runs)
        train = [runs[i] for i in self.splits["train"]]
        # names by group of the fitted runs that measured it
        self.fitted = {
            g: [*dict.fromkeys(r.name for r in train if g in r.outputs)] for g in self.groups
        }
        stated = rig_priors(rig)
        clocks = clock_priors(self.groups, {p.name for p in stated}, self.fitted)
        self.priors, self._clocks = [*clocks, *stated], len(clocks)
        self.splits["first train"] = self.splits["train"][:1]
        # noise of the rotation that was told last: the basis and the point that it hangs on, and it
        self._turning: tuple[object, object, list[dict[str, Level]]] = None, None, []
        self._about: Point | None = None  # of the last `rebase`
        self._bases: list[Linearisation] = []  # between a choice of candidates and their signatures
        longest = max((run.samples for run in runs), default=0)
        self._runs = [dataclasses.replace(run, longest=longest) for run in runs]

    def rig_at(self, point: Point, clocks: bool = True) -> Rig:
        """The rig with calibrated parameters and the point's effects, read by its loggers' clocks.

        A group whose delay is among the effects has no offset beside it.
        """
        known = {p.name: p.at(float(u)) for p, u in zip(self.priors, point.u, strict=True)}
        late = {e.place for e in point.effects if e.id == "sensor-delay"}
        clocked = self._offsets({p.name: known.pop(p.name) for p in self.priors[: self._clocks]})
        paths, values = tuple(known), [*known.values()]
        rig = with_sensors(with_parameters(self.rig, paths, np.array(values)), paths, values)
        if clocks:
            offsets = {g: self._by_each_run(g, d) for g, d in clocked.items() if g not in late}
            rig = with_clocks(rig, offsets, always=bool(self.unfitted))
        for effect in point.effects:
            law = self.laws[effect.id](**{k: number(v) for k, v in effect.values.items()})
            rig = rig.add(law, effect.place)
        return rig

    @functools.cached_property
    def unfitted(self) -> list[int]:
        """Runs that are not fitted, nor a part of which is."""
        names = {self._runs[i].name for i in self.splits["train"]}
        return [i for i in self.splits["held-out"] if self._runs[i].name not in names]

    def _offsets(self, numbers: dict[str, float]) -> dict[str, np.ndarray]:
        """By group the offsets (fitted runs that measured it,) of its clock, s."""
        own = {g: [x for name, x in numbers.items() if name.split(".")[1] == g] for g in READ_LATE}
        return {g: beside_mean(len(some)) @ some for g, some in own.items() if some}

    def _by_each_run(self, group: str, offsets: np.ndarray) -> float | np.ndarray:
        """Offsets of the fitted runs as one by run, the mean where it is not fitted; of one run, or
        where all are alike, that."""
        if not np.ptp(offsets):
            return float(offsets[0])
        known = dict(zip(self.fitted[group], offsets, strict=True))
        return np.array([known.get(run.name, offsets.mean()) for run in self._runs])

    def free(self, point):
        """Where a number's end would make its law another one, its range ends before.

        A relaxation faster than the steps in time cannot be told from a damper, nor a dry friction
        that does not saturate within the speeds of the runs from a viscous one.  A law that the
        rig has at the same place may be too large there by all of its size, and has its width.
        """
        return [
            dataclasses.replace(f, **self._ends(point, f)) for f in free_numbers(self, point)
            if f.key != "width" or self._held(point.effects[f.effect]) is None
        ]  # fmt: skip

    def _held(self, effect: Effect) -> AbstractLaw | None:
        """The same law that the rig has at the place of an effect already."""
        return held_law(self.rig, effect.id, effect.place)

    def _ends(self, point: Point, free: Free) -> dict[str, float]:
        """Ends of a number's range that the runs set, or the rig."""
        if free.key == "tau":
            return {"low": LEAST_LAG * max(run.step for run in self.machine.runs)}
        held = held_sizes(self._held(point.effects[free.effect]))
        if free.key in held:
            return {"low": free.low - held[free.key]}
        port = self.laws[point.effects[free.effect].id].port
        if free.key != "width" or port not in self._widest:
            return {}
        return {"high": max(min(free.high, self._widest[port]), 2 * free.low)}

    @functools.cached_property
    def _widest(self) -> dict[str, float]:
        """By port the widest friction law that the runs can tell, rad/s.

        The sphere rolls at the wheels' speed times the ratio of the radii.
        """
        motions = self.machine.motions(self.machine.rig).values()
        shaft = max(float(np.abs(m.speed).max()) for m in motions) * WIDEST_FRICTION
        ratio = float(np.max(self.rig.wheels.radius)) / float(self.rig.sphere.radius)
        return {"shaft": shaft, "rolling": shaft * ratio}

    @functools.cached_property
    def _pace(self) -> float:
        """RMS of the wheels' speeds in all runs, rad/s; 1 where they stand."""
        motions = self.machine.motions(self.machine.rig).values()
        return float(np.sqrt(np.mean([np.mean(m.speed**2) for m in motions]))) or 1.0

    def residuals(self, points, split):
        share = len(self.splits[split]) / len(self.splits["train"])
        unlike = {(p.u[self._clocks :].tobytes(), repr(p.effects)): p for p in points}
        self.work += share * sum(
            1.0 if self.needs_stepping(p.effects) else LINEAR_COST for p in unlike.values()
        )
        steps = COARSE if split == self.ranking else STEPS
        return self.machine.residuals([self.rig_at(p) for p in points], self.splits[split], steps)

    def prior_tangents(self, point, split):
        return self.elastic_tangents(point, self.splits[split])

    def elastic_tangents(self, point: Point, which: Sequence[int]) -> dict[int, np.ndarray]:
        """By index d residual / d u on the runs `which`, by the contacts' and mounts' numbers.

        Their stiffness and damping, where these enter linearly; empty where they do not.
        """
        u = dict(enumerate(map(float, point.u)))
        numbers = {
            k: number for k in u if (number := elastic_number(self.rig, self.priors[k].name))
        }
        if not numbers:
            return {}
        rows = self.machine.elastic_tangents(self.rig_at(point), [*numbers.values()], [*which])
        if rows is None:
            return {}
        self.work += EXACT_COST * LINEAR_COST * len(rows) * len(which) / len(self.splits["train"])
        slopes = [self.priors[k].slope(u[k]) for k in numbers]
        return {k: slope * row for k, slope, row in zip(numbers, slopes, rows, strict=True)}

    def aside(self):
        return self.machine.aside()

    def rest(self):
        self.machine.forget()
        self._bases = []

    def dof(self, split):
        return sum(self.machine.rows[i].used for i in self.splits[split])

    def _by_run(
        self, vector: np.ndarray, which: Sequence[int]
    ) -> Iterator[tuple[DataRows, np.ndarray]]:
        """The data rows of every run of `which`, and its part of a vector (rows, ...) of all."""
        rows = [self.machine.rows[i] for i in which]
        ends = np.cumsum([r.size for r in rows])
        return zip(rows, np.split(vector, ends)[:-1], strict=True)

    def shuffled(self, residual, seed, blocks=SHUFFLED_BLOCKS):
        """Shuffled in time, run by run, with all channels of a moment kept together."""
        rng, out = np.random.default_rng(seed), []
        for rows, own in self._by_run(residual, self.splits["train"]):
            elastic, rotation = rows.split(own)
            pieces = np.array_split(np.roll(np.arange(rows.samples), rng.integers(rows.samples)),
                                    blocks)  # fmt: skip
            pieces = [pieces[k] for k in rng.permutation(blocks)]
            order = np.concatenate(pieces)
            signs = np.repeat(rng.choice([-1.0, 1.0], blocks), [len(p) for p in pieces])[:, None]
            out += [(signs * elastic[order]).ravel(), (signs * rotation[order]).ravel()]
        return np.concatenate(out)

    def moments(self, split):
        runs, times = [], []
        for i in self.splits[split]:
            rows, time = self.machine.rows[i], self.machine.runs[i].time
            wide = rows.elastic.shape[1], rows.rotation.shape[1]
            runs.append(np.full(rows.size, i))
            times += [np.repeat(time - time[0], n) for n in wide]
        return np.concatenate(runs), np.concatenate(times)

    def parts(self):
        """The elastic channels, and the rotation."""
        sizes = [
            (rows.elastic.size, rows.rotation.size)
            for rows in (self.machine.rows[i] for i in self.splits["train"])
        ]
        elastic = np.concatenate([np.repeat([True, False], size) for size in sizes])
        return [elastic, ~elastic]

    def group_rms(self, residual, split):
        squares: dict[str, list[float]] = {}
        for rows, own in self._by_run(residual, self.splits[split]):
            elastic, rotation = rows.split(own)
            parts = {"dR": (elastic, rows.elastic, slice(0, 3)),
                     "a": (elastic, rows.elastic, slice(3, 6)),
                     "Omega": (rotation, rows.rotation, slice(0, 3)),
                     "theta": (rotation, rows.rotation, slice(3, None))}  # fmt: skip
            for group, (values, weight, which) in parts.items():
                total = squares.setdefault(group, [0.0, 0.0])
                total[0] += float(np.sum(values[:, which] ** 2))
                total[1] += float(np.sum(weight[:, which] > 0))
        return {g: float(np.sqrt(s / n)) for g, (s, n) in squares.items() if n > 0}

    def renoised(self, levels: Sequence[dict[str, Level]]) -> "RigModel":
        """The same model weighed by other noise; `levels` by train and then held-out run."""
        runs = list(self.machine.runs)
        order = [*self.splits["train"], *self.splits["held-out"]]
        for i, level in zip(order, levels, strict=True):
            runs[i] = with_noise(runs[i], level, self.rig.size)
        return RigModel(self.rig, runs, self.noise, self.laws, self.window)

    def readmitted(self, point: Point) -> tuple["RigModel", list[str]] | None:
        """The same model with samples back that had been left out and stand out no longer.

        Beside the point; and what is to be said of these, and of others.  None where there is none.
        """
        runs, said = readmitted(self.machine, self.rig_at(point))
        if not said:
            return None
        model = RigModel(self.rig, runs, self.noise, self.laws, self.window)
        return model, [*said_of_outliers(runs), *said]

    def parted(self) -> tuple["RigModel", list[str]] | None:
        """The same model of fitted runs by parts, and what is to be said of these.

        None where every one of them is too short.
        """
        runs, said = by_parts(self.machine.runs)
        if not said:
            return None
        return RigModel(self.rig, runs, self.noise, self.laws, self.window), said

    @functools.cached_property
    def machine(self) -> Machine:
        """The machine and its runs, about the stated rig until `rebase`."""
        return Machine(self.rig, self._runs, self.noise, self.window)

    def rebase(self, point):
        """Prepare about the point; where no machine was made yet, make it about the point at once.

        Where a run begins rolling the machine is made about the stated rig first, which tells the
        state at its start.  Start angles of wheels without encoder are estimated with the point's
        laws; their uncertainty enters the rows' covariance through the machine without laws.
        """
        about, self._about = self.rig_at(point), point
        if "machine" in vars(self) or any(run.rolling_start(self.noise) for run in self._runs):
            self.machine.rebase(about)
        else:
            self.machine = Machine(self.rig, self._runs, self.noise, self.window, about)
        runs = self.machine.runs
        if with_start_angles(self.machine, about) is not runs:
            self.machine.rebase(about)
        for i in self.unfitted:
            fit_clocks(self.machine, about, i)

    def based_near(self, fit):
        """Not so where a run begins rolling: each time the data tell its first state better."""
        if self._about is None or repr(self._about.effects) != repr(fit.point.effects):
            return False
        if self.machine.rolls:
            return False
        P = len(fit.point.u)
        errors = np.sqrt(np.diag(fit.covariance)[:P])
        return bool(np.all(np.abs(fit.point.u - self._about.u) <= NEAR_ERRORS * errors))

    def unsettled(self, point):
        """Laws at contacts and mounts change the elastic state in which a run begins rolling.

        Sensors that bend what they read change what the readings say of it.
        """
        bent = any(
            self.laws[e.id].port == "sensor" and not strengths(self.laws[e.id])
            for e in point.effects
        )
        return self.machine.rolls and (bent or self.needs_stepping(point.effects))

    def as_noise(self, less, fit, effect):
        """A drift is straight and alike in all runs; a channel that wanders looks so in one.

        The residuals with and without the drift are each weighed under the noise colour that suits
        them best.  Without it, the likelier of two points counts: the refit, and the fit with the
        drift alone removed (the refit, under another colour, may have moved the other numbers).
        """
        if effect.id != "sensor-drift":
            return False
        others = [e for e in fit.point.effects if e.name != effect.name]
        points = fit.point, less.point, fit.point.with_effects(*others)
        if effect.place not in ELASTIC_CHANNELS:
            first = self.turning_noise(points[0])
            beside = [self.turning_noise(p, first.levels).likeliest[1] for p in points[1:]]
            return min(beside) - first.likeliest[1] < self.settings.equal_margin
        channel = ELASTIC_CHANNELS.index(effect.place)
        straight, *drifting = (self._whole(p, channel) for p in points)
        level = float(np.median([white_level(x)[0] for x in straight]))
        left = [deviance([x / level for x in part], self._steps) for part in (straight, *drifting)]
        return min(left[1:]) - left[0] < self.settings.equal_margin

    def turning_noise(
        self, point: Point, levels: Sequence[np.ndarray] | None = None
    ) -> TurningNoise:
        """The likeliest noise of Omega and theta in all runs at a point; `levels`: see there."""
        parts: dict[int | str, list[tuple[DataRows, np.ndarray]]] = {}
        for split in both(self.splits):
            (residual,) = self.machine.residuals([self.rig_at(point)], split)
            for i, part in zip(split, self._by_run(residual, split), strict=True):
                parts.setdefault(whole_of(self.machine.runs[i], i), []).append(part)
        runs = zip(parts.values(), self._steps, strict=True)
        return TurningNoise(each(lambda run: RunWaves.of(*run), runs), levels)

    def turning_levels(self, point: Point) -> list[dict[str, Level]]:
        """By train and then held-out run the noise of the rotation's channels that has a colour.

        None where they are whitened in time already.
        """
        which = [*self.splits["train"], *self.splits["held-out"]]
        if any(self.machine.rows[i].turning is not None for i in which):
            return []
        asked = point.u.tobytes(), repr(point.effects)
        if self._turning[0] is not self.machine.basis or self._turning[1] != asked:
            self._turning = self.machine.basis, asked, self._turning_levels(point, which)
        return self._turning[2]

    def turning_noise_of(self, point: Point, i: int) -> dict[str, Level]:
        """`turning_levels` of run `i`."""
        every = dict(zip([*self.splits["train"], *self.splits["held-out"]],
                         self.turning_levels(point), strict=False))  # fmt: skip
        return every.get(i, {})

    def _turning_levels(self, point: Point, which: Sequence[int]) -> list[dict[str, Level]]:
        names = rotation_channels(self.rig.size)
        keys = [whole_of(self.machine.runs[i], i) for i in which]
        shown = dict(zip(dict.fromkeys(keys), self.turning_noise(point).shown(names), strict=True))
        return [shown[key] for key in keys]

    @property
    def _steps(self) -> list[float]:
        """Sampling steps of the runs in the order of `_whole`, s."""
        every = dict.fromkeys([*self.splits["train"], *self.splits["held-out"]])
        runs = self.machine.runs
        return [*{whole_of(runs[i], i): runs[i].step for i in every}.values()]

    def _whole(self, point: Point, channel: int) -> list[np.ndarray]:
        """What is left of an elastic channel by run, one that plays both roles put together.

        In assumed sigma, not whitened in time; zero where nothing counts.
        """
        out: dict[object, np.ndarray] = {}
        for split in both(self.splits):
            (residual,) = self.machine.residuals([self.rig_at(point)], split)
            for i, (rows, own) in zip(split, self._by_run(residual, split), strict=True):
                column, key = rows.unwhitened(own)[:, channel], whole_of(self.machine.runs[i], i)
                out[key] = out.get(key, 0.0) + np.nan_to_num(column)
        return [*out.values()]

    def opening(self, share):
        """Every run up to the moment at which its wheels have rolled `share` of their way."""
        motions, cut = self.machine.motions(self.machine.rig), []
        for i, run in enumerate(self.machine.runs):
            way = np.cumsum(np.abs(motions[i].speed[::FINE]).sum(axis=1))
            cut.append(run.first(int(np.searchsorted(way, share * way[-1])) + 1))
        return RigModel(self.rig, cut, self.noise, self.laws, self.window)

    def bases(self, point: Point, split: str = "train"):
        """Base runs at a point, with what each port feels."""
        rig, which = self.rig_at(point), self.splits[split]
        predicted = self.machine.elastic([rig], which)[0]
        return [base_of(self.machine, rig, i, p) for i, p in zip(which, predicted, strict=True)]

    def candidates(self, point):
        return self.candidates_beside(point, None)

    def candidates_beside(self, point, taken):
        self._bases = self.bases(point)
        rms = np.sqrt(
            np.mean([np.mean(b.mount.deflection**2, axis=0) for b in self._bases], axis=0)
        )
        longest = max(self.machine.runs[i].samples for i in self.splits["train"])
        torques = np.max([np.abs(b.torque).max(axis=0) for b in self._bases], axis=0)
        context = Context(self.rig, self.groups, rms, self._lines(point), longest,
                          self._orders(point, taken), torques, self._tops, self._pace)  # fmt: skip
        return candidates(context, self.laws)

    def _orders(
        self, point: Point, taken: np.ndarray | None
    ) -> dict[str, dict[str, tuple[list[float], int]]]:
        """By law and wheel the orders that stand out in what is left of the train runs."""
        (rest,) = self.residuals([point], "train")
        rows, left = self.of_rotation(rest, "train")
        beside = None if taken is None else self.rotation_taken(taken)
        orders = strongest_orders(self._bases, left, rows, beside)
        return {k: dict(zip(self.rig.names, v, strict=True)) for k, v in orders.items()}

    def of_rotation(self, rest: np.ndarray, split: str) -> tuple[list[DataRows], list[np.ndarray]]:
        """By run of a split its rows, and the part (samples, 3 + n) of `rest` in the rotation's.

        Such that its inner products with white lines are those of `rest` with whitened ones.
        """
        parts = list(self._by_run(rest, self.splits[split]))
        rows, left = [r for r, _ in parts], [np.array(r.split(own)[1]) for r, own in parts]
        for r, own in zip(rows, left, strict=True):  # W x . s, for x . W s of lines that are white
            r.bleach_rotation(own.reshape(1, -1))
        return rows, left

    def rotation_taken(self, taken: np.ndarray) -> list[np.ndarray]:
        """By fitted run the part of directions (train rows, k) in the rows of the rotation."""
        return [own[r.elastic.size :] for r, own in self._by_run(taken, self.splits["train"])]

    def with_lines(self, fit, id, place, more=1):
        return points_with_lines(self, fit, id, place, more)

    @functools.cached_property
    def _tops(self) -> dict[str, float]:
        """By channel the size above which few of its readings lie."""
        out = {}
        for group in self.groups:
            values = np.concatenate([
                self.machine.runs[i].outputs[group] for i in self.splits["train"]
                if group in self.machine.runs[i].outputs
            ] or [np.zeros((0, 0))])  # fmt: skip
            for name, column in zip(channels(group, self.rig.size), values.T, strict=False):
                seen = np.abs(column[np.isfinite(column)])
                out[name] = float(np.quantile(seen, LIMIT_QUANTILE)) if len(seen) else 0.0
        return out

    def _lines(self, point: Point) -> tuple[float, ...]:
        """Frequencies (Hz) of the strongest lines left in `a` (else dR) of the train runs."""
        (rest,) = self.residuals([point], "train")
        train = [self.machine.runs[i] for i in self.splits["train"]]
        size = 1 << int(np.ceil(np.log2(max(run.samples for run in train))) + 2)
        grid = np.fft.rfftfreq(size, min(run.step for run in train))
        offset, spectra = 0, np.zeros(len(grid))
        for i, run in zip(self.splits["train"], train, strict=True):
            rows = self.machine.rows[i]
            elastic, _ = rows.split(rest[offset : offset + rows.size])
            offset += rows.size
            use = elastic[:, 3:] if np.any(elastic[:, 3:]) else elastic[:, :3]
            power = np.sum(np.abs(np.fft.rfft(use, size, axis=0)) ** 2, axis=1)
            spectra += np.interp(grid, np.fft.rfftfreq(size, run.step), power, right=0.0)
        inner = (spectra[1:-1] > spectra[:-2]) & (spectra[1:-1] >= spectra[2:])
        peaks = np.flatnonzero(inner) + 1
        peaks = peaks[grid[peaks] > 0.5]
        best = peaks[np.argsort(spectra[peaks])[::-1]]
        kept: list[float] = []
        for k in best:  # side lobes of a line are not lines
            if all(abs(grid[k] - f) > 0.5 for f in kept):
                kept.append(float(grid[k]))
            if len(kept) == FLOOR_LINES:
                break
        return tuple(kept)

    def columns(self, point, candidates: Sequence[Candidate]):
        """In float32, as there are many; the start's directions are taken off in float64 first."""
        placed = [cast(Placed, p) for c in candidates for p in c.columns]
        # those that the candidates were chosen at; they are large, and kept no longer
        bases, self._bases = self._bases or self.bases(point), []
        cut = np.cumsum([0] + [self.machine.rows[b.index].size for b in bases])
        table = np.empty((len(placed), cut[-1]), np.float32)
        sums = sums_of(placed)
        shifts = [j for j, p in enumerate(placed) if moves_motion(p.law) and j not in sums]
        if shifts:  # first, while the table takes no room yet
            table[shifts] = self._by_differences(point, [placed[j] for j in shifts])
        alone = [j for j in range(len(placed)) if j not in sums and j not in shifts]

        def fill(k: int) -> None:
            base, part = bases[k], table[:, cut[k] : cut[k + 1]]
            rows = self.machine.rows[base.index]
            for first in range(0, len(alone), TOGETHER):
                if k == 0 and first % TOLD == 0:
                    self.tell(f"{len(shifts) + first} of {len(shifts) + len(alone)} signatures")
                few = alone[first : first + TOGETHER]
                exact = np.empty((len(few), rows.size))
                both = signatures(base, [placed[j] for j in few])
                for row, tables in zip(exact, both, strict=True):
                    rows.write(row, *tables)
                rows.take_off(exact)
                part[few] = exact
            for j, ones in sums.items():
                part[j] = np.sum(part[ones], axis=0, dtype=float)

        each(fill, range(len(bases)))
        return table

    def _by_differences(self, point: Point, placed: Sequence[Placed]) -> np.ndarray:
        """Signatures (laws, rows) of laws that move the very motion behind the runs."""
        rig = self.rig_at(point)
        before = self._coarse([rig])
        # one by one: each has a motion of its own, which is large
        return np.concatenate([self._differences(rig, before, [p], [ENCODER_STEP]) for p in placed])

    def through_laws(self, point, candidates, steps):
        """Uses the coarse step of the ranking: the step error nearly cancels in the difference."""
        placed = [cast(Placed, p) for c in candidates for p in c.columns]
        sizes, rig = np.concatenate(steps), self.rig_at(point)
        self.work += len(placed)
        alike: dict[type | None, list[int]] = {}  # laws of one class are stepped side by side
        for j, p in enumerate(placed):
            alike.setdefault(type(p.law) if p.law.port in STEPPED else None, []).append(j)
        before = self._coarse([rig])
        columns = np.empty((len(placed), before.shape[1]))
        for every in alike.values():
            for some in (every[k : k + LANES] for k in range(0, len(every), LANES)):
                laws = [placed[j] for j in some]
                columns[some] = self._differences(rig, before, laws, sizes[some])
        return np.split(columns, np.cumsum([len(c.columns) for c in candidates])[:-1])

    def _differences(self, rig: Rig, before: np.ndarray, placed: Sequence[Placed], steps):
        """What laws of so many times their strengths change of the rows (laws, rows), over that.

        `before` (1, rows) is of the rig without them; they are evaluated at once.
        """
        rigs = [rig.add(weak(p.law, k), p.place) for p, k in zip(placed, steps, strict=True)]
        return (before - self._coarse(rigs)) / np.asarray(steps)[:, None]

    def _coarse(self, rigs: list[Rig]) -> np.ndarray:
        """Residuals (rigs, rows) on the train runs of rigs that nobody asks for again."""
        with self.machine.aside():
            return np.stack(self.machine.residuals(rigs, self.splits["train"], COARSE))


def both(splits: dict[str, list[int]]) -> list[list[int]]:
    """The train runs and the held-out ones; once where they are the same."""
    return [[*x] for x in dict.fromkeys(map(tuple, (splits["train"], splits["held-out"])))]


def whole_of(run: Run, i: int) -> int | str:
    """What stands for the whole of run `i`: its name where it plays both roles by parts."""
    return i if run.counts is None else run.name


def weak(law: AbstractLaw, factor: float) -> AbstractLaw:
    """The law with its strengths times `factor`."""
    strengths = [k for k, p in law.parameters.items() if p.linear]
    return dataclasses.replace(law, **{k: factor * getattr(law, k) for k in strengths})


def moves_motion(law: AbstractLaw) -> bool:
    """Whether a law changes what the angles say of the motion, not only what the motion causes."""
    return law.port == "radius" or law.places == ("encoder",)


def sums_of(placed: Sequence[Placed]) -> dict[int, list[int]]:
    """By law at several wheels: where the same law stands at each of them alone.

    To first order its signature is the sum of theirs.
    """
    alone, names = {}, [digest(p.law) for p in placed]
    for j, p in enumerate(placed):
        if len(p.wheels) == 1:
            alone[names[j], p.wheels[0]] = j
    out = {}
    for j, p in enumerate(placed):
        parts = [alone.get((names[j], w)) for w in p.wheels] if len(p.wheels) > 1 else []
        if parts and None not in parts:
            out[j] = parts
    return out
