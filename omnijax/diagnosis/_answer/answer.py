"""What is said of a search: named effects with sizes, calibrated parameters, scores and notes."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..._text import listed, quantity_text
from ...laws import AbstractLaw, Parameter
from .._search import AbstractModel, Effect, Fit, Point, Prior, SearchResult, predicted
from .._settings import SETTINGS
from .evidence import AbstractEvidence
from .judges import JUDGES
from .named_effect import Named, are_rivals
from .verdict import Verdict


def named(evidence: AbstractEvidence, outcome: SearchResult, judged: Verdict) -> list[Named]:
    """The named effects, and their equals as entries of their own.

    Each with 1-sigma of its numbers and the evidence of the joint refit that it is in.
    """
    if judged.verdict not in ("named", "ambiguous"):
        return []
    model, fit, out = evidence.model, outcome.fit, []
    dof = model.dof("train")
    scaled = fit.scaled_covariance(dof)
    floor, price = min(judged.floor, outcome.held_after), float(np.log(dof))
    for i, effect in enumerate(fit.point.effects):
        near = judged.equals.get(i, [])
        less, held = outcome.alone.get(i, (outcome.baseline, outcome.held_before))
        margin = min((r.margin for r in outcome.rivals.get(i, [])), default=None)
        mine = {"margin_to_next": margin}
        refits = [  # effect, chi2 of both splits, covariances, and what stands beside these
            (effect, fit.chi2, outcome.held_after, fit.covariances(i, scaled), mine),
            *((r.effect, r.chi2, r.held, r.covariances, {"margin": r.margin, "cosine": r.cosine})
              for r in near),
        ]  # fmt: skip
        everyone = [one for one, *_ in refits]
        for one, chi2, left, numbers, beside in refits:
            gain = None if left is None else held - left
            evidenced = {
                "delta_bic": chi2 - less.chi2 + price * sum(map(len, numbers.values())),
                "held_out_gain": None if gain is None else _closed(gain, held - floor),
                "held_out_chi2": gain, **beside,
            }  # fmt: skip
            law = model.laws[one.id].parameters
            sigma = {k: _sigma(law[k], one.values[k], x) for k, x in numbers.items()}
            parameters = _parameters(evidence, one, sigma)
            others = _others(everyone, one, outcome)
            out.append(Named(one.id, one.place, parameters, evidenced, others))
    return together(out)


def _closed(gain: float, gap: float) -> float:
    """Share of a gap in chi2 that a gain closes, from -1 to 1; 0 where there is no gap."""
    return float(np.clip(gain / gap, -1.0, 1.0)) if gap > 0 else 0.0


def _sigma(parameter: Parameter, value: Any, covariance: np.ndarray) -> list[float]:
    """1-sigma of a parameter's numbers; of a direction across it, for its length says nothing."""
    if _is_direction(parameter) and len(covariance) == 3:
        size = float(np.linalg.norm(value))
        across = (np.eye(3) - np.outer(value, value) / size**2) / size
        covariance = across @ covariance @ across.T
    return np.sqrt(np.maximum(np.diag(covariance), 0.0)).tolist()


def _is_direction(parameter: Parameter) -> bool:
    """Whether a parameter is a direction, of which laws take the unit vector."""
    return parameter.shape == 3 and parameter.unit == "1"


def with_unit_directions(laws: Mapping[str, type[AbstractLaw]], point: Point) -> Point:
    """The point with its effects' directions of length 1: a fit leaves it free."""
    effects = []
    for effect in point.effects:
        known = laws[effect.id].parameters
        values = {
            k: v / np.linalg.norm(v) if _is_direction(known[k]) else v
            for k, v in effect.values.items()
        }
        effects.append(dataclasses.replace(effect, values=values))
    return point.with_effects(*effects)


def _others(everyone: list[Effect], effect: Effect, outcome: SearchResult) -> list[dict[str, str]]:
    """What an effect is not told from: its rivals, and a twin that does no more in these runs."""
    other = [{"id": e.id, "place": e.place} for e in everyone if e.name != effect.name]
    twin = ROLLS_ALIKE.get(effect.id)
    if f"{twin}@{effect.place}" in outcome.wider.get(effect.name, ()):
        other.append({"id": str(twin), "place": effect.place})
    return other


