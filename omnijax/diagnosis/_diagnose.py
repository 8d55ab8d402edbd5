"""`diagnose`: a case in, a verdict with its evidence out."""

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from .._errors import InputError
from .._errors import tell as warn
from ..laws import AXIS_EFFECTS, EFFECTS
from ..machine import MachineCase, is_machine_case, read_machine_case
from ..recording import Case, read_case
from ._answer import AbstractEvidence, Diagnosis, RigEvidence, white_levels, wrong
from ._answered import answered
from ._machine import (
    RigModel,
    check_compared,
    said_of_compared,
    that_tell_their_motion,
    to_run,
    with_roles,
    with_start_angles,
    without_encoder,
    without_outliers,
)
from ._noise import Assumed, assumed_noise, by_group, run_levels
from ._room import check_room
from ._search import Point, calibrated, check_foretold, holds_list
from ._settings import SETTINGS

WHITE_RATIO = SETTINGS.diagnose.white_ratio
LEVEL_ERRORS = SETTINGS.diagnose.level_errors
LEVEL_SHARE = SETTINGS.diagnose.level_share
ASSUMED_FACTOR = SETTINGS.diagnose.assumed_factor
WINDOW = SETTINGS.diagnose.window


def diagnose(
    case: str | Path | Case | MachineCase,
    *,
    laws: dict[str, Any] | None = None,
    window: float = WINDOW,
    tell: Callable[[str], None] = lambda text: None,
) -> Diagnosis:
    """Diagnose a case: where do simulation and data disagree, and which missing effect is it?

    `case` is a folder (one rig file and its runs), a `Case` or a `MachineCase` (an axis, or a
    machine of the user's), `laws` are users' own laws by id
    (`load_laws(file)`), `window` the length in s after which Omega and the rolled lengths of a rig
    start anew, so that small torque errors cannot add up.  Seeds are fixed: equal input, equal
    answer.

    Figures are SI.  Raises `InputError` for a case that cannot be read, for one without a run
    to learn from, for more samples than memory holds, for laws under ids that are not theirs, and
    for the `window` of a machine that is no rig.

    Source: score tests and refits on whitened residuals, effects of `docs/formats.md`
    (`docs/limits.md`).
    """
    _check_ids(laws or {})
    if isinstance(case, str | Path):
        case = read_machine_case(case) if is_machine_case(case) else read_case(case)
    if isinstance(case, MachineCase) and window != WINDOW:
        raise InputError("`window` speaks of a rig's runs; those of another machine have none.")
    _warn_of_lists(laws or {})
    # small matrices: threads that wait for each other take ten times the time where cores are busy
    with threadpool_limits(1, "blas"):
        if isinstance(case, MachineCase):
            from ._axis_case import machine_diagnosed  # a rig's case does not wait for its filters

            return machine_diagnosed(case, laws or {}, tell)
        return _diagnosed(case, {**EFFECTS, **(laws or {})}, window, tell)


def _check_ids(laws: dict[str, Any]) -> None:
    """`InputError` for a user's law under another's id: effects are named by theirs."""
    wrong = [
        f"`laws` must map the `id` of each law to it, but {key!r} is `{law.id}`."
        for key, law in laws.items() if key != law.id
    ]  # fmt: skip
    wrong += [
        f"`laws`: the id `{key}` is one of omnijax's own; choose another."
        for key, law in laws.items() if AXIS_EFFECTS.get(key, law) is not law
    ]  # fmt: skip
    if wrong:
        raise InputError(wrong)


def _warn_of_lists(laws: dict[str, Any]) -> None:
    """Users' laws that can be no candidates are told."""
    warn(
        f"the law `{id}` is no candidate: it holds lists, and nothing says how long they are."
        for id, law in laws.items() if holds_list(law)
    )  # fmt: skip


def _diagnosed(case: Case, library, window: float, tell) -> Diagnosis:
    check_room(case, library)
    unusable = [str(f) for f in case.all_faults if f.kind == "unusable"]
    constant = {
        run.name: [f.column for f in run.faults if f.kind == "constant"] for run in case.runs
    }
    runs, silent = that_tell_their_motion([to_run(run) for run in case.runs], constant)
    runs, confirmed_on, said = with_roles(runs, [*unusable, *silent])
    noise = assumed_noise(case)
    levels = run_levels(noise, case.rig.size)
    runs = [dataclasses.replace(run, levels=levels) for run in runs]
    faults = [*(str(f) for f in case.all_faults), *silent, *said]
    for fault in faults:  # all rests on what is left, and the work may be long
        tell(f"data: {fault}")
    tell("calibrating the uncertain parameters")
    model, start, wild = _model(case, runs, by_group(noise), library, window, tell)
    faults = [*faults, *wild, *said_of_compared(model.machine)]
    evidence = RigEvidence(model, noise, faults, confirmed_on)
    by_channel = mended(evidence, start, noise)
    if by_channel is not None:
        tell("the noise is not as assumed: weighing the runs anew")
        model.rest()
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
            bound = 1 + LEVEL_ERRORS * known.error + LEVEL_SHARE if measured else ASSUMED_FACTOR
            fits = measured or level.ratio < 1 or rms < WHITE_RATIO * level.ratio
            if wrong(level) and level.ratio < bound and fits:
                kept[channel], any_wrong = level, True
        out.append(kept)
    return out if any_wrong else None


def _model(case: Case, runs, noise, library, window, tell) -> tuple[RigModel, Point, list[str]]:
    """The model of the runs without their outliers, calibrated, and what is to be said of these.

    First the encoders' outliers, then those that show already before the calibration, then those
    that its misfit had hidden.
    """
    rig, wild = case.rig, []

    def model_of(runs) -> RigModel:
        model = RigModel(rig, runs, noise, library, window)
        model.tell = tell
        return model

    model = model_of(runs)
    start = Point(np.zeros(len(model.priors)))
    check_foretold(model, start, "train", case.rig_path)
    check_compared(model.machine, model.splits)
    if any(len(without_encoder(run, rig.size)) for run in runs):
        for _ in range(2):  # at the stated machine, and at the calibrated one
            runs = with_start_angles(model.machine, model.rig_at(start))
            model = model_of(runs)
            start = calibrated(model, start).point
    for groups, anew in ((("theta", "Omega"), False), (("dR", "a"), False),
                               (("dR", "a"), True)):  # fmt: skip
        if anew:
            tell("looking for outliers beside the calibrated machine")
            start = calibrated(model, start).point
            model.rebase(start)  # a rolling start hangs on the calibrated contacts
        kept, said = without_outliers(model.machine, model.rig_at(start), groups)
        if said:
            model, wild = model_of(kept), said
    check_foretold(model, start, "held-out", case.rig_path)
    return model, start, wild
