"""From a calibrated model to what is said: search, noise, judgement; of any machine."""

import dataclasses
from typing import Any, NamedTuple

import numpy as np

from ._answer import (
    JUDGES,
    AbstractEvidence,
    Diagnosis,
    Named,
    Shown,
    Verdict,
    answering,
    baseline_table,
    closed_in_fitted_runs,
    gaps,
    judge,
    named,
    noise_remarks,
    noise_table,
    notes,
    plain_where,
    score_table,
    separating,
    shown_by_fitted_runs_alone,
    shown_noise,
    stretches,
    with_unit_directions,
)
from ._search import (
    Explored,
    Fit,
    HeldOut,
    Point,
    Search,
    SearchPath,
    SearchResult,
    Unsteady,
    seen_from,
    unsteady,
    upper_limits,
    within_doubt,
)


class Searched(NamedTuple):
    """What a search found, the evidence as it was weighed there, and the noise that it shows.

    `earlier` is what was shown before runs were weighed anew, `limits` the upper limits.
    """

    evidence: AbstractEvidence
    outcome: SearchResult
    shown: Shown
    earlier: Shown | None
    limits: list[dict[str, Any]]


def answered(evidence: AbstractEvidence, start: Point | None, tell) -> Diagnosis:
    """Search from `start`, judge, and say what was found: of any machine.

    Held-out runs that are moved too little to tell what fitted runs show find nothing missing.  The
    question is then put once more to parts of the fitted runs that are kept out of the fit too.
    """
    searched = _searched(evidence, start, tell)
    judged = _judged_by(searched)
    asked, outcome, shown, *_ = searched
    alone = shown_by_fitted_runs_alone(asked, outcome, shown)
    if alone is None or judged.verdict == "unknown":
        return _said(searched, judged, [], tell)
    if judged.verdict != "none":
        return _said(searched, judged, [f"Left beside it: {alone.said}."], tell)
    by_parts = asked.parted()
    if by_parts is not None:
        tell(f"{alone.said}: parts of them are kept out of the fit too")
        asked.model.rest()
        again = _searched(by_parts, outcome.baseline.point, tell)
        other = _judged_by(again)
        if other.verdict != "none":
            return _said(again, other, [f"Asked because there is {alone.said}."], tell)
    if not alone.gap:
        return _said(searched, judged, [f"Not confirmed by parts of them: {alone.said}."], tell)
    text = f"{alone.said}, and that no known effect closes"
    return _said(searched, dataclasses.replace(judged, verdict="unknown", reason=text), [], tell)


def _searched(evidence: AbstractEvidence, start: Point | None, tell) -> Searched:
    """Search from `start`; once more where the noise is shown to be another one than assumed."""
    who = JUDGES[evidence.confirmed_on].name
    search = Search(evidence.model, tell, who)
    evidence, search, explored = _with_samples_back(evidence, search, search.explore(start))
    tell("looking at what is left")
    shown = beside_doubt(evidence, explored.baseline, explored.way.fit)
    outcome, limits = None, None
    if not shown.matters:
        outcome, limits, shown = _reviewed(search, evidence, explored, shown)
    earlier = None
    if shown.coloured and _surely_unsteady(evidence, explored, shown):
        tell("what looked like noise is an effect that changes over the runs: it is none")
        outcome, limits, shown = _reviewed(search, evidence, explored, shown.refuted())
    if outcome is None and shown.matters and evidence.reweighs:
        explored = explored.without_table()  # room for the next one
        evidence.model.rest()
        other = evidence.renoised(shown.changes)
        names = sorted({c for run in shown.changes for c in run})
        tell(f"the noise of {', '.join(names)} is not as assumed: searching again")
        again = Search(other.model, tell, who)
        anew = again.explore(explored.baseline.point, explored.way.fit.point, doubted=True)
        if explained(other.model, anew.way):
            tell("what looked like noise is explained in part by candidates: it is none")
            shown = shown.refuted()
        else:
            evidence, search, explored = _with_samples_back(other, again, anew)
            earlier, outcome = shown, None
            tell("looking at what is left")
            shown = beside_doubt(evidence, explored.baseline, explored.way.fit)
    if outcome is None:
        outcome, limits, shown = _reviewed(search, evidence, explored, shown)
    outcome.signatures = None  # room for a learned term
    return Searched(evidence, outcome, shown, earlier, limits or [])


