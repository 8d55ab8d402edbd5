"""What an answer needs to know of a model beside the search: groups, places, words."""

import abc
import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from .._search import AbstractModel, Effect, Fit, Level, Point, Score
from .._settings import SETTINGS

Tell = Callable[[str], None]


@dataclasses.dataclass(frozen=True)
class Misshapen:
    """An effect beside which a function of its own input is left, the `share` (RMS) of its change.

    `label` names the function that says most.
    """

    name: str
    label: str
    share: float


@dataclasses.dataclass(frozen=True)
class Unlisted:
    """A number, of every wheel where it is one of theirs, that the rig file does not leave open.

    `numbers` holds by parameter (stated, as it would have to be, 1-sigma), `closed` the share of
    the held-out runs' gap above the noise that it closes, `cost` that of the refit with it.
    """

    path: str
    numbers: dict[str, tuple[float, float, float]]
    closed: float
    cost: float

    def said(self) -> str:
        """The sentence of an answer."""
        off = [
            f"{name} {100 * (value / stated - 1):+.3g} ± {100 * sigma / stated:.1g} %"
            for name, (stated, value, sigma) in self.numbers.items()
        ]
        return (
            f"Numbers that the rig file takes for exact would close {100 * self.closed:.0f} % of "
            f"the gap: {', '.join(off)}. If the drawing leaves that open, list "
            f'"{self.path}" under [uncertainty] and diagnose again.'
        )


class AbstractEvidence(abc.ABC):
    """One model with its held-out runs, as verdict, answer and page see it.

    `noise` holds by output group {sigma, error, source, declared}, `faults` what was wrong with
    the data.
    """

    model: AbstractModel
    noise: Mapping[str, Any]
    faults: list[str]
    closing: float = SETTINGS.verdict.closing
    alike: float = SETTINGS.verdict.size_tolerance
    confirmed_on: str = "held-out"  # held-out, blocks (parts of the runs) or nothing
    reweighs: bool = False  # whether it may be `renoised`
    asks_all: bool = False  # whether fitted runs are asked too for what is no noise
    without_term: Sequence[str] = ()  # what is said where nothing is learned

    @abc.abstractmethod
    def locate(
        self, point: Point, split: str = "held-out", run: int = 0
    ) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
        """(strongest discoveries, all answers) of where the gap is at a point, in one run of a
        split, in the order of `columns`."""

    @abc.abstractmethod
    def learn(self, fit: Fit, scores: Sequence[Score], tell: Tell) -> Any:
        """A learned, uninterpreted term beside a fit's baseline; None where there is none.

        `scores` are those of the library's laws there, of which the nearest are told.
        A term that leaves more of the held-out gap than the baseline does is none.
        """

    def misshapen(self, fit: Fit) -> Sequence[Misshapen]:
        """Effects of a fit beside which another function of their input is left, the most first."""
        return []

    @abc.abstractmethod
    def experiment(self, rivals: list[Point]) -> dict[str, Any] | None:
        """The run that tells rivals apart; `None` where they can be foretold in none."""

    @abc.abstractmethod
    def described(self, point: Point) -> Any:
        """The machine at a point: what the diagnosis hands back, laws of one place joined."""

    @abc.abstractmethod
    def text(self, described: Any) -> str:
        """The file of what `described` gave."""

    def beside_held(self, point: Point) -> list[str]:
        """Of which effects of a point the machine has the same law there already, in sentences."""
        return []

    @abc.abstractmethod
    def remarks(self) -> list[str]:
        """How the prediction was made, in sentences."""

    def unlisted(self, fit: Fit) -> Sequence[Unlisted]:
        """Numbers taken for exact that would close the gap of a fit without effects, best first."""
        return []

    def clocks(self, fit: Fit, open_: bool = False) -> list[str]:
        """How far the loggers' clocks are apart at a fit, in sentences; `open_`: a gap is left."""
        return []

    @abc.abstractmethod
    def series(self, residual: np.ndarray) -> tuple[str, np.ndarray, dict[str, np.ndarray]]:
        """Of the first held-out run: its name, times in s, and a residual by channel in sigma."""

    def columns(self, residual: np.ndarray, split: str) -> list[dict[str, np.ndarray]]:
        """By run of a split the parts of a residual by channel, in assumed sigma; NaN where nothing
        counts.  By default the first held-out run."""
        return [self.series(residual)[2]] if split == "held-out" else []

    def steps(self, split: str) -> list[float]:
        """By run of a split the step of `columns`, of any unit; none, as by default: all alike."""
        return []

    def recorded(self) -> list[tuple[str, np.ndarray]]:
        """Of every held-out run its name and the times in s of its samples, as in `columns`; empty
        where residuals are none of samples."""
        return []

    def assumed(self, channel: str) -> dict[str, Any]:
        """What the noise of a channel was taken for: declared, source, unit, colour."""
        group = channel if channel in self.noise else channel.rpartition("_")[0]
        known = self.noise[group]
        return {**known, "unit": self.unit_of(group)}

    def sigma(self, channel: str, split: str, run: int) -> float:
        """1-sigma in the channel's unit that its `columns` of a run of a split are told in."""
        group = channel if channel in self.noise else channel.rpartition("_")[0]
        return float(self.noise[group]["sigma"])

    def unit_of(self, group: str) -> str:
        """Unit of an output group."""
        return "1"

    def subsystem(self, channel: str) -> str:
        """What state a channel shows: an effect on it shows in all channels of the same one."""
        return channel

    def renoised(self, levels: Sequence[dict[str, Level]]) -> "AbstractEvidence":
        """This evidence weighed by other noise, in the order of `columns`, where it `reweighs`."""
        raise NotImplementedError(f"{type(self).__name__} is weighed by one noise alone.")

    def readmitted(self, point: Point) -> "AbstractEvidence | None":
        """This evidence with samples back that had been left out and fit what a point foretells;
        None where there is none, and by default."""
        return None

    def beside_starts(self, point: Point) -> list[dict[str, Level]]:
        """By run, in the order of `columns`, the noise of a colour of channels whose residual lacks
        what free starts took up; of channels without such, and by default, none."""
        return []

    def parted(self) -> "AbstractEvidence | None":
        """This evidence with a third of every fitted run kept out of the fit beside the held-out
        runs; None where they are too short or play both roles already, and by default."""
        return None

    def reported(self, effect: Effect) -> dict[str, Any]:
        """Further parameters of an effect that are no numbers of its law."""
        return {}

    def unit(self, unit: str, place: str, key: str = "") -> str:
        """Unit of the parameter `key` at a place."""
        return unit
