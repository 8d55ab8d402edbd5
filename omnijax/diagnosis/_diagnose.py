"""`diagnose`: a case in, a verdict with its evidence out."""

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from ..laws import EFFECTS
from ..machine import Log, MachineCase, is_machine_case, read_machine_case
from ..recording import Case, read_case
from ._answer import (
    AbstractEvidence,
    Diagnosis,
    RigEvidence,
    Shown,
    baseline_table,
    gaps,
    judge,
    named,
    noise_remarks,
    noise_table,
    notes,
    plain_where,
    score_table,
    separating,
    shown_noise,
    white_levels,
    wrong,
)
from ._machine import (
    RigModel,
    to_run,
    with_roles,
    with_start_angles,
    without_encoder,
    without_outliers,
)
from ._noise import Assumed, assumed_noise, by_group, run_levels
from ._ode import OdeEvidence, balance_error, build_model, missed_position
from ._room import check_room
from ._search import (
    Explored,
    Point,
    Search,
    SearchPath,
    SearchResult,
    calibrated,
    refit,
    upper_limits,
)

STARTED = 20  # samples that the benchmark of EMPS gives to a start
MOSTLY = 1.25  # RMS of a channel over its white part, below which all of it is noise


def diagnose(
    case: str | Path | Case | MachineCase,
    *,
    laws: dict[str, Any] | None = None,
    window: float = 1.0,
    tell: Callable[[str], None] = lambda text: None,
) -> Diagnosis:
    """Diagnose a case: where do simulation and data disagree, and which missing effect is it?

    `case` is a folder (one rig file and its runs), a `Case` or a `MachineCase` (an axis, or a
    machine of the user's), `laws` are users' own laws by id
    (`load_laws(file)`), `window` the length in s after which Omega and the rolled lengths start
    anew, so that small torque errors cannot add up.  Seeds are fixed: equal input, equal answer.

    Figures are SI.  Raises `InputError` for a case that cannot be read, for one without a run
    to learn from, and for more samples than memory holds.

    Source: score tests and refits on whitened residuals, effects of `docs/formats.md`
    (`docs/limits.md`).
    """
    if isinstance(case, str | Path):
        case = read_machine_case(case) if is_machine_case(case) else read_case(case)
    # small matrices: threads that wait for each other take ten times the time where cores are busy
    with threadpool_limits(1, "blas"):
        if isinstance(case, MachineCase):
            return _machine_diagnosed(case, laws or {}, tell)
        return _diagnosed(case, {**EFFECTS, **(laws or {})}, window, tell)


def _diagnosed(case: Case, library, window: float, tell) -> Diagnosis:
    check_room(case, library)
    runs, confirmed_on, said = with_roles([to_run(r) for r in case.runs])
    noise = assumed_noise(case)
    levels = run_levels(noise, case.rig.size)
    runs = [dataclasses.replace(run, levels=levels) for run in runs]
    tell("calibrating the uncertain parameters")
    model, start, wild = _model(case.rig, runs, by_group(noise), library, window)
    faults = [*(str(f) for f in case.all_faults), *said, *wild]
    evidence = RigEvidence(model, noise, faults, confirmed_on)
    by_channel = mended(evidence, start, noise)
    if by_channel is not None:
        tell("the noise is not as assumed: weighing the runs anew")
        evidence = evidence.renoised(by_channel)
        start = calibrated(evidence.model, start).point
    evidence.model.work = 0.0
    return answered(evidence, start, tell)


def mended(evidence: AbstractEvidence, point: Point, noise: dict[str, Assumed]):
    """The levels by run that are wrong before any effect is known, or None.

    What rest or repeats show is an upper bound of a misfit's.  Else, where a channel holds more
    than its noise, fast parts of that count in its level: it may then only be lower than assumed.
    """
    out, any_wrong = [], False
    for run in white_levels(evidence, point):
        kept = {}
        for channel, (level, rms) in run.items():
            known = noise[channel]
            measured = known.source not in ("declared", "unknown")
            bound = 1 + 4 * known.error + 0.05 if measured else 2
            fits = measured or level.ratio < 1 or rms < MOSTLY * level.ratio
            if wrong(level) and level.ratio < bound and fits:
                kept[channel], any_wrong = level, True
        out.append(kept)
    return out if any_wrong else None


def _machine_diagnosed(case: MachineCase, laws, tell) -> Diagnosis:
    """An axis or a user's machine: the floor first, then as any model; free runs beside it."""
    model, table, remarks = build_model(case, laws)
    tell("calibrating the uncertain parameters")
    start = Point(np.zeros(len(model.priors)))
    model.rebase(start)
    fit = calibrated(model, start)
    tell("looking for what no law explains")
    model.set_floor(fit, tell)
    start = fit.point
    table[model.rows[0].group]["sigma"] = float(model.scale[0])
    if model.floor > 1:
        remarks.append(model.floor_said())
    model.work = 0.0
    evidence = OdeEvidence(model, case.file, table, remarks, case.faults, case.blocks)
    result = answered(evidence, start, tell)
    outcome, known = result.details["found"], result.verdict in ("named", "ambiguous")
    tell("simulating every run from its first sample")
    points = {"before": outcome.baseline.point}
    points |= {"after": outcome.fit.point} if known else {}
    result.free_runs = evidence.free_runs(points)
    missed = {k: evidence.one_step(p) for k, p in points.items()}
    result.one_step = {k: x for k, x in missed.items() if x is not None}
    return result


