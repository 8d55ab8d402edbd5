"""A claim of the paper, the readings it allows, and the verdict that the numbers give."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

HOLDS, PARTLY, FAILS = "holds", "holds only under a reading", "does not hold"
TONES = {HOLDS: "good", PARTLY: "mixed", FAILS: "bad"}


@dataclass(frozen=True)
class Reading:
    """One way to take a claim: a quantity, its range over the parameters, and its bound."""

    text: str
    quantity: str
    low: float
    high: float
    bound: str  # "<=" or ">="
    limit: float
    unit: str = "1"

    @property
    def holds(self) -> bool:
        """Whether the whole range keeps the bound."""
        return self.high <= self.limit if self.bound == "<=" else self.low >= self.limit

    def line(self) -> str:
        """The reading as one sentence with its numbers."""
        sign = "≤" if self.bound == "<=" else "≥"
        span = f"{self.low:.3g}" if self.low == self.high else f"{self.low:.3g} … {self.high:.3g}"
        unit = "" if self.unit == "1" else f" {self.unit}"
        mark = "✓" if self.holds else "✕"
        return f"{mark} {self.text}: {self.quantity} {span}{unit}, bound {sign} {self.limit:.4g}"


def at_most(text: str, quantity: str, values: Any, limit: float, unit: str = "1") -> Reading:
    """The reading that `values` stay at or below `limit`."""
    return Reading(text, quantity, *_span(values), "<=", limit, unit)


def at_least(text: str, quantity: str, values: Any, limit: float, unit: str = "1") -> Reading:
    """The reading that `values` stay at or above `limit`."""
    return Reading(text, quantity, *_span(values), ">=", limit, unit)


def _span(values: Any) -> tuple[float, float]:
    array = np.asarray(values, float)
    if not np.all(np.isfinite(array)):
        raise ValueError("a reading needs finite numbers.")
    return float(array.min()), float(array.max())


@dataclass(frozen=True)
class Claim:
    """What the paper says, how it may be read, the figure that decides, and over which range."""

    id: str
    content: str
    figure: str
    readings: Sequence[Reading]
    over: str
    evidence: dict[str, Any] = field(default_factory=dict)

    @property
    def verdict(self) -> str:
        """Holds in every reading, in some, or in none."""
        kept = [reading.holds for reading in self.readings]
        return HOLDS if all(kept) else PARTLY if any(kept) else FAILS

    def reading(self) -> str:
        """The readings in which it holds, or all that were tried."""
        kept = [reading.text for reading in self.readings if reading.holds]
        return "; ".join(kept or [reading.text for reading in self.readings])

    def to_json(self) -> dict[str, Any]:
        """The claim as plain data."""
        return {
            "id": self.id,
            "claim": self.content,
            "reading": self.reading(),
            "decided_by": self.figure,
            "verdict": self.verdict,
            "readings": [
                {
                    "reading": r.text,
                    "quantity": r.quantity,
                    "low": r.low,
                    "high": r.high,
                    "bound": f"{r.bound} {r.limit:g}",
                    "unit": r.unit,
                    "holds": r.holds,
                }
                for r in self.readings
            ],
            "evidence": self.evidence,
            "range": self.over,
        }


@dataclass(frozen=True)
class Erratum:
    """A row of the errata: one measure of wrongness, of the printed form and of the reading taken.

    Confirmed where the printed form's measure lies above `limit` and the reading's does not.
    """

    equation: str
    printed: str
    problem: str
    taken: str
    measure: str
    value_printed: float
    value_taken: float
    limit: float
    unit: str = "1"

    @property
    def confirmed(self) -> bool:
        """Whether the numbers bear the erratum out."""
        return self.value_printed > self.limit >= self.value_taken

    def to_json(self) -> dict[str, Any]:
        """The row as plain data."""
        return {
            "equation": self.equation,
            "printed": self.printed,
            "problem": self.problem,
            "reading_taken": self.taken,
            "check": {
                "measure": self.measure,
                "as_printed": self.value_printed,
                "reading_taken": self.value_taken,
                "limit": self.limit,
                "unit": self.unit,
            },
            "confirmed": self.confirmed,
        }
