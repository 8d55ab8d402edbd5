"""From a machine's case to its model: criterion, noise, laws and places."""

import math
from collections.abc import Sequence

import numpy as np

from ..._errors import InputError
from ...laws import AXIS_EFFECTS
from ...machine import (
    NOISY,
    Axis,
    Log,
    MachineCase,
    acceleration_noise,
    criterion_of,
    field_units,
    least_of,
    loses_sign,
    may_be_absent,
    measured_of,
    one_inertia,
)
from .._noise import Assumed
from .._search import Prior
from .._settings import SETTINGS
from ._noise import sensor_noise
from ._rows import Balance, FreeRun, Numbers, OdeRun, Programs, smoothed
from .model import OdeModel

CUTOFFS = SETTINGS.free_build.cutoffs
MOST_ROWS = SETTINGS.free_build.most_rows
WINDOW_LEADS = SETTINGS.free_build.window_leads
PUSHED_AWAY = SETTINGS.free_build.pushed_away
LEAST_WINDOW = SETTINGS.free_build.least_window
WINDOWS = SETTINGS.free_build.windows
WHOLE_LEADS = SETTINGS.free_build.whole_leads
TURNED_SHARE = SETTINGS.free_build.turned_share
KNOWN = frozenset({"bearing-viscous", "sensor-gain"})  # an axis has its own
SUMS = frozenset({"gravity", "gravity_angle", "offset", "rate_gain", "stiffness"})
# of an axis that may have none, or one of either sign: they are known to a sum, not to a factor
INVERTED = frozenset({"encoder-eccentricity"})  # sensors' laws of which a balance finds the input


def cutoff_of(logs: Sequence[Log], noise: np.ndarray | float) -> float:
    """Hz: the widest low pass at which noise is a small part of the measured acceleration.

    One for all logs, by the one that is sampled most coarsely; half of them have to be so.  `noise`
    is the 1-sigma of what was measured, one or (logs,).
    """
    step, measured = max(log.step for log in logs), logs[0].measured
    sigmas = np.broadcast_to(noise, len(logs))
    for share in CUTOFFS:
        f = share / step
        fine = [
            acceleration_noise(sigma, measured, f, step)
            < NOISY * np.std(smoothed(log.outputs["position"], log.step, f)[2])
            for log, sigma in zip(logs, sigmas, strict=True)
        ]
        if np.mean(fine) >= 0.5:
            return f
    return CUTOFFS[-1] / step


def priors_of(machine, uncertainty) -> list[Prior]:
    """Priors of the uncertain fields: relative, or absolute where a field is or may be 0.

    A field that an axis need not have is known to no factor where its 1-sigma is more than itself.
    None is fitted below what a machine file takes.
    """
    out, units, axis = [], field_units(machine), isinstance(machine, Axis)
    for name, sigma in uncertainty.items():
        value, unit = float(getattr(machine, name)), units.get(name, "")
        loose = sigma > 1 and may_be_absent(name)
        factor = value != 0 and not (axis and (name in SUMS or loose))
        size = float(sigma) * (1.0 if factor or value == 0 else abs(value))
        low = least_of(name) if axis else -math.inf
        out.append(Prior(name, value, size, relative=factor, unit=unit, low=low))
    return out


def build_model(
    case: MachineCase, laws: dict | None = None, programs: Programs | None = None
) -> tuple[OdeModel, list[Assumed], list[str]]:
    """(model, noise of what was measured by run, remarks) of a case; `laws` are users' own by id.

    `programs` keeps what is compiled, for the same case with its input read otherwise.
    """
    file, machine = case.file, case.file.machine
    if measured_of(machine.outputs) is None:
        raise InputError(f"{file.source}: the machine has no output `position` or `velocity`.")
    measured = _measured(case.logs)
    noise = sensor_noise(case.logs)
    sigmas = np.array([x.sigma for x in noise])
    cutoff = file.compare.cutoff or cutoff_of(case.logs, sigmas)
    runs = [
        OdeRun(log.name, log.role, log.time, log.inputs, log.outputs, cutoff, file.compare.hold,
               measured)
        for log in case.logs
    ]  # fmt: skip
    one = one_inertia(machine)
    memory = machine.speed_memory() if measured == "velocity" else machine.memory()
    chosen = criterion_of(file, memory, measured == "velocity", _lose_sign(measured, runs),
                          one is not None and runs_away(one, runs))  # fmt: skip
    if chosen == "balance" and one is None:
        raise InputError(f"{file.source}: `compare.criterion` balance needs one inertia only; "
                         "choose free-run.")  # fmt: skip
    library = {**AXIS_EFFECTS, **(laws or {})}
    round_ = measured == "position" and turns_round(machine, runs)
    places = _places(machine, library, chosen, file.uncertainty, measured, round_)
    used = {i: library[i] for i, _ in places}

    def criterion(numbers: Numbers, run: OdeRun):
        if chosen == "balance":
            return Balance(numbers, run)
        return _free(numbers, run, memory, max(len(r.time) for r in runs))

    model = OdeModel(machine, priors_of(machine, file.uncertainty), runs, used, places, criterion,
                     sigmas, file.placed, programs)  # fmt: skip
    rows = model.measured.rows[0]
    how = (
        f"Compared is the balance of accelerations: {measured} low-passed at {cutoff:.4g} Hz, rows "
        f"every {1e3 * rows.thin * runs[0].step:.4g} ms."
        if chosen == "balance" else
        f"Compared is the {measured} of free runs, simulated from the inputs alone."
    )  # fmt: skip
    return model, noise, [how]