ROLLS_ALIKE = {"creep": "wheel-radius"}  # which changes the shape too: that may be too little


def together(effects: list[Named]) -> list[Named]:
    """Several lines of torque at one wheel as one effect, the strongest first.

    A line that would stand in another effect's place is none of them, and stays a rival.
    """
    lines: dict[str, list[Named]] = {}
    for e in effects:
        if e.id == "motor-ripple" and "margin" not in e.evidence:
            lines.setdefault(e.place, []).append(e)
    lines = {place: some for place, some in lines.items() if len(some) > 1}
    told = [e for some in lines.values() for e in some]
    return [
        *(_of_the_whole(e, lines) for e in effects if not any(e is line for line in told)),
        *map(_cogging, lines.values()),
    ]


def _of_the_whole(effect: Named, lines: dict[str, list[Named]]) -> Named:
    """A rival of one of the lines is one of the cogging that they are told as."""
    places = [p for p, some in lines.items() if any(are_rivals(effect, e) for e in some)]
    if not places:
        return effect
    rivals = [
        r | {"id": "cogging"} if r["id"] == "motor-ripple" and r["place"] in places else r
        for r in effect.indistinguishable_from
    ]
    return dataclasses.replace(effect, indistinguishable_from=rivals)


def _cogging(lines: list[Named]) -> Named:
    lines = sorted(lines, key=lambda e: -e.parameters["amplitude"]["value"])
    parameters = {
        f"{key}s": {
            "value": [e.parameters[key]["value"] for e in lines],
            "sigma": [e.parameters[key]["sigma"] for e in lines],
            "unit": lines[0].parameters[key]["unit"],
        }
        for key in ("amplitude", "order", "phase")
    }
    weakest = min(lines, key=lambda e: e.evidence["held_out_chi2"])
    every = [r for e in lines for r in e.indistinguishable_from]
    rivals = [r for k, r in enumerate(every) if r not in every[:k]]
    return Named("cogging", lines[0].place, parameters, weakest.evidence, rivals)


def _parameters(evidence: AbstractEvidence, effect: Effect, spread: dict) -> dict:
    law, out = evidence.model.laws[effect.id], {}
    (told,) = with_unit_directions(evidence.model.laws, Point(np.zeros(0), (effect,))).effects
    for key, value in told.values.items():
        own = spread.get(key)
        vector = np.ndim(value) > 0
        out[key] = {
            "value": np.asarray(value).tolist() if vector else float(value),
            "sigma": None if own is None else own if vector else own[0],
            "unit": evidence.unit(law.parameters[key].unit, effect.place, key),
        }
    return out | evidence.reported(effect)


def answering(outcome: SearchResult, judged: Verdict) -> Fit:
    """The fit that is the answer: where no effect is named that without effects."""
    return outcome.fit if judged.verdict in ("named", "ambiguous") else outcome.baseline


def baseline_table(outcome: SearchResult, fit: Fit, dof: int) -> list[dict[str, Any]]:
    """Uncertain parameters before, calibrated without effects and in `fit`, and what is known.

    Their 1-sigma are those that the fit's `dof` rows show; a number at an end of its range has none
    and is not known.  `absorbed` is a share of the number where `relative`, else in its unit.
    """
    out = []
    priors = outcome.priors
    sigma = np.sqrt(np.maximum(np.diag(fit.scaled_covariance(dof)), 0.0))
    for k, prior in enumerate(priors):
        first, last = prior.at(outcome.baseline.point.u[k]), prior.at(fit.point.u[k])
        at_end = prior.at_bound(fit.point.u[k])
        own = sigma[k] * prior.sigma
        out.append({
            "parameter": prior.name, "unit": prior.unit, "stated": prior.value,
            "without_effects": first, "with_effects": last,
            "relative_sigma": None if at_end else float(own),
            "sigma": None if at_end else float(own * (abs(last) if prior.relative else 1.0)),
            "absorbed": float(np.log(first / last) if prior.relative else first - last),
            "relative": prior.relative,
            "determined": bool(sigma[k] < SETTINGS.answer_result.determined_sigma and not at_end),
            "at_bound": at_end,
        })  # fmt: skip
    return out


