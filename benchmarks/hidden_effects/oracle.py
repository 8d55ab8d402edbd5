"""Could the data tell what is hidden from its rivals?  Refits that begin at the truth say so.

An answer `ambiguous` that holds what is hidden is right where they could not; of a case that is
drawn as one that nothing tells, `named` is right where they could.
"""

import itertools
from collections.abc import Iterable
from typing import Any

from omnijax.diagnosis import AbstractModel, Effect, Point, refit

from .._lines import TELLS

Name = tuple[str, str]  # id and place
NEAREST = 2  # rivals of a named effect that are refitted: the others are farther


class Noiseless(AbstractModel):
    """A model of the data that a point foretells, in place of those that were measured."""

    def __init__(self, model: AbstractModel, truth: Point):
        self.model, self.priors, self.laws = model, model.priors, model.laws
        self.settings, self.frozen_keys = model.settings, model.frozen_keys
        self.true = {s: model.residuals([truth], s)[0] for s in ("train", "held-out")}

    def residuals(self, points, split):
        return [r - self.true[split] for r in self.model.residuals(points, split)]

    def dof(self, split):
        return self.model.dof(split)

    def free(self, point):
        return self.model.free(point)

    def candidates(self, point):
        return self.model.candidates(point)

    def columns(self, point, candidates):
        return self.model.columns(point, candidates)

    def tangents(self, point, free):
        return self.model.tangents(point, free)


def told_apart(found, true: dict[Name, dict[str, Any]]) -> list[dict] | None:
    """Of an ambiguous answer that holds the truth, how far each rival is from it; else None.

    So too of a named one that is the truth, of the `NEAREST` rivals of each effect.

    `true` are the parameters of what is hidden, by name.  By rival: `rival`, `margin` (chi2 by
    which it explains train and held-out runs less well than the truth, both refitted from there)
    and `expected` (what that is in the mean of all noise).
    """
    if found.verdict not in ("ambiguous", "named"):
        return None
    sets = _sets(found)
    held = [some for some in itertools.product(*sets) if {_name(e) for e in some} == set(true)]
    if not held:
        return None
    model, outcome = found.details["model"], found.details["found"]
    chosen = [_truly(e, true) for e in held[0]]
    fit = refit(model, Point(outcome.fit.point.u, tuple(chosen)))
    own, ideal = _cost(model, fit), Noiseless(model, fit.point)
    least = _cost(ideal, refit(ideal, fit.point))
    out = []
    for i, some in enumerate(sets):
        for rival in some:
            if _name(rival) == _name(chosen[i]):
                continue
            effects = (*fit.point.effects[:i], rival, *fit.point.effects[i + 1 :])
            other = refit(model, Point(fit.point.u, effects))
            out.append({
                "rival": "@".join(_name(rival)), "margin": round(_cost(model, other) - own, 2),
                "expected": round(_cost(ideal, refit(ideal, other.point)) - least, 2),
            })  # fmt: skip
    return out


def told(apart: Iterable[dict] | None) -> bool:
    """Whether every rival of a named answer can be told from the truth, and some were asked."""
    margins = [x["margin"] for x in apart or ()]
    return bool(margins) and min(margins) >= TELLS


def honest(apart: Iterable[dict] | None) -> bool:
    """Whether no rival of an ambiguous answer could have been told from the truth."""
    return apart is not None and all(x["margin"] < TELLS for x in apart)


def _sets(found) -> list[list[Effect]]:
    """By effect of the answer what it may be, itself and its equals; of a named one its rivals."""
    outcome, named = found.details["found"], found.verdict == "named"
    near = outcome.rivals if named else found.details["judged"].equals
    return [
        [e, *(rival for rival, *_ in near.get(i, [])[: NEAREST if named else None])]
        for i, e in enumerate(outcome.fit.point.effects)
    ]


def _name(effect: Effect) -> Name:
    return effect.id, effect.place


def _truly(effect: Effect, true: dict[Name, dict[str, Any]]) -> Effect:
    """An effect of the answer with its true numbers, where the truth tells them."""
    known = {k: v for k, v in true[_name(effect)].items() if k in effect.values}
    return Effect(effect.id, effect.place, effect.values | known)


def _cost(model: AbstractModel, fit) -> float:
    """chi2 on all runs, with the priors' part."""
    (held,) = model.residuals([fit.point], "held-out")
    return fit.cost + float(held @ held)