def _with_samples_back(
    evidence: AbstractEvidence, search: Search, explored: Explored
) -> tuple[AbstractEvidence, Search, Explored]:
    """The same, or a search from there with samples that were left out before it, and now fit.

    Impacts of a play stand out like shocks until it is known.
    """
    back = evidence.readmitted(explored.way.fit.point)
    if back is None:
        return evidence, search, explored
    evidence.model.rest()
    search.tell("samples that had been left out fit what was found: searching on with them")
    again, known = Search(back.model, search.tell, search.who), explored.way.fit.point
    return back, again, again.explore(explored.baseline.point, known)


def _surely_unsteady(
    evidence: AbstractEvidence, explored: Explored, shown: Shown
) -> list[Unsteady]:
    """Effects that change over the runs at the fit, and also at its best point within errors."""
    fit = explored.way.fit
    changing = unsteady(evidence.model, fit, evidence.alike)
    point = _granted(evidence, explored.baseline, fit, shown) if changing else None
    return changing if point is None else _unsteady_at(evidence, fit, point)


def _unsteady_at(evidence: AbstractEvidence, fit: Fit, point: Point) -> list[Unsteady]:
    """The `unsteady` effects of a fit as it is at another point."""
    return unsteady(evidence.model, seen_from(evidence.model, fit, point), evidence.alike)


def _granted(evidence: AbstractEvidence, baseline: Fit, fit: Fit, shown: Shown) -> Point | None:
    """The point within the errors of a fit's numbers that predicts held-out runs best, or None.

    Only for a fit that explains the fitted runs: else its numbers have moved to make up for a
    missing effect, and their errors mean nothing.
    """
    if _fitted_gap_closed(evidence, baseline, fit, shown) < evidence.closing:
        return None
    return within_doubt(evidence.model, fit)


def _fitted_gap_closed(evidence: AbstractEvidence, baseline: Fit, fit: Fit, shown: Shown) -> float:
    """Share of the fitted runs' gap that a fit closes; 1 where none of it is left."""
    if not shown.structured_in_fitted_runs:
        return 1.0
    left = (_left(evidence, x.point, "train")[0] for x in (baseline, fit))
    return closed_in_fitted_runs(shown, *left)


def beside_doubt(evidence: AbstractEvidence, baseline: Fit, fit: Fit) -> Shown:
    """The noise shown beside a fit whose numbers may move within their errors.

    A mode that only held-out runs excite leaves a residual that depends on the machine's state and
    has a colour.  Without this step that colour counts as the noise's, and the search is repeated.
    """
    shown = shown_noise(evidence, fit.point)
    if not any(shown.structure.values()):
        return shown
    evidence.model.tell("asking what the calibration leaves open of it")
    point = _granted(evidence, baseline, fit, shown)
    if point is None:
        return shown
    return dataclasses.replace(shown_noise(evidence, point), granted=True)


def explained(model, way: SearchPath) -> bool:
    """Whether some candidate explains a material part of the residual that counted as noise.

    It has to do so on the held-out runs too: a wandering channel drifts in every run, but each time
    by another amount.
    """
    least = 0.5 * model.settings.material_change * model.dof("train")
    sure = model.settings.sure_sigmas
    return bool(way.trials) and any(t.gain > least and t.held.sure > sure for t in way.trials[-1])


def _reviewed(search: Search, evidence: AbstractEvidence, explored: Explored, shown: Shown):
    """(the search's result, the limits, the noise shown), after the review of what it accepted."""
    outcome = search.reviewed(explored)
    limits = _limits(evidence.model, outcome)
    names = sorted(e.name for e in explored.way.fit.point.effects)
    if sorted(e.name for e in outcome.fit.point.effects) != names:  # of several lines one may go
        shown = beside_doubt(evidence, outcome.baseline, outcome.fit)
    return outcome, limits, shown


