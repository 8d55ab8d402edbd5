"""Candidates of a search: laws at places, and values of their shape constants to try."""

import dataclasses
import math
from collections.abc import Callable, Sequence
from typing import Any, Protocol

import jax.numpy as jnp
import numpy as np
from jax.core import Tracer

from ...laws import ANY_LENGTH, AbstractLaw, Parameter
from .._settings import SETTINGS

WHOLE = range(1, SETTINGS.candidates.whole_orders + 1)
VALUES_BETWEEN = SETTINGS.candidates.values_between
LEAST_SHARE = SETTINGS.candidates.least_share


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
    `held` are the sizes of the same law that the machine has there already: it may be too large.
    """

    id: str
    place: str
    columns: tuple[LawAtPlace, ...]
    decode: Callable[[np.ndarray], dict[str, Any]]
    note: str = ""
    trials: int = 1
    held: dict[str, float] = dataclasses.field(default_factory=dict)

    @property
    def name(self) -> str:
        """id at place."""
        return f"{self.id}@{self.place}"

    def allowed(self, coefficients: np.ndarray) -> bool:
        """Whether the signs are physical: bounds kept, a law without strength not turned round."""
        law = self.columns[0].law
        known = law.parameters
        if not strengths(law):
            return bool(coefficients[0] > LEAST_SHARE)
        values = self.decode(coefficients)
        if len(coefficients) == 1:
            key = next(k for k, p in known.items() if p.linear)
            values = {key: float(coefficients[0])}
        return self.within(values)

    def within(self, values: dict[str, Any]) -> bool:
        """Whether numbers keep their law's bounds, what the machine has there already counted."""
        known = self.columns[0].law.parameters
        return all(
            known[k].low <= v + self.held.get(k, 0.0) and v <= known[k].high
            for k, v in values.items() if np.ndim(v) == 0
        )  # fmt: skip


def number(x) -> Any:
    """A parameter as a float64 array: of NumPy, which reads and hashes fast, where it is known."""
    return jnp.asarray(x, float) if isinstance(x, Tracer) else np.asarray(x, float)


def strengths(law) -> list[str]:
    """Parameters of a law in which it is linear."""
    return [k for k, p in law.parameters.items() if p.linear]


def is_wave(law) -> bool:
    """Whether a law is one strength times a wave of a `phase`: two of its phases give all."""
    linear = strengths(law)
    return "phase" in law.parameters and len(linear) == 1 and not law.parameters[linear[0]].shape


def unit_laws(
    law: type[AbstractLaw], fixed: dict[str, Any]
) -> tuple[list[AbstractLaw], Callable[[np.ndarray], dict[str, Any]]]:
    """A law by its table of parameters: laws of unit strength, and `decode` of a `Candidate`.

    `fixed` are its shape constants.  One of one strength with a `phase` is a wave, its cosine and
    sine parts; with any other a `phase` begins at 0.  A law without a strength is itself.
    """
    if is_wave(law):
        units, decode = _wave_units(law, fixed)
    else:
        fixed = ({"phase": 0.0} if "phase" in law.parameters else {}) | fixed
        units, decode = _strength_units(law, fixed)
    made = [law(**{k: number(v) for k, v in (unit | fixed).items()}) for unit in units]
    return made, decode


def _wave_units(law, fixed: dict[str, Any]):
    (size,) = strengths(law)

    def decode(c):
        return fixed | {size: math.hypot(*c), "phase": math.atan2(c[1], c[0])}

    return [{size: 1.0, "phase": phase} for phase in (0.0, math.pi / 2)], decode


def _strength_units(law, fixed: dict[str, Any]):
    sizes = {key: law.parameters[key].shape for key in strengths(law)}
    zero = {key: np.zeros(n or ()) for key, n in sizes.items()}
    ends = np.cumsum([n or 1 for n in sizes.values()])

    def decode(c):
        parts = np.split(np.asarray(c, float), ends[:-1])
        each = zip(sizes.items(), parts, strict=False)  # without a strength there is one part
        return fixed | {key: part if n else float(part[0]) for (key, n), part in each}

    units = [zero | {key: unit} for key, n in sizes.items() for unit in (np.eye(n) if n else [1.0])]
    return units or [{}], decode


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
        return np.linspace(low, high, VALUES_BETWEEN + 2)[1:-1].tolist()
    return SETTINGS.candidates.any_values
