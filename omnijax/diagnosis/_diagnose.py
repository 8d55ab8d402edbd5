"""`diagnose`: a case in, a verdict with its evidence out."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from ..laws import EFFECTS
from ..recording import Case, noise_floor, read_case
from ..rig import InputError
from ._fit import refit
from ._gap import UNITS, gaps, group_squares
from ._model import Effect, Point
from ._outliers import without_outliers
from ._result import Diagnosis, Named
from ._rig_model import RigModel
from ._runs import to_run
from ._search import Found, Search
from ._start_angles import with_start_angles, without_encoder
from ._verdict import Judged, judge
from ._where import locate


def diagnose(
    case: str | Path | Case,
    *,
    laws: dict[str, Any] | None = None,
    window: float = 1.0,
    tell: Callable[[str], None] = lambda text: None,
) -> Diagnosis:
    """Diagnose a case: where do simulation and data disagree, and which missing effect is it?

    `case` is a folder (one rig file and its runs) or a `Case`, `laws` are users' own laws by id
    (`load_laws(file)`), `window` the length in s after which Omega and the rolled lengths start
    anew, so that small torque errors cannot add up.  Seeds are fixed: equal input, equal answer.
    """
    case = case if isinstance(case, Case) else read_case(case)
    # small matrices: threads that wait for each other take ten times the time where cores are busy
    with threadpool_limits(1, "blas"):
        return _diagnosed(case, {**EFFECTS, **(laws or {})}, window, tell)


def _diagnosed(case: Case, library, window: float, tell) -> Diagnosis:
    runs = [to_run(r) for r in case.runs]
    noise, table = _noise(case)
    tell("calibrating the uncertain parameters")
    model, start, wild = _model(case.rig, runs, noise, library, window)
    model.work = 0.0
    found = Search(model, tell).run(start)
    (before,) = model.residuals([found.baseline.point], "held-out")
    (after,) = model.residuals([found.fit.point], "held-out")
    rows = [model.machine.rows[i] for i in model.splits["held-out"]]
    error = {g: t["error"] for g, t in table.items()}
    judged = judge(model, found, group_squares(rows, before), group_squares(rows, after), error)
    tell(f"verdict: {judged.verdict} ({judged.reason})")
    learned = None
    if judged.verdict == "unknown":
        from ._learned import learn

        learned = learn(model, found.baseline, tell)
        model.rebase(found.baseline.point)
        after = learned.residual
    tell("looking where the gap is")
    where, everything = (
        locate(model, found.baseline.point) if judged.verdict != "none" else ([], [])
    )
    result = Diagnosis(
        verdict=judged.verdict,
        effects=_named(model, found, judged),
        where=_plain_where(where),
        gap=gaps(rows, noise, before, after),
        next_experiment=_next(model, found, judged, tell),
        baseline=_baseline(found),
        noise=table,
        scores=_scores(found),
        learned=_learned(learned),
        notes=_notes(judged, found, model),
        faults=[*(str(f) for f in case.all_faults), *wild],
        rig=model.rig_at(
            found.fit.point if judged.verdict in ("named", "ambiguous") else found.baseline.point
        ),
    )
    result.details = {"model": model, "found": found, "judged": judged, "before": before,
                      "after": after, "where": everything, "learned": learned}  # fmt: skip
    return result


def _model(rig, runs, noise, library, window) -> tuple[RigModel, Point, list[str]]:
    """The model of the runs without their outliers, calibrated, and what is to be said of these.

    First the encoders' outliers, then those that show already before the calibration, then those
    that its misfit had hidden.
    """
    model, wild = RigModel(rig, runs, noise, library, window), []
    start = Point(np.zeros(len(model.priors)))
    if any(len(without_encoder(run, rig.size)) for run in runs):
        for _ in range(2):  # at the stated machine, and at the calibrated one
            runs = with_start_angles(model.machine, model.rig_at(start))
            model = RigModel(rig, runs, noise, library, window)
            start = refit(model, start, relative=0.01).point
    for groups, calibrated in ((("theta", "Omega"), False), (("dR", "a"), False),
                               (("dR", "a"), True)):  # fmt: skip
        if calibrated:
            start = refit(model, start, relative=0.01).point
        kept, said = without_outliers(model.machine, model.rig_at(start), groups)
        if said:
            model, wild = RigModel(rig, kept, noise, library, window), wild + said
    return model, start, wild


# relative to a group's RMS; the fit's own numerics stay a tenth below it
NOISE_FREE = {"dR": 0.02, "a": 0.02, "Omega": 2e-4, "theta": 3e-6}


def _noise(case: Case) -> tuple[dict[str, float], dict[str, dict[str, Any]]]:
    """1-sigma by group, and where it is from; a group whose noise is unknown cannot be weighed."""
    floor = noise_floor(case.runs)
    table = {
        g: {"sigma": floor.group(g), "source": s, "error": floor.error[g]}
        for g, s in floor.source.items()
    }
    for group, entry in table.items():
        if entry["sigma"] == 0:  # a simulated run: weighed as good sensors would see it
            size = np.sqrt(np.nanmean([np.nanmean(r.group(group) ** 2) for r in case.runs]))
            entry |= {"sigma": float(NOISE_FREE[group] * size), "source": "noise-free"}
    unknown = [g for g, t in table.items() if not np.isfinite(t["sigma"]) or t["sigma"] <= 0]
    if unknown:
        raise InputError(
            f"the measurement noise of {', '.join(unknown)} is not known: the runs have no rest, "
            "no repeats and no quiet stretch. Declare it: [noise] in the run's TOML, 1-sigma by "
            "group."
        )
    return {g: t["sigma"] for g, t in table.items()}, table


def _named(model: RigModel, found: Found, judged: Judged) -> list[Named]:
    """The named effects with sigma from the joint refit; equals as entries of their own."""
    if judged.verdict not in ("named", "ambiguous"):
        return []
    P, out = len(model.priors), []
    sigma = np.sqrt(np.maximum(np.diag(found.fit.covariance), 0.0))
    total = max(found.held_before - found.held_after, 1e-300)
    for i, effect in enumerate(found.fit.point.effects):
        spread: dict[str, Any] = {}
        for k, free in enumerate(found.fit.free):
            if free.effect == i:
                spread.setdefault(free.key, []).append(float(sigma[P + k]))
        near = judged.equals.get(i, [])
        evidence = {
            "delta_bic": found.fit.chi2 - found.baseline.chi2
            + len(found.fit.free) * float(np.log(model.dof("train"))),
            "held_out_gain": judged.closed, "held_out_chi2": total,
            "margin_to_next": min((m for _, m, _ in found.rivals.get(i, [])), default=None),
        }  # fmt: skip
        everyone = [effect, *(e for e, _, _ in near)]
        out.append(
            Named(
                effect.id,
                effect.place,
                _parameters(model, effect, spread),
                evidence,
                _others(everyone, effect),
            )
        )
        for rival, margin, cosine in near:
            out.append(
                Named(rival.id, rival.place, _parameters(model, rival, {}),
                      {**evidence, "margin": margin, "cosine": cosine}, _others(everyone, rival))
            )  # fmt: skip
    return out


def _others(everyone: list[Effect], effect: Effect) -> list[dict[str, str]]:
    return [{"id": e.id, "place": e.place} for e in everyone if e.name != effect.name]


def _parameters(model: RigModel, effect: Effect, spread: dict[str, list[float]]) -> dict:
    law, out = model.laws[effect.id], {}
    for key, value in effect.values.items():
        own = spread.get(key)
        vector = np.ndim(value) > 0
        out[key] = {
            "value": np.asarray(value).tolist() if vector else float(value),
            "sigma": None if own is None else own if vector else own[0],
            "unit": _unit(law.parameters[key].unit, effect.place),
        }
    if effect.id == "contact-hertz":
        out |= _hertz(model, effect)
    return out


def _unit(unit: str, place: str) -> str:
    """A parameter's unit; a sensor's is that of its channel."""
    return unit.replace("unit of the channel", UNITS.get(place.split("_", maxsplit=1)[0], "1"))


def _hertz(model: RigModel, effect: Effect) -> dict:
    """The modulus E' = 0.75 c / sqrt(R') that the tangent stiffness stands for."""
    w, sphere = model.rig.wheels, model.rig.sphere
    K, N0 = np.asarray(w.contact.stiffness), np.asarray(w.closure.preload)
    reach = 1.5 * N0 / K
    curvature = np.asarray(sphere.radius * w.radius / (sphere.radius + w.radius))
    modulus = 0.75 * N0 / reach**1.5 / np.sqrt(curvature)
    names = model.rig.names
    chosen = modulus[names.index(effect.place)] if effect.place in names else modulus.mean()
    return {
        "exponent": {"value": 1.5, "sigma": None, "unit": "1"},
        "modulus": {"value": float(chosen), "sigma": None, "unit": "Pa"},
    }


def _baseline(found: Found) -> list[dict[str, Any]]:
    """Uncertain parameters before, calibrated without and with the effects, and what is known."""
    out = []
    priors = found.priors
    sigma = np.sqrt(np.maximum(np.diag(found.fit.covariance), 0.0))
    for k, prior in enumerate(priors):
        first, last = prior.at(found.baseline.point.u[k]), prior.at(found.fit.point.u[k])
        out.append({
            "parameter": prior.name, "stated": prior.value, "without_effects": first,
            "with_effects": last, "relative_sigma": float(sigma[k] * prior.sigma),
            "absorbed": float(np.log(first / last)) if first * last > 0 else 0.0,
            "determined": bool(sigma[k] < 0.7),
            "at_bound": bool(abs(found.fit.point.u[k]) > prior.hard - 1e-6),
        })  # fmt: skip
    return out


def _scores(found: Found, most: int = 12) -> list[dict[str, Any]]:
    """The score plot's numbers: the best candidates of every step."""
    out = []
    for step, scan in enumerate(found.scans):
        best = scan.best_per_name()[:most]
        for s in best:
            out.append({
                "step": step + 1, "id": s.candidate.id, "place": s.candidate.place,
                "note": s.candidate.note, "gain": s.gain, "columns": s.columns, "p": s.p,
                "cosine_to_best": scan.cosine(best[0].index, s.index),
            })  # fmt: skip
    return out


