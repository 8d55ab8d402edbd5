"""A machine of a few states with its runs as a model of the diagnosis."""

import dataclasses
from collections.abc import Callable, Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from ...laws import EFFECTS, AbstractLaw
from ...machine import AbstractMachine, PlacedLaw
from .._search import SETTINGS, AbstractModel, Candidate, Effect, Point, Prior, free_numbers
from .candidates import Scales, machine_candidates
from .numbers import Numbers
from .orders import strongest_orders
from .rows import Balance, FreeRun, OdeRun

LANES = 16  # points that are evaluated side by side: one shape, one program
BOUND = 0.5  # a gain that is off by more is no torque constant any more
SIMPLER = 0.01  # share of its gain that each number of a law must be worth
ROOM = 3  # of one law with an order at one place


class OdeModel(AbstractModel):
    """A machine, its runs, the laws that may be missing; rows by one criterion a run.

    `criterion(numbers, run)` gives the rows of a run; `noise` is the sensor's 1-sigma of position.
    """

    budget = 4000.0
    repeats = frozenset({"motor-ripple", "current-ripple"})
    settings = dataclasses.replace(SETTINGS, lead=0.1)
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
    ):
        self.machine, self.priors, self.laws, self.noise = machine, list(priors), laws, noise
        room = [(laws[i], p) for i, p in places]
        room += [(laws[i], p) for i, p in places if "order" in laws[i].parameters] * (ROOM - 1)
        self.places = list(places)
        self.numbers = Numbers(machine, self.priors, room, stated)
        self.runs = list(runs)
        self.rows = [criterion(self.numbers, run) for run in runs]
        splits = {"train": [], "held-out": []}
        for i, run in enumerate(runs):
            splits[run.role].append(i)
        self.splits = splits
        self.scales = Scales.of([runs[i] for i in splits["train"]], runs[0].cutoff)
        self.scale = np.array([max(noise, 1e-300) * r.gain() for r in self.rows])
        self.inflation, self.floor = 1.0, 1.0
        kinds = {rows.kind: _compiled(rows) for rows in self.rows}  # like runs share a program
        self._programs = {i: kinds[rows.kind] for i, rows in enumerate(self.rows)}
        self._starts: dict[int, list] = {}
        self._balances: dict[int, tuple[Balance, Callable]] = {}

    # rows ---------------------------------------------------------------------------------------

    def raw(self, thetas: np.ndarray, which: Sequence[int]) -> np.ndarray:
        """Rows (points, rows) in physical units."""
        out = []
        for i in which:
            value = self._programs[i][0]
            out.append(_lanes(value, self.rows[i].data, thetas))
        return np.concatenate(out, axis=1)

    def pushed(self, thetas: np.ndarray, ways: np.ndarray, which: Sequence[int]) -> np.ndarray:
        """Tangents (points, rows) of the rows at `thetas` along `ways`."""
        out = []
        for i in which:
            tangent = self._programs[i][1]
            out.append(_lanes(tangent, self.rows[i].data, thetas, ways))
        return np.concatenate(out, axis=1)

    def weights(self, split: str) -> np.ndarray:
        """1/sigma of every row of a split, as if `inflation` rows said as much as one."""
        sigma = self.scale * np.sqrt(self.inflation)
        return np.concatenate([
            np.full(self.rows[i].count, 1 / sigma[i]) for i in self.splits[split]
        ])  # fmt: skip

    def whitened(self, table: np.ndarray, split: str) -> np.ndarray:
        """Rows (k, rows) in sigma, less what the windows' free starts can make."""
        out, at = table * self.weights(split), 0
        for i in self.splits[split]:
            basis = self._starts.get(i)
            part = slice(at, at + self.rows[i].count)
            if basis is not None:
                for rows, q in basis:
                    where = np.arange(part.start, part.stop)[rows]
                    out[:, where] -= (out[:, where] @ q) @ q.T
            at = part.stop
        return out

    def rebase(self, point):
        """What a free start changes in each window, at the point."""
        theta = jnp.asarray(self.numbers.vector(point))
        for i, rows in enumerate(self.rows):
            if isinstance(rows, FreeRun) and rows.free:
                self._starts[i] = rows.start_bases(theta)

    def set_floor(self, point: Point) -> None:
        """Weigh rows by what no law of the library explains on the train runs, and its colour.

        A real machine is never as good as its sensors: what is left after the tangents of the
        parameters and of all candidates is the noise against which an effect must stand.
        """
        (rest,) = self.residuals([point], "train")
        found = self.candidates(point)
        table = np.concatenate([self.tangents(point, []).T, self.columns(point, found)])
        size = np.linalg.norm(table, axis=1)
        table = table[size > 0] / size[size > 0, None]
        values, vectors = np.linalg.eigh(table @ table.T)
        good = values > 1e-6 * values[-1]
        basis = (vectors[:, good] / np.sqrt(values[good])).T @ table
        left = rest - basis.T @ (basis @ rest)
        spread = float(left @ left) / max(len(left) - int(good.sum()), 1)
        self.floor = max(1.0, float(np.sqrt(spread)))
        self.scale = self.scale * self.floor
        counts = [self.rows[i].count for i in self.splits["train"]]
        self.inflation = inflation(np.split(left, np.cumsum(counts)[:-1]))

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
        table = self.pushed(np.tile(theta, (len(ways), 1)), np.stack(ways), self.splits["train"])
        return self.whitened(table, "train").T

    def dof(self, split):
        return max(1, round(sum(self.rows[i].count for i in self.splits[split]) / self.inflation))

    # candidates ---------------------------------------------------------------------------------

    def candidates(self, point):
        orders = {}
        if any("order" in self.laws[i].parameters for i, _ in self.places):
            orders = strongest_orders(self, point)
        return machine_candidates(self, self.scales, orders)

    def balance(self, i: int) -> tuple[Balance, Callable]:
        """The balance of run `i`, and its values at a vector of numbers."""
        if i not in self._balances:
            rows, program = self.rows[i], self._programs[i][0]
            if not isinstance(rows, Balance):
                rows = Balance(self.numbers, self.runs[i])
                program = _compiled(rows)[0]
            self._balances[i] = rows, lambda theta: _lanes(program, rows.data, theta[None])[0]
        return self._balances[i]

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
        out[~np.all(np.isfinite(out), axis=1)] = 0.0
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
            if f.key == "order":
                low, high = 0.97 * float(value), 1.03 * float(value)
            if f.key in ("width", "speed"):  # as narrow as shows, as wide as the speeds
                low, high = 0.003 * self.scales.speed, 2.0 * self.scales.speed
            if f.key in ("tau", "delay"):
                low, high = max(low, float(value) / 30), min(high, float(value) * 30)
            out.append(type(f)(f.effect, f.key, f.index, low, high))
        return out


