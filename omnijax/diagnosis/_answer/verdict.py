"""The four answers: none, named, ambiguous, unknown."""

import dataclasses

import numpy as np

from .._search import MARGIN, AbstractModel, Found

CLOSED = 0.95  # share of the held-out gap that a named set has to close
EXCESS = 0.3  # sigma: below this in every group, simulation and data agree
SURE = 3.0  # standard errors by which an estimated noise may be off


@dataclasses.dataclass(frozen=True)
class Judged:
    """The verdict, how much of the held-out gap is closed, and each effect's equals."""

    verdict: str
    closed: float
    equals: dict[int, list]
    reason: str


def judge(
    model: AbstractModel, found: Found, before: dict, after: dict, error: dict[str, float]
) -> Judged:
    """The verdict from the search and the held-out (squares, dof) by group before and after.

    `error` is by group the relative 1-sigma of the noise itself, 0 where it was declared.
    """
    slack = {g: (1 + SURE * error[g]) ** 2 for g in after}
    floor = sum(min(after[g][0], slack[g] * after[g][1]) for g in after)
    total_before = sum(s for s, _ in before.values())
    total_after = sum(s for s, _ in after.values())
    above = total_before - floor
    closed = (total_before - total_after) / above if above > 0 else 1.0
    excess = {g: np.sqrt(max(0.0, s / dof - slack[g])) for g, (s, dof) in before.items()}
    left = {g: np.sqrt(max(0.0, s / dof - slack[g])) for g, (s, dof) in after.items()}
    effects = found.fit.point.effects
    if not effects:
        return _without_effects(found, before, excess, slack)
    equals = {
        i: [(e, margin, cosine) for e, margin, cosine in near if margin < MARGIN]
        for i, near in found.rivals.items()
    }
    noise_only = max(left.values()) < EXCESS
    if closed < CLOSED and not noise_only:
        text = f"the best known effects close {100 * closed:.0f} % of the held-out gap"
        return Judged("unknown", closed, equals, text)
    if any(equals.values()):
        return Judged("ambiguous", closed, equals, "joint refits of rivals are equally good")
    return Judged("named", closed, equals, "held-out runs confirm the joint refit")


def _without_effects(found: Found, before, excess, slack) -> Judged:
    count = sum(dof for _, dof in before.values())
    surprise = sum(s - slack[g] * dof for g, (s, dof) in before.items()) / np.sqrt(2 * count)
    if max(excess.values()) < EXCESS and (surprise < 6 or not found.significant):
        return Judged("none", 1.0, {}, "what is left is within the noise")
    if max(excess.values()) < EXCESS:
        return Judged("none", 1.0, {}, "what is left is below 0.3 sigma in every group")
    text = "a significant gap that no known effect closes on held-out runs"
    return Judged("unknown", 0.0, {}, text)
