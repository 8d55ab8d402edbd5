"""What the diagnosis needs of a model: parameters with priors, residuals, tangents, candidates."""

import abc
import contextlib
import dataclasses
import math
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np

from ...laws import AbstractLaw, of_library
from .._settings import SETTINGS, SearchSettings

STEPPED = ("contact", "mount", "separation")  # ports whose laws change a run's every tangent
THRESHOLDS = ("gap", "delay", "tau")  # sizes of laws without a linear strength
HARD = SETTINGS.model.hard
BOUND_TOLERANCE = SETTINGS.model.bound_tolerance
SHUFFLED_BLOCKS = SETTINGS.model.shuffled_blocks
WIDTH_RANGE = SETTINGS.model.width_range
SPEED_BELOW = SETTINGS.model.speed_below
SPEED_ABOVE = SETTINGS.model.speed_above


@dataclasses.dataclass(frozen=True)
class Prior:
    """One uncertain parameter: value exp(sigma u) where `relative`, else value + sigma u.

    An absolute one is never below `low`: a friction below 0 is none.  That bound, and both of a
    `limited` one, are no matter of doubt: what it cannot take up beyond them is left to candidates.
    """

    name: str
    value: float
    sigma: float
    relative: bool = True
    hard: float = HARD
    unit: str = ""
    limited: bool = False
    low: float = -math.inf

    def at(self, u: float) -> float:
        """The parameter's value at the unit coordinate `u`."""
        if self.relative:
            return self.value * math.exp(self.sigma * u)
        return max(self.value + self.sigma * u, self.low)

    @property
    def least(self) -> float:
        """The unit coordinate at which its range begins."""
        if self.relative or not math.isfinite(self.low):
            return -self.hard
        return max(-self.hard, min(0.0, (self.low - self.value) / self.sigma))

    def slope(self, u: float) -> float:
        """d `at` / du."""
        return self.sigma * (self.at(u) if self.relative else 1.0)

    def at_bound(self, u: float) -> bool:
        """Whether the unit coordinate `u` is at an end of its range."""
        within = self.hard * BOUND_TOLERANCE
        return not self.least + within <= u <= self.hard - within

    def cannot_yield(self, u: float) -> bool:
        """Whether at `u` what it cannot take up is left to candidates: at a bound beyond doubt."""
        if self.limited:
            return self.at_bound(u)
        return -self.hard < self.least and u - self.least < self.hard * BOUND_TOLERANCE


def unit_bounds(priors: Sequence[Prior]) -> tuple[np.ndarray, np.ndarray]:
    """Least and greatest unit coordinates (numbers,) of uncertain parameters."""
    return np.array([p.least for p in priors]), np.array([p.hard for p in priors])


@dataclasses.dataclass(frozen=True)
class Effect:
    """A named law with numbers: what may be added to the model."""

    id: str
    place: str
    values: dict[str, Any]

    @property
    def name(self) -> str:
        """id at place."""
        return f"{self.id}@{self.place}"


@dataclasses.dataclass(frozen=True)
class Point:
    """Where a model is evaluated: unit coordinates of the uncertain parameters, and effects."""

    u: np.ndarray
    effects: tuple[Effect, ...] = ()

    def with_effects(self, *effects: Effect) -> "Point":
        """This point with other effects."""
        return Point(self.u, tuple(effects))

    def without(self, i: int) -> "Point":
        """This point without effect `i`."""
        return Point(self.u, (*self.effects[:i], *self.effects[i + 1 :]))


@dataclasses.dataclass(frozen=True)
class Free:
    """One free number of an effect: its key, the index in a vector, bounds and a natural step."""

    effect: int
    key: str
    index: int | None
    low: float
    high: float