def _judged_by(searched: Searched) -> Verdict:
    """The verdict of a search; an `unknown` is judged again with numbers within their errors."""
    evidence, outcome, shown, *_ = searched
    (first, _), (last, _) = (_left(evidence, x.point) for x in (outcome.baseline, outcome.fit))
    changing = unsteady(evidence.model, outcome.fit, evidence.alike)
    bent = evidence.misshapen(outcome.fit)
    judged = _judged(evidence, outcome, shown, first, last, changing, bent)
    if judged.verdict == "unknown":
        judged = _beside_doubt(evidence, outcome, shown, first, judged, bent)
    elif shown.granted:
        judged = _granting(judged)
    return _beside_unlisted(evidence, outcome, judged)


def _beside_unlisted(evidence: AbstractEvidence, outcome: SearchResult, judged: Verdict) -> Verdict:
    """The verdict, but that several effects are not named where fewer numbers explain as much.

    Numbers that the rig file takes for exact: a part out of its tolerance imitates many laws.
    """
    count = len(outcome.fit.free)
    if judged.verdict not in ("named", "ambiguous") or len(outcome.fit.point.effects) < 2:
        return judged
    evidence.model.tell("asking whether a number that was taken for exact stands for all of them")
    equal = outcome.fit.cost + evidence.model.settings.equal_margin
    for other in evidence.unlisted(outcome.baseline):
        if len(other.numbers) < count and other.cost < equal:
            text = (
                f"{other.path}, which the rig file takes for exact, explains the runs as well as "
                f"{len(outcome.fit.point.effects)} effects"
            )
            return dataclasses.replace(judged, verdict="unknown", reason=text)
    return judged


def _left(
    evidence: AbstractEvidence, point: Point, split: str = "held-out"
) -> tuple[list[dict[str, Any]], np.ndarray]:
    """What a point leaves of the runs of a split: by run and channel, and as a vector."""
    (left,) = evidence.model.residuals([point], split)
    return evidence.columns(left, split), left


def _said(searched: Searched, judged: Verdict, beside: list[str], tell) -> Diagnosis:
    """The answer of a search; the sentences `beside` follow the verdict's reason."""
    evidence, outcome, shown, earlier, limits = searched
    model, noise = evidence.model, noise_table(evidence, shown, earlier)
    answer = answering(outcome, judged)
    (first, before), (last, after) = (_left(evidence, x.point) for x in (outcome.baseline, answer))
    tell(f"verdict: {judged.verdict} ({judged.reason})")
    effects = named(evidence, outcome, judged)
    learned = None
    if judged.verdict == "unknown":
        scores = outcome.scans[0].best_per_name() if outcome.scans else []
        learned = evidence.learn(outcome.baseline, scores, tell)
        tell("asking whether a number that was taken for exact is off")
        beside = [*beside, *(x.said() for x in evidence.unlisted(outcome.baseline))]
        if learned is None:
            beside = [*beside, *evidence.without_term]
        else:
            after = learned.residual
        last = evidence.columns(after, "held-out")
    where, everything = [], []
    if judged.verdict != "none":
        tell("looking where the gap is")
        where, everything = evidence.locate(outcome.baseline.point)
    reason, *further = notes(evidence, outcome, judged, noise_remarks(noise))
    unexplained = _unexplained(evidence, outcome, judged)
    if limits and f"{unexplained:.2g}" != "1":
        further.append(
            f"A missing effect may hide others: the limits are {unexplained:.2g} times what they "
            "would be without the gap."
        )
    experiment = separating(evidence, outcome, judged, tell)
    if judged.verdict == "ambiguous" and experiment is None:
        further.append(
            "No next experiment is proposed: some rival runs away in every motion tried."
        )
    result = Diagnosis(
        verdict=judged.verdict,
        effects=effects,
        where=plain_where(where),
        gap=gaps(evidence, shown, first, last),
        next_experiment=experiment,
        baseline=baseline_table(outcome, answer, model.dof("train")),
        noise=noise,
        scores=score_table(outcome),
        confirmed_on=evidence.confirmed_on,
        excluded=[
            x | {"unit": evidence.unit(x["unit"], x["place"], x["parameter"])}
            for x in _excluded(limits, outcome, effects, unexplained)
        ],
        learned=None if learned is None else learned.table(),
        notes=[reason, *beside, *further],
        faults=evidence.faults,
        rig=evidence.described(with_unit_directions(model.laws, answer.point)),
    )
    result.details = {"model": model, "found": outcome, "judged": judged, "before": before,
                      "after": after, "where": everything, "learned": learned,
                      "evidence": evidence, "shown": shown}  # fmt: skip
    return result