def inflation(parts: Sequence[np.ndarray]) -> float:
    """Rows that say as much as one independent row: 1 + 2 sum of the autocorrelation, at least 1.

    The sum ends at the first correlation below 0.05.
    """
    power = sum(float(x @ x) for x in parts)
    total, longest = 1.0, max(len(x) for x in parts) // 4
    for lag in range(1, longest):
        r = sum(float(x[lag:] @ x[:-lag]) for x in parts if len(x) > lag) / max(power, 1e-300)
        if r < 0.05:
            break
        total += 2 * r
    return total


def _compiled(rows):
    """(values, tangents) of many points of one run, compiled once."""

    @eqx.filter_jit
    def value(data, thetas):
        return jax.vmap(lambda t: rows.rows(t, data))(thetas)

    @eqx.filter_jit
    def tangent(data, thetas, ways):
        def one(t, w):
            return jax.jvp(lambda x: rows.rows(x, data), (t,), (w,))[1]

        return jax.vmap(one)(thetas, ways)

    return value, tangent


def _lanes(program, data, *tables: np.ndarray) -> np.ndarray:
    """A program over tables (points, ...) in chunks of `LANES`, or of one for a single point."""
    count = len(tables[0])
    lanes = 1 if count == 1 else LANES
    out = []
    for begin in range(0, count, lanes):
        parts = [t[begin : begin + lanes] for t in tables]
        short = lanes - len(parts[0])
        padded = [np.concatenate([p, np.repeat(p[-1:], short, 0)]) for p in parts]
        out.append(np.asarray(program(data, *map(jnp.asarray, padded)))[: len(parts[0])])
    return np.concatenate(out)