class AbstractModel(abc.ABC):
    """A model with data: everything the diagnosis asks for.  Rows are whitened."""

    priors: Sequence[Prior]
    laws: dict[str, type[AbstractLaw]]
    tell: Callable[[str], None] = staticmethod(lambda text: None)  # of how far the work is
    # evaluations since the budget began, in those of all train runs with laws stepped in time
    work: float = 0.0
    ranking: str = "train"  # split whose rows, the first of train's, rank laws at finite strength
    settings: SearchSettings = SETTINGS.search
    wavy: bool | None = None  # whether an uncertain number is a wave's; None: nobody asked
    budget: float = math.inf  # of `work`: what a search may take before it ends
    repeats: frozenset[str] = frozenset()  # laws that may act several times at one place
    frozen_keys: frozenset[str] = frozenset({"roller", "order", "exponent", "modulus"})

    def has(self, effects: Sequence[Effect], id: str, place: str) -> bool:
        """Whether effects hold a law at a place already, so that it is no candidate there.

        A law without a free number is there or is not: at all wheels and at one of them it would
        be there twice.
        """
        alike = [e.place for e in effects if e.id == id]
        if not alike:
            return False
        whole = not set(self.laws[id].parameters) - self.frozen_keys
        if whole and "all" in (*alike, place):
            return True
        return place in alike and id not in self.repeats

    @abc.abstractmethod
    def residuals(self, points: Sequence[Point], split: str) -> list[np.ndarray]:
        """Measured less predicted on the runs of `split` (train, held-out), a vector a point."""

    def aside(self) -> contextlib.AbstractContextManager[None]:
        """In which points are asked for that are not asked for again: nothing need be kept."""
        return contextlib.nullcontext()

    def rest(self) -> None:  # noqa: B027, nothing is kept by default
        """Keep nothing that can be worked out anew: the model is not asked for a while."""

    @abc.abstractmethod
    def dof(self, split: str) -> int:
        """Rows that carry information."""

    def moments(self, split: str) -> tuple[np.ndarray, np.ndarray] | None:
        """By row of a split which run it is of, and its time there in s.

        None where an effect may change from run to run and over them.
        """
        return None

    def parts(self) -> list[np.ndarray]:
        """Masks (train rows,) of parts that show different states of the machine; none by default.

        An effect that bends all that one of them shows may be proportional to its strength in
        another.
        """
        return []

    def group_rms(self, residual: np.ndarray, split: str) -> dict[str, float]:
        """RMS of a residual by output group, in sigma; one group by default."""
        return {"all": float(np.sqrt(residual @ residual / max(1, self.dof(split))))}

    @abc.abstractmethod
    def candidates(self, point: Point) -> list:
        """Candidates that may be added at `point`."""

    def candidates_beside(self, point: Point, taken: np.ndarray | None) -> list:
        """`candidates`, picked beside what the model's own numbers take up.

        `taken` (train rows, k) are the directions of that; none: nothing is.
        """
        return self.candidates(point)

    @abc.abstractmethod
    def columns(self, point: Point, candidates: Sequence) -> np.ndarray:
        """Signatures of the candidates on the train runs (columns of all candidates, rows).

        In double precision, or, where there are many, in single.
        """

    def through_laws(
        self, point: Point, candidates: Sequence, steps: Sequence[np.ndarray]
    ) -> list[np.ndarray]:
        """By candidate its signatures (k, rows) beside laws of `point` that are stepped in time.

        Differences, at the strengths `steps` (k,).  Empty where `columns` are those already.
        """
        return []

    def plainness(self, effect: Effect) -> float:
        """Factor of an effect's gain where trials are ranked: below 1 for laws of many numbers."""
        return 1.0

    def tangents(self, point: Point, free: Sequence[Free]) -> np.ndarray | None:
        """d residual / d (u, free) on the train runs, exact; None: differences are taken."""
        return None

    def prior_tangents(self, point: Point, split: str) -> dict[int, np.ndarray]:
        """By index the d residual / d u that are known without differences; none by default."""
        return {}

    def unsettled(self, point: Point) -> bool:
        """Whether what `rebase` takes from the data hangs on the point's laws: then again."""
        return False

    def astray(self, fit) -> bool:
        """Whether a refit may have been led astray by what `rebase` took from the data."""
        return False

    def frees(self, effect: Effect) -> bool:
        """Whether what `rebase` takes from the data has more free numbers with a law."""
        return False

    def as_noise(self, less, fit, effect: Effect) -> bool:
        """Whether noise explains as well as an effect of `fit` what it closes of `less`."""
        return False

    def opening(self, share: float) -> "AbstractModel":
        """This model of the runs' beginnings, up to `share` of the motion; all of it by default."""
        return self

    def needs_stepping(self, effects: Iterable[Effect]) -> bool:
        """Whether a law among `effects` is stepped in time, so that all tangents change with it."""
        return any(self.laws[e.id].port in STEPPED for e in effects)

    def bends(self, id: str) -> bool:
        """Whether a law's signature bends with its strength, so that it is tried at finite ones."""
        return self.laws[id].port in STEPPED

    def margin(self, fit, rival) -> float:
        """By how much more a `rival` fit costs than a fit: -2 log of their likelihoods' ratio."""
        return rival.cost - fit.cost

    def on_its_own(self, fit):
        """(the refit of a fit, what it leaves on the held-out runs) as it is with its own `rebase`.

        The data stay prepared as they are.
        """
        return fit, self.residuals([fit.point], "held-out")[0]

    def remembered(self, point: Point) -> Point:
        """A point at which a refit with the same laws ended before, or the point itself."""
        return point

    def with_lines(self, fit, id: str, place: str, more: int = 1) -> list[Point]:
        """Points with `more` lines of a law at a place than a fit has, all lines there anew.

        All that the fitted runs tell as well; new effects stand last.  None by default.
        """
        return []

    def foretold(self, point: Point) -> list[Point]:
        """Points with one effect more at which refits ended before, which are tried first."""
        return []

    @property
    def spent(self) -> bool:
        """Whether a search has used up its budget."""
        return self.work > self.budget

    def rebase(self, point: Point) -> None:  # noqa: B027, nothing to prepare by default
        """Prepare for work around `point` (smoothing, linearisation)."""

    def based_near(self, fit) -> bool:
        """Whether the last `rebase` was so near to a fit, by its errors, that none is needed."""
        return False

    def shuffled(
        self, residual: np.ndarray, seed: int, blocks: int = SHUFFLED_BLOCKS
    ) -> np.ndarray:
        """A residual in blocks of changed order and sign: its colour, but tied to no signature."""
        rng = np.random.default_rng(seed)
        parts = np.array_split(np.roll(residual, rng.integers(len(residual))), blocks)
        return np.concatenate([rng.choice([-1.0, 1.0]) * parts[k] for k in rng.permutation(blocks)])

    def free(self, point: Point) -> list[Free]:
        """The numbers of the point's effects that a refit may change."""
        return free_numbers(self, point)