def force_error(diagnosis: Diagnosis, train: Log, test: Log) -> dict[str, float]:
    """Of an axis: RMS of the missed force over that of the motor, %, on another split of the data.

    Baseline and named effects are refitted on `train`; `test` is predicted.  `free run` is the RMS
    in m or rad of its position, simulated from the first sample, without the first 20 samples
    (nonlinearbenchmark.org's measure).
    """
    case = diagnosis.details["evidence"].file
    logs = [dataclasses.replace(train, role="train"), dataclasses.replace(test, role="held-out")]
    model, _, _ = build_model(MachineCase(Path(), case, logs, False, []))
    point = diagnosis.details["found"].fit.point
    out = {}
    for word, start in (("baseline ", point.with_effects()), ("", point)):
        there = refit(model, start).point
        out[f"{word}train"] = balance_error(model, there, "train")
        out[f"{word}cross-test"] = balance_error(model, there, "held-out")
        missed = missed_position(model, there, model.runs[model.splits["held-out"][0]])
        out[f"{word}free run"] = float(np.sqrt(np.mean(missed[STARTED:] ** 2)))
    return out


def answered(evidence: AbstractEvidence, start: Point | None, tell) -> Diagnosis:
    """Search from `start`, judge, and say what was found: of any machine."""
    search = Search(evidence.model, tell)
    explored = search.explore(start)
    tell("looking at what is left")
    shown = shown_noise(evidence, explored.way.fit.point)
    outcome, limits = None, None
    if not shown.matters:
        outcome, limits, shown = _reviewed(search, evidence, explored, shown)
    earlier = None
    other = evidence.renoised(shown.changes) if shown.matters else None
    if other is not None:
        explored = explored.without_table()  # room for the next one
        names = sorted({c for run in shown.changes for c in run})
        tell(f"the noise of {', '.join(names)} is not as assumed: searching again")
        again = Search(other.model, tell)
        anew = again.explore(explored.baseline.point, explored.way.fit.point)
        if explained(other.model, anew.way):
            tell("what looked like noise is explained in part by candidates: it is none")
            shown = shown.refuted()
        else:
            evidence, search, explored, earlier, outcome = other, again, anew, shown, None
            shown = shown_noise(evidence, explored.way.fit.point)
    if outcome is None:
        outcome, limits, shown = _reviewed(search, evidence, explored, shown)
    return _said(evidence, outcome, shown, noise_table(evidence, shown, earlier), limits, tell)


def explained(model, way: SearchPath) -> bool:
    """Whether some candidate explains what matters of what is left and was weighed as noise."""
    least = 0.5 * model.settings.material * model.dof("train")
    return bool(way.trials) and any(t.gain > least for t in way.trials[-1])


def _reviewed(search: Search, evidence: AbstractEvidence, explored: Explored, shown: Shown):
    """(what was found, the limits, the noise shown): of a search whose noise is right."""
    outcome = search.reviewed(explored)
    limits = _limits(evidence.model, outcome)
    names = {e.name for e in explored.way.fit.point.effects}
    if {e.name for e in outcome.fit.point.effects} != names:
        shown = shown_noise(evidence, outcome.fit.point)
    return outcome, limits, shown


def _said(
    evidence: AbstractEvidence, outcome: SearchResult, shown: Shown, noise, limits, tell
) -> Diagnosis:
    """The answer of a search."""
    model = evidence.model
    (before,) = model.residuals([outcome.baseline.point], "held-out")
    (after,) = model.residuals([outcome.fit.point], "held-out")
    first, last = evidence.columns(before, "held-out"), evidence.columns(after, "held-out")
    judged = judge(outcome, shown, first, last, model.settings.equal, evidence.closing)
    tell(f"verdict: {judged.verdict} ({judged.reason})")
    known = judged.verdict in ("named", "ambiguous")
    point = outcome.fit.point if known else outcome.baseline.point
    excluded = _excluded(limits, outcome, known)
    learned = None
    if judged.verdict == "unknown":
        learned = evidence.learn(outcome.baseline, tell)
        after = after if learned is None else learned.residual
        last = evidence.columns(after, "held-out")
    where, everything = [], []
    if judged.verdict != "none":
        tell("looking where the gap is")
        where, everything = evidence.locate(outcome.baseline.point)
    result = Diagnosis(
        verdict=judged.verdict,
        effects=named(evidence, outcome, judged),
        where=plain_where(where),
        gap=gaps(evidence, shown, first, last),
        next_experiment=separating(evidence, outcome, judged, tell),
        baseline=baseline_table(outcome),
        noise=noise,
        scores=score_table(outcome),
        confirmed_on=evidence.confirmed_on,
        excluded=excluded,
        learned=None if learned is None else learned.table(),
        notes=notes(evidence, outcome, judged, noise_remarks(noise)),
        faults=evidence.faults,
        rig=evidence.described(point),
    )
    result.details = {"model": model, "found": outcome, "judged": judged, "before": before,
                      "after": after, "where": everything, "learned": learned,
                      "evidence": evidence, "shown": shown}  # fmt: skip
    return result


def _limits(model, outcome: SearchResult) -> list[dict[str, Any]]:
    """Upper limits of every effect and place."""
    if outcome.signatures is None:
        return []
    return upper_limits(model, outcome.fit, outcome.signatures, set())


def _excluded(
    limits: list[dict[str, Any]], outcome: SearchResult, known: bool
) -> list[dict[str, Any]]:
    """The limits beside what was named."""
    names = {e.name for e in outcome.fit.point.effects} if known else set()
    return [x for x in limits if f"{x['id']}@{x['place']}" not in names]


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
            start = calibrated(model, start).point
    for groups, anew in ((("theta", "Omega"), False), (("dR", "a"), False),
                               (("dR", "a"), True)):  # fmt: skip
        if anew:
            start = calibrated(model, start).point
        kept, said = without_outliers(model.machine, model.rig_at(start), groups)
        if said:
            model, wild = RigModel(rig, kept, noise, library, window), wild + said
    return model, start, wild
