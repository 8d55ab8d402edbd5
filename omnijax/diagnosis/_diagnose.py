"""`diagnose`: a case in, a verdict with its evidence out."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from .._errors import InputError
from ..laws import EFFECTS
from ..recording import Case, noise_floor, read_case
from ._answer import (
    AbstractEvidence,
    Diagnosis,
    RigEvidence,
    baseline_table,
    judge,
    learned_table,
    named,
    notes,
    plain_where,
    score_table,
    separating,
)
from ._machine import RigModel, to_run, with_start_angles, without_encoder, without_outliers
from ._search import Point, Search, refit


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
    faults = [*(str(f) for f in case.all_faults), *wild]
    return answered(RigEvidence(model, table, faults), start, tell)


def answered(evidence: AbstractEvidence, start: Point | None, tell) -> Diagnosis:
    """Search from `start`, judge, and say what was found: of any machine."""
    model = evidence.model
    found = Search(model, tell).run(start)
    (before,) = model.residuals([found.baseline.point], "held-out")
    (after,) = model.residuals([found.fit.point], "held-out")
    error = {g: t["error"] for g, t in evidence.noise.items()}
    squares = evidence.squares(before), evidence.squares(after)
    judged = judge(model, found, *squares, error)
    tell(f"verdict: {judged.verdict} ({judged.reason})")
    learned = None
    if judged.verdict == "unknown":
        learned = evidence.learn(found.baseline, tell)
        after = after if learned is None else learned.residual
    tell("looking where the gap is")
    none = judged.verdict == "none"
    where, everything = ([], []) if none else evidence.locate(found.baseline.point)
    known = judged.verdict in ("named", "ambiguous")
    result = Diagnosis(
        verdict=judged.verdict,
        effects=named(evidence, found, judged),
        where=plain_where(where),
        gap=evidence.gaps(before, after),
        next_experiment=separating(evidence, found, judged, tell),
        baseline=baseline_table(found),
        noise=evidence.noise,
        scores=score_table(found),
        learned=learned_table(learned),
        notes=notes(evidence, found, judged),
        faults=evidence.faults,
        rig=evidence.described(found.fit.point if known else found.baseline.point),
    )
    result.details = {"model": model, "found": found, "judged": judged, "before": before,
                      "after": after, "where": everything, "learned": learned,
                      "evidence": evidence}  # fmt: skip
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