def _judged(
    evidence: AbstractEvidence, outcome: SearchResult, shown: Shown, first, last, changing, bent=()
) -> Verdict:
    """The verdict, by what this kind of machine is held to."""
    return judge(
        outcome, shown, first, last, evidence.model.settings.equal_margin, evidence.closing,
        evidence.alike, evidence.confirmed_on, changing, stretches(evidence, first, last),
        _fitted_gap_closed(evidence, outcome.baseline, outcome.fit, shown), bent,
    )  # fmt: skip


def _beside_doubt(
    evidence: AbstractEvidence, outcome: SearchResult, shown: Shown, first, judged: Verdict, bent
) -> Verdict:
    """The verdict once what the numbers leave open is granted to the held-out runs."""
    model = evidence.model
    point = _granted(evidence, outcome.baseline, outcome.fit, shown)
    if point is None:
        return judged
    (left,) = model.residuals([point], "held-out")
    last = evidence.columns(left, "held-out")
    changing = _unsteady_at(evidence, outcome.fit, point)
    without = model.residuals([less.point for less, _ in outcome.alone.values()], "held-out")
    shows = {i: HeldOut.of(x, left) for i, x in zip(outcome.alone, without, strict=True)}
    outcome = dataclasses.replace(outcome, shows=shows)
    again = _judged(evidence, outcome, shown_noise(evidence, point), first, last, changing, bent)
    return judged if again.verdict == "unknown" else _granting(again)


def _granting(judged: Verdict) -> Verdict:
    """The verdict with the words that it stands on numbers within their errors."""
    text = f"{judged.reason}, where that which the fitted runs leave open is granted"
    return dataclasses.replace(judged, reason=text)


def _limits(model, outcome: SearchResult) -> list[dict[str, Any]]:
    """Upper limits of every effect and place."""
    if outcome.signatures is None:
        return []
    return upper_limits(model, outcome.fit, outcome.signatures, set())


def _excluded(
    limits: list[dict[str, Any]],
    outcome: SearchResult,
    effects: list[Named],
    unexplained: float,
) -> list[dict[str, Any]]:
    """The limits of what may be missing: of none that stands in the fit, nor of a rival of one.

    Beside one of them a second one is small, which says nothing of how large it is in its place.
    Where a gap is left that nothing explains a law may hide in it: limits are `unexplained` times
    as large, and none is told of what was near to an effect of the fit, of which none is named.
    A bound is excluded where the law's own size there, so many times as large, is; no limit is told
    above the largest size that its effect may have.
    """
    standing = {(e.id, e.place) for e in (*outcome.fit.point.effects, *effects)}
    standing |= {(x["id"], x["place"]) for e in effects for x in e.indistinguishable_from}
    if not effects:
        standing |= {(e.id, e.place) for near in outcome.rivals.values() for e, *_ in near}
    return [_beside(x, unexplained) for x in limits if (x["id"], x["place"]) not in standing]


def _beside(limit: dict[str, Any], unexplained: float) -> dict[str, Any]:
    """A limit beside a gap in which its law may hide."""
    told = {k: x for k, x in limit.items() if k not in ("share", "largest")}
    if told["limit_95"] is None:
        return told
    if "share" in limit:
        hidden = unexplained * limit["share"] >= 1
        return told | {"limit_95": None} if hidden else told
    wide = unexplained * told["limit_95"]
    return told | {"limit_95": wide if wide < limit["largest"] else None}


def _unexplained(evidence: AbstractEvidence, outcome: SearchResult, judged: Verdict) -> float:
    """RMS in sigma that an unknown answer leaves of the held-out runs; 1 of other answers."""
    rows = evidence.model.dof("held-out")
    if judged.verdict != "unknown" or not rows:
        return 1.0
    return float(np.sqrt(max(1.0, outcome.held_after / rows)))