def _measured(logs: Sequence[Log]) -> str:
    """What all logs of a case measured."""
    kinds = {log.measured for log in logs}
    if len(kinds) > 1:
        raise InputError(
            "some logs give the position, others the velocity alone: a case needs one of both in "
            "all of its logs."
        )
    return kinds.pop()


def _lose_sign(measured: str, runs: Sequence[OdeRun]) -> bool:
    """Whether all runs show a speed that lost its sign."""
    return measured == "velocity" and all(
        loses_sign(r.shown, np.asarray(r.inputs["input"])) for r in runs
    )


def runs_away(axis: Axis, runs: Sequence[OdeRun]) -> bool:
    """Whether small errors of an axis grow for long: a pendulum that its motor turns over the top.

    A free run says nothing then, however right the model.  A servo's controller holds its axis.
    """
    if axis.drives == "goal" or axis.motion == "translation":
        return False
    pulls = float(axis.stiffness) + float(axis.gravity) * np.cos(
        np.concatenate([r.outputs["position"] for r in runs]) + float(axis.gravity_angle)
    )
    return bool(np.mean(pulls < 0) > PUSHED_AWAY)


def turns_round(machine, runs: Sequence[OdeRun]) -> bool:
    """Whether positions are angles whose range in the train runs shows a wave of a turn."""
    if getattr(machine, "motion", "rotation") != "rotation":
        return False
    shown = [r.shown for r in runs if r.role == "train"]
    return bool(np.ptp(np.concatenate(shown)) >= TURNED_SHARE * 2 * np.pi)


def _places(
    machine, library, criterion: str, uncertain, measured: str, turns: bool
) -> list[tuple[str, str]]:
    """(id, place) of every law that may act on the machine; encoders are those of what `turns`."""
    own, out = _own_places(machine), []
    for id, law in library.items():
        if any(p.shape for p in law.parameters.values()) or law.places == ("dR",):
            continue
        if law.port == "sensor":
            seen = id in INVERTED if criterion == "balance" else id not in KNOWN
            if seen and (turns or id not in INVERTED):
                out.append((id, measured))
            continue
        out += [(id, place) for place in own.get(law.port, ())]
    stated: set[str] = set()
    if isinstance(machine, Axis):
        stated = machine.stated_laws(uncertain)
        if machine.second_inertia is None:
            stated |= {"mount-friction"}  # of a single inertia that of the bearing
            stated |= {"shaft-spring"} if float(machine.stiffness) else set()
    return [(i, p) for i, p in out if i not in stated]


def _own_places(machine) -> dict[str, tuple[str, ...]]:
    """Ports of the machine with their places; an axis that no spring holds has no mount."""
    own, one = dict(machine.places), one_inertia(machine)
    if one is not None and float(one.stiffness) == 0:
        own.pop("mount")
    return own


def _free(numbers: Numbers, run: OdeRun, memory: float, longest: int) -> FreeRun:
    """Free runs in windows, of one length for runs of about one length."""
    n, free = len(run.time), not np.isfinite(memory)
    lead = 0 if free else min(n, math.ceil(memory / run.step))
    whole = not free and n <= WINDOW_LEADS * WHOLE_LEADS * max(lead, LEAST_WINDOW)
    filled = longest
    while filled >= 2 * n:
        filled = -(-filled // 2)
    length = filled if whole else max(WINDOW_LEADS * lead, longest // WINDOWS, LEAST_WINDOW)
    lead = 0 if whole else lead
    return FreeRun(numbers, run, lead, length, max(1, n // MOST_ROWS))