def _plain_where(where: list[dict[str, Any]]) -> list[dict[str, Any]]:
    keys = ("channel", "domain", "value", "reference", "share", "p", "rms_over_noise", "stands")
    return [{k: w[k] for k in keys} for w in where]


def _learned(learned) -> dict[str, Any] | None:
    if learned is None:
        return None
    term = learned.term
    labels = [(i, label) for i, label, _ in term.port.columns(np.zeros((1, len(term.scales))))]
    terms = [
        {"wheel": term.port.wheels[i], "input": label, "coefficient": float(c)}
        for (i, label), c in zip(labels, term.weights, strict=True)
    ]
    return {"port": learned.port, "closed": learned.closed, "uninterpreted": True,
            "closed_by_smooth_basis": learned.smooth, "closed_with_network": learned.network,
            "kind": "smooth basis" if term.network is None else "smooth basis and network",
            "terms": terms, "map": learned.map}  # fmt: skip


def _notes(judged: Judged, found: Found, model: RigModel) -> list[str]:
    notes = [judged.reason + "."]
    notes.append(
        "Wheel angles are the smoothed measured ones; Omega and the rolled lengths are predicted "
        f"from the torques in windows of {model.machine.window:g} s, each with a free start."
    )
    if model.spent:
        notes.append(
            f"The search ended at its budget of {model.budget:g} evaluations of the model: further "
            "effects and some rivals have not been tried."
        )
    if found.refused:
        notes.append(f"Held-out runs refused: {', '.join(found.refused)}.")
    dead = sorted({s.candidate.name for scan in found.scans[:1] for s in scan.scores if s.dead})
    if dead:
        notes.append(
            f"These candidates change no measured channel in these runs: {', '.join(dead)}."
        )
    return notes


def _next(model, found: Found, judged: Judged, tell) -> dict | None:
    """The experiment that tells the rivals of the first ambiguous effect apart."""
    if judged.verdict != "ambiguous":
        return None
    from ._experiment import next_experiment

    tell("simulating what would tell the rivals apart")
    point = found.fit.point
    i, near = next((i, near) for i, near in judged.equals.items() if near)
    effects = list(point.effects)
    others = [Point(point.u, (*effects[:i], e, *effects[i + 1 :])) for e, _, _ in near]
    return next_experiment(model, [point, *others])
