"""Candidates of a search: laws at places, and values of their shape constants to try."""

import dataclasses
import math
from collections.abc import Callable, Sequence
from typing import Any, Protocol

import jax.numpy as jnp
import numpy as np

from ...laws import ANY_LENGTH, AbstractLaw, Parameter
from .._settings import SETTINGS

WHOLE = range(1, SETTINGS.candidates.orders + 1)
BETWEEN = SETTINGS.candidates.between
WAY = SETTINGS.candidates.way


class LawAtPlace(Protocol):
    """A law somewhere on a machine, of whatever kind the machine is."""

    @property
    def law(self) -> AbstractLaw:
        """The law."""
        ...

    @property
    def place(self) -> str:
        """Where it acts: a word of the machine's."""
        ...


@dataclasses.dataclass(frozen=True)
class Candidate:
    """One law at one place with fixed shape constants: `columns` are its laws of unit strength.

    `decode(coefficients)` gives the law's parameters from the columns' coefficients, `trials` is
    how many independent trials the candidate stands for: a line picked for its size, all lines.
    """

    id: str
    place: str
    columns: tuple[LawAtPlace, ...]
    decode: Callable[[np.ndarray], dict[str, Any]]
    note: str = ""
    trials: int = 1

    @property
    def name(self) -> str:
        """id at place."""
        return f"{self.id}@{self.place}"

    def allowed(self, coefficients: np.ndarray) -> bool:
        """Whether the signs are physical: bounds kept, a law without strength not turned round."""
        law = self.columns[0].law
        known = law.parameters
        if not any(p.linear for p in known.values()):
            return bool(coefficients[0] > WAY)
        values = self.decode(coefficients)
        if len(coefficients) == 1:
            key = next(k for k, p in known.items() if p.linear)
            sign = float(coefficients[0])
            return known[key].low <= sign <= known[key].high
        return all(known[k].low <= v <= known[k].high for k, v in values.items() if np.ndim(v) == 0)


def number(x) -> Any:
    """A parameter as a float64 array."""
    return jnp.asarray(x, float)


def strengths(law) -> list[str]:
    """Parameters of a law in which it is linear."""
    return [k for k, p in law.parameters.items() if p.linear]


def is_wave(law) -> bool:
    """Whether a law is one strength times a wave of a `phase`: two of its phases give all."""
    linear = strengths(law)
    return "phase" in law.parameters and len(linear) == 1 and not law.parameters[linear[0]].shape


def holds_list(law: type[AbstractLaw]) -> bool:
    """Whether a law holds lists of any length, so that nothing says how long to try them."""
    return any(p.shape == ANY_LENGTH for p in law.parameters.values())


def unknown_shapes(law) -> list[str]:
    """Shape constants of a law that have no default; a wave's phase is no such constant."""
    fields = law.__dataclass_fields__
    return [
        k for k, p in law.parameters.items()
        if not (p.linear or p.optional or k == "phase")
        and fields[k].default is dataclasses.MISSING
    ]  # fmt: skip


def values_to_try(key: str, parameter: Parameter) -> Sequence[float] | np.ndarray:
    """Values of an unknown shape constant: whole orders, within its bounds, or a decade about 1.

    Of a vector those of length 1 along each axis.
    """
    low, high = parameter.low, parameter.high
    if parameter.shape:
        return np.eye(parameter.shape)
    if key == "order":
        return [float(n) for n in WHOLE if low <= n <= high]
    if math.isfinite(low) and math.isfinite(high):
        return np.linspace(low, high, BETWEEN + 2)[1:-1].tolist()
    return SETTINGS.candidates.ladder
