"""`diagnose` of an axis or of a machine of the user's."""

import dataclasses
from collections.abc import Callable
from pathlib import Path

import numpy as np

from ..machine import Log, MachineCase
from ._answer import Diagnosis
from ._answered import answered
from ._ode import (
    HoldReading,
    OdeEvidence,
    Programs,
    balance_error,
    better_reading,
    build_model,
    first_reading,
    missed_output,
)
from ._search import Point, calibrated, check_foretold, refit
from ._settings import SETTINGS

SKIPPED_SAMPLES = SETTINGS.axis_case.skipped_samples
HOLD_STEPS = SETTINGS.axis_case.hold_steps
RELATIVE = SETTINGS.axis_case.relative


def machine_diagnosed(case: MachineCase, laws: dict, tell: Callable[[str], None]) -> Diagnosis:
    """The answer with the input read as it fits better: held between its samples, or linear."""
    reading, programs = first_reading(case), Programs()
    result = _read(reading, laws, tell, programs)
    evidence, fit = result.details["evidence"], result.details["found"].fit
    if evidence.file.compare.hold != reading.hold:
        return result
    other = better_reading(reading, laws, evidence.model, fit, tell, programs)
    return result if other is None else _read(other, laws, tell, programs)


def _read(reading: HoldReading, laws: dict, tell, programs: Programs) -> Diagnosis:
    """The floor first, then as any model; free runs beside it."""
    case = reading.case
    model, noise, remarks = build_model(case, laws, programs)
    tell("calibrating the uncertain parameters")
    start = Point(np.zeros(len(model.priors)))
    model.rebase(start)
    check_foretold(model, start, "train", case.path)
    fit = calibrated(model, start)
    check_foretold(model, fit.point, "held-out", case.path)
    remarks += [reading.said] if reading.said else []
    tell("looking for what no law explains")
    model.set_floor(fit, tell)
    if reading.open and model.explained is not None:  # what is missing would hide half a sample
        model.rebase(model.explained.point)
        known = refit(model, model.explained.point, rounds=HOLD_STEPS, relative=RELATIVE)
        other = better_reading(reading, laws, model, known, tell, programs)
        if other is not None:
            return _read(other, laws, tell, programs)
    start = fit.point
    if model.row_noise.floor > 1:
        remarks.append(model.row_noise.said())
    model.work = 0.0
    faults = [*case.faults, *case.file.assumed]
    evidence = OdeEvidence(model, case.file, noise, remarks, faults, case.blocks)
    result = answered(evidence, start, tell)
    outcome, sure = result.details["found"], result.verdict in ("named", "ambiguous")
    tell("simulating every run from its first sample")
    points = {"before": outcome.baseline.point}
    points |= {"after": outcome.fit.point} if sure else {}
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
        missed = missed_output(model, there, model.measured.of("held-out")[0])
        out[f"{word}free run"] = float(np.sqrt(np.mean(missed[SKIPPED_SAMPLES:] ** 2)))
    return out