def to_project(model: AbstractModel, J: np.ndarray, u: np.ndarray):
    """(tangents, coordinates) that are projected out of scores: all that can yield."""
    at_bound = [k for k, p in enumerate(model.priors) if p.cannot_yield(u[k])]
    return np.delete(J, at_bound, axis=1), np.delete(u, at_bound)


def friction_width(law: type[AbstractLaw]) -> float | None:
    """The width that a friction law has where none is stated; None of a law that has no such."""
    field = law.__dataclass_fields__.get("width")
    return None if field is None or field.default is dataclasses.MISSING else float(field.default)


def with_width(law: type[AbstractLaw], effect: Effect) -> Effect:
    """The effect with its friction width written out, so that a refit can free it."""
    width = friction_width(law)
    stated = {} if width is None else {"width": width}
    return dataclasses.replace(effect, values=stated | effect.values)


def free_numbers(model: AbstractModel, point: Point) -> list[Free]:
    """Every number that the point's effects state, but counts and exponents."""
    out = []
    for i, effect in enumerate(point.effects):
        law = model.laws[effect.id]
        known, width = law.parameters, friction_width(law)
        for key, value in effect.values.items():
            if key in model.frozen_keys:
                continue
            p = known[key]
            if key == "width" and width is not None:
                out.append(Free(i, key, None, width / WIDTH_RANGE, width * WIDTH_RANGE))
            elif key == "speed" and of_library(law):  # that of a friction
                out.append(
                    Free(i, key, None, float(value) / SPEED_BELOW, float(value) * SPEED_ABOVE)
                )
            elif np.ndim(value):
                out += [Free(i, key, k, p.low, p.high) for k in range(len(value))]
            else:
                out.append(Free(i, key, None, p.low, p.high))
    return out


def size_keys(laws: dict[str, type[AbstractLaw]], effect: Effect) -> tuple[str, ...]:
    """The numbers that grow with an effect: its strengths, else its threshold or time."""
    known = laws[effect.id].parameters
    keys = [k for k, p in known.items() if p.linear and k in effect.values]
    return tuple(keys or [k for k in THRESHOLDS if k in effect.values][:1])


def value_of(point: Point, free: Free) -> float:
    """The free number's value."""
    value = point.effects[free.effect].values[free.key]
    return float(value if free.index is None else value[free.index])


def moved(point: Point, u: np.ndarray, free: Sequence[Free], values: Iterable[float]) -> Point:
    """The point at other coordinates and free numbers."""
    effects = [dataclasses.replace(e, values=dict(e.values)) for e in point.effects]
    for f, v in zip(free, values, strict=True):
        target = effects[f.effect].values
        if f.index is None:
            target[f.key] = float(v)
        else:
            vector = np.array(target[f.key], float)
            vector[f.index] = v
            target[f.key] = vector
    return Point(np.asarray(u, float), tuple(effects))
