"""What a verdict rests on: named effects, and what each output is off before and after."""

import dataclasses
import math
from collections.abc import Sequence
from typing import Any


@dataclasses.dataclass(frozen=True)
class Named:
    """One named effect: parameters as {name: {value, sigma, unit}}, evidence, near rivals."""

    id: str
    place: str
    parameters: dict[str, dict[str, Any]]
    evidence: dict[str, float]
    indistinguishable_from: list[dict[str, str]] = dataclasses.field(default_factory=list)


def alternatives(effects: Sequence[Named]) -> list[list[Named]]:
    """The effects of an answer: lists of which one each is there, the ones without rival first.

    Who is not to be told from whom goes on through a third.
    """
    lists: list[list[Named]] = []
    for effect in effects:
        alike = [some for some in lists if any(are_rivals(effect, e) for e in some)]
        lists = [some for some in lists if some not in alike]
        lists.append([*(e for some in alike for e in some), effect])
    order = {id(effect): k for k, effect in enumerate(effects)}
    lists = [sorted(some, key=lambda e: order[id(e)]) for some in lists]
    return sorted(lists, key=lambda some: (len(some) > 1, order[id(some[0])]))


def are_rivals(one: Named, other: Named) -> bool:
    """Whether each of two effects says that it is not to be told from the other."""
    pairs = ((one, other), (other, one))
    return all({"id": b.id, "place": b.place} in a.indistinguishable_from for a, b in pairs)


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
