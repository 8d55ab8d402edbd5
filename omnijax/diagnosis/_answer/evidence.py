"""What an answer needs to know of a model beside the search: groups, places, words."""

import abc
from collections.abc import Callable
from typing import Any

import numpy as np

from .._search import AbstractModel, Effect, Fit, Point
from .result import Gap

Tell = Callable[[str], None]


class AbstractEvidence(abc.ABC):
    """One model with its held-out runs, as verdict, answer and page see it.

    `noise` holds by output group {sigma, source, error}, `faults` what was wrong with the data.
    """

    model: AbstractModel
    noise: dict[str, dict[str, Any]]
    faults: list[str]

    @abc.abstractmethod
    def squares(self, residual: np.ndarray) -> dict[str, tuple[float, float]]:
        """By group: sum of squares of a held-out residual, and its degrees of freedom."""

    @abc.abstractmethod
    def gaps(self, before: np.ndarray, after: np.ndarray) -> dict[str, Gap]:
        """By group: RMS of held-out residuals before and after, against the noise."""

    @abc.abstractmethod
    def locate(self, point: Point) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
        """(strongest discoveries, all answers) of where the gap is at a point."""

    @abc.abstractmethod
    def learn(self, fit: Fit, tell: Tell) -> Any:
        """A learned, uninterpreted term beside a fit's baseline; None where there is none."""

    @abc.abstractmethod
    def experiment(self, rivals: list[Point]) -> dict[str, Any]:
        """The run that tells rivals apart."""

    @abc.abstractmethod
    def described(self, point: Point) -> Any:
        """The machine at a point: what the diagnosis hands back."""

    @abc.abstractmethod
    def remarks(self) -> list[str]:
        """How the prediction was made, in sentences."""

    @abc.abstractmethod
    def series(self, residual: np.ndarray) -> tuple[str, np.ndarray, dict[str, np.ndarray]]:
        """Of the first held-out run: its name, times in s, and a residual by channel in sigma."""

    def reported(self, effect: Effect) -> dict[str, Any]:
        """Further parameters of an effect that are no numbers of its law."""
        return {}

    def unit(self, unit: str, place: str) -> str:
        """A parameter's unit at a place."""
        return unit
