"""What fitted runs alone show: asked before simulation and data agree.

Held-out runs confirm effects and judge what is left.  What they do not excite leaves nothing in
them, and no law for it can be confirmed there; that is no sign that nothing is missing.
"""

from typing import NamedTuple

from .._search import SearchResult, Trial
from .evidence import AbstractEvidence
from .judges import JUDGES
from .shown import Shown


class Alone(NamedTuple):
    """In words what fitted runs alone show, and whether it is a `gap`: what is no noise."""

    said: str
    gap: bool


def shown_by_fitted_runs_alone(
    evidence: AbstractEvidence, outcome: SearchResult, shown: Shown
) -> Alone | None:
    """What fitted runs show beside the fit of `outcome`, where the others show nothing, or None.

    A function of the machine's state, at the false-discovery rate of `where`; or a law that the
    fitted runs need as much as one that is named, and of which the others cannot tell.  None too
    where there are no others.
    """
    if evidence.confirmed_on == "nothing":
        return None
    who, open_ = JUDGES[evidence.confirmed_on].name, shown.structured_in_fitted_runs
    untold = _untold(evidence, outcome)
    names = ", ".join(dict.fromkeys(t.effect.name for t in untold))
    law = f"the fitted runs show {names}, of which {who} are moved too little to tell"
    if open_:
        gap = f"a gap in {', '.join(open_)} of the fitted runs that {who} do not show"
        return Alone(f"{gap}; {law}" if untold else gap, True)
    return Alone(law, False) if untold else None


def _untold(evidence: AbstractEvidence, outcome: SearchResult) -> list[Trial]:
    """Refused trials that the others neither confirm nor refute, and that would be named else.

    Each was significant among all candidates; its gain is that of an effect that is needed, and it
    moves some group's RMS by one per cent.
    """
    model, settings = evidence.model, evidence.model.settings
    left = model.group_rms(outcome.fit.residual, "train")

    def matters(trial: Trial) -> bool:
        beside = model.group_rms(trial.fit.residual, "train")
        return any(left[g] > (1 + settings.material_change) * x for g, x in beside.items())

    tried = [t for trials in outcome.trials for t in trials]
    return [
        t for t in tried
        if not (t.accepted or t.held.tells(settings)) and t.gain > settings.margin and matters(t)
    ]  # fmt: skip
