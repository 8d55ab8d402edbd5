"""Small models from the same laws: give the residual of a point, the diagnosis does the rest."""

import itertools
from collections.abc import Callable, Sequence

import equinox as eqx
import numpy as np

from ...laws import AbstractLaw
from ...machine import PlacedLaw
from .._settings import SETTINGS
from .candidates import Candidate, number, unit_laws, unknown_shapes, values_to_try
from .model import AbstractModel, Point, Prior

LEAST_CHANGE = SETTINGS.function_model.least_change
MOST_CHANGE = SETTINGS.function_model.most_change
WEAKER = SETTINGS.function_model.weaker
STRONGER = SETTINGS.function_model.stronger
MOST_STRENGTHS = SETTINGS.function_model.most_strengths
Residual = Callable[[dict[str, float], list[AbstractLaw], str], np.ndarray]


class SmallModel(AbstractModel):
    """A model given by one function: residual(parameters, laws, split) -> whitened rows.

    `laws` are the candidates by id; `constants` gives values to try for shape constants, by
    (id, parameter).  Signatures are tangents of the same function.
    """

    def __init__(
        self,
        residual: Residual,
        priors: Sequence[Prior],
        laws: dict[str, type[AbstractLaw]],
        place: str,
        constants: dict[tuple[str, str], Sequence[float]] | None = None,
    ):
        self.residual, self.priors, self.laws, self.place = residual, priors, laws, place
        self.constants = constants or {}

    def _values(self, point: Point) -> dict[str, float]:
        return {p.name: p.at(float(u)) for p, u in zip(self.priors, point.u, strict=True)}

    def _laws(self, point: Point) -> list[AbstractLaw]:
        return [
            self.laws[e.id](**{k: number(v) for k, v in e.values.items()}) for e in point.effects
        ]

    def residuals(self, points, split):
        return [self.residual(self._values(p), self._laws(p), split) for p in points]

    def dof(self, split):
        return len(self.residual(self._values(Point(np.zeros(len(self.priors)))), [], split))

    def candidates(self, point):
        out = []
        for id, law in self.laws.items():
            keys = dict.fromkeys([*unknown_shapes(law), *(k for i, k in self.constants if i == id)])
            ladders = [
                self.constants.get((id, k), values_to_try(k, law.parameters[k])) for k in keys
            ]
            for values in itertools.product(*ladders):
                out.append(self._candidate(law, dict(zip(keys, values, strict=True))))
        return out

    def _candidate(self, law, fixed) -> Candidate:
        # a threshold has no tangent at zero: its strength is finite
        units, decode = unit_laws(law, fixed)
        columns = tuple(PlacedLaw(unit, self.place) for unit in units)
        return Candidate(law.id, self.place, columns, decode, str(fixed or ""))

    def columns(self, point, candidates):
        values, laws = self._values(point), self._laws(point)
        base = self.residual(values, laws, "train")
        placed = [p for c in candidates for p in c.columns]
        return np.stack([self._column(values, laws, base, p.law) for p in placed])

    def _column(self, values, laws, base, law) -> np.ndarray:
        """Predicted change per unit of strength."""
        linear = [k for k, p in law.parameters.items() if p.linear and float(getattr(law, k)) != 0]
        if not linear:
            return base - self.residual(values, [*laws, law], "train")
        strength, change = 1.0, np.zeros_like(base)
        for _ in range(MOST_STRENGTHS):  # a strength that stays in the linear range
            weak = eqx.tree_at(
                lambda x: [getattr(x, k) for k in linear], law, [number(strength)] * len(linear)
            )
            change = base - self.residual(values, [*laws, weak], "train")
            size = np.linalg.norm(change) / (np.linalg.norm(base) or 1.0)
            if np.isfinite(size) and LEAST_CHANGE < size < MOST_CHANGE:
                break
            strength *= WEAKER if not np.isfinite(size) or size >= MOST_CHANGE else STRONGER
        return change / strength