def score_table(
    outcome: SearchResult, most: int = SETTINGS.search.shown_most
) -> list[dict[str, Any]]:
    """The score plot's numbers: the best candidates of every step.

    `beside` names the effects of the answer that a step has taken up already: no candidates of it.
    """
    out = []
    for step, scan in enumerate(outcome.scans):
        best = scan.best_per_name()[:most]
        tried = {(c.id, c.place) for c in scan.layout.candidates}
        taken = [e for e in outcome.fit.point.effects if (e.id, e.place) not in tried]
        beside = [f"{e.id} at {e.place}" for e in taken]
        for s in best:
            out.append({
                "step": step + 1, "id": s.candidate.id, "place": s.candidate.place,
                "beside": beside, "note": s.candidate.note, "gain": s.gain,
                "columns": s.columns, "p": s.p,
                "cosine_to_best": scan.cosine(best[0].index, s.index),
            })  # fmt: skip
    return out


def plain_where(where: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """What is written of where the gap is."""
    keys = ("channel", "domain", "value", "reference", "share", "p", "rms_over_noise", "stands")
    return [{k: w[k] for k in keys} for w in where]


def notes(
    evidence: AbstractEvidence, outcome: SearchResult, judged: Verdict, noise: list[str]
) -> list[str]:
    """The verdict's reason first, then what a reader should know of how it was found."""
    model = evidence.model
    known = judged.verdict in ("named", "ambiguous")
    fit = answering(outcome, judged)
    clocks = evidence.clocks(fit, judged.verdict == "unknown")
    said = [judged.reason + ".", *_best_known(outcome, judged)]
    said += [*_only_there(evidence, outcome, judged), *noise, *clocks]
    said += ended(outcome.priors, fit.point)
    said += evidence.remarks()
    said += twins(outcome, judged)
    said += [
        f"These runs do not tell {name} from {' and '.join(wider)}, of which it is a limit: the "
        "plainer law is named."
        for name, wider in (outcome.wider.items() if known else ())
    ]
    if known:
        said += [*evidence.beside_held(fit.point), *lines_left_open(evidence, outcome)]
    if model.spent:
        said.append(
            f"The search ended at its budget of {model.budget:g} evaluations of the model since it "
            "began or since an effect closed most of the gap: further effects and some rivals have "
            "not been tried."
        )
    said += unended(model, fit)
    if outcome.refused:
        who = JUDGES[evidence.confirmed_on].name
        said.append(f"Not confirmed by {who}: {', '.join(outcome.refused)}.")
    dead = unseen(outcome)
    if dead:
        said.append(
            f"These candidates change no measured channel in these runs: {', '.join(dead)}."
        )
    return said


def lines_left_open(evidence: AbstractEvidence, outcome: SearchResult) -> list[str]:
    """Which effects' lines the fitted runs tell no better than others, so that others told them."""
    who = JUDGES[evidence.confirmed_on].name
    return [
        f"The fitted runs tell {count} orders, or sets of them, of {name} equally well: the one is "
        f"told of which {who} show most, so its numbers are not confirmed by these as its name is."
        for name, count in outcome.left_open.items()
    ]


def _best_known(outcome: SearchResult, judged: Verdict) -> list[str]:
    """Of an unknown answer the effects that it speaks of and does not name."""
    effects = outcome.fit.point.effects
    if judged.verdict != "unknown" or not effects:
        return []
    return [
        f"The best known effects: {listed([e.name for e in effects])}. They are not named, and "
        "what is told of the gap, its parameters and the diagnosed rig is without them."
    ]


def ended(priors: Sequence[Prior], point: Point) -> list[str]:
    """Which uncertain numbers stand at an end of their ranges, in a sentence."""
    ends = [
        f"{p.name} ({quantity_text(p.at(u), p.unit)})"
        for p, u in zip(priors, map(float, point.u), strict=True) if p.at_bound(u)
    ]  # fmt: skip
    if not ends:
        return []
    one = len(ends) == 1
    why = "it is not known and has" if one else "they are not known and have"
    return [
        f"At an end of {'its range' if one else 'their ranges'}: {listed(ends)}. These runs ask "
        f"for more than that, so {why} no sigma: either more is uncertain than was stated, or "
        "something that is missing is made up for."
    ]


def unended(model: AbstractModel, fit: Fit) -> list[str]:
    """That a fit's steps had not come to their end, by what one more of them promises."""
    if not np.isfinite(fit.cost):
        return []
    _, cost = predicted(model, fit.point, fit.residual, fit.jacobian)
    fall = fit.cost - cost
    if fall < SETTINGS.answer_result.unended_fall * max(1.0, fit.chi2 / model.dof("train")):
        return []
    return [
        f"The last refit had not come to its end: one more step promises to lower its chi2 of "
        f"{fit.chi2:.6g} by {fall:.2g}, so that sizes and calibrated numbers may be off by more "
        "than their sigma says."
    ]


def _only_there(evidence: AbstractEvidence, outcome: SearchResult, judged: Verdict) -> list[str]:
    """What to do about a gap in held-out runs of which the fitted runs, which teach, show none."""
    model, n = evidence.model, evidence.model.dof("train")
    explained = outcome.fit.chi2 < n + model.settings.noise_sigmas * np.sqrt(2 * n)
    if not (judged.open and explained and evidence.confirmed_on == "held-out"):
        return []
    return [
        "The fitted runs are explained to their noise: what is missing acts in the held-out runs "
        "alone, of which nothing is learned. With such a run among the fitted ones "
        '(`role = "train"`) it may be named.'
    ]


def unseen(outcome: SearchResult) -> list[str]:
    """Names of the candidates of which no variant changes anything in the first scan."""
    taken = {e.name for e in outcome.fit.point.effects}  # a search may begin with effects
    scores = [s for scan in outcome.scans[:1] for s in scan.scores]
    seen = {s.candidate.name for s in scores if not s.dead}
    return sorted({s.candidate.name for s in scores} - seen - taken)


TWINS = {  # effects that a part within its tolerance imitates, and what to list as uncertain
    "creep": ("a wheel radius that is off by the same share", "wheel.radius"),
    "wheel-radius": (
        "a sphere radius that is off the other way, where all wheels show it",
        "sphere.radius",
    ),
    "sensor-gain": ("a roundness that is off, which scales what gaps do", "wheel.roundness"),
    "motor-gain": ("an inertia that is off, where all wheels show it", "wheel.inertia"),
}


def twins(outcome: SearchResult, judged: Verdict) -> list[str]:
    """Which named effects could be parts within tolerance that the rig file takes for exact."""
    if judged.verdict not in ("named", "ambiguous"):
        return []
    free = {p.name.rpartition(".")[2] for p in outcome.priors}
    return [
        f"{e.name} could also be {TWINS[e.id][0]}: if the drawing leaves that open, list "
        f'"{TWINS[e.id][1]}" under [uncertainty] and diagnose again.'
        for e in outcome.fit.point.effects
        if e.id in TWINS and TWINS[e.id][1].rpartition(".")[2] not in free
    ]


def separating(
    evidence: AbstractEvidence, outcome: SearchResult, judged: Verdict, tell
) -> dict | None:
    """The experiment that tells the rivals of the first ambiguous effect apart."""
    if judged.verdict != "ambiguous":
        return None
    tell("simulating what would tell the rivals apart")
    point = outcome.fit.point
    i, near = next((i, near) for i, near in judged.equals.items() if near)
    effects = list(point.effects)
    others = [Point(point.u, (*effects[:i], r.effect, *effects[i + 1 :])) for r in near]
    return evidence.experiment([point, *others])
