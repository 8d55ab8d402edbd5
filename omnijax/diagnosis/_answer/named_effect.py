"""What a verdict rests on: named effects, and what each output is off before and after."""

import dataclasses
import math
from typing import Any


@dataclasses.dataclass(frozen=True)
class Named:
    """One named effect: parameters as {name: {value, sigma, unit}}, evidence, near rivals."""

    id: str
    place: str
    parameters: dict[str, dict[str, Any]]
    evidence: dict[str, float]
    indistinguishable_from: list[dict[str, str]] = dataclasses.field(default_factory=list)


@dataclasses.dataclass(frozen=True)
class OutputGap:
    """RMS of measured less predicted on the held-out runs, against the noise."""

    noise_floor: float
    before: float
    after: float
    unit: str

    @property
    def closed(self) -> float:
        """Share of what was above the noise that is gone; NaN where nothing was."""
        above = self.before - self.noise_floor
        return (self.before - self.after) / above if above > 0 else math.nan
