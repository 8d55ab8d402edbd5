"""From a machine's case to its model: criterion, noise, laws and places."""

import math
from collections.abc import Sequence

import numpy as np

from ..._errors import InputError
from ...laws import AXIS_EFFECTS
from ...machine import AbstractMachine, Axis, Log, MachineCase, field_units
from .._search import Prior
from .model import OdeModel
from .numbers import Numbers
from .rows import Balance, FreeRun, OdeRun, smoothed

ORDERS = (3, 5, 7)  # differences that leave of a position its noise
CUTOFFS = (0.1, 0.07, 0.05, 0.035, 0.025, 0.015)  # Hz a sample a second, tried from the widest
NOISY = 0.1  # share of a measured acceleration that may be noise
ROWS = 6000  # of a run's free run that are compared; more say nothing new
LEADS = 4  # a window is at least so many times its lead
AWAY = 0.05  # of the time that an axis is pushed away from rest, above which free runs say nothing
KNOWN = frozenset({"bearing-viscous", "sensor-gain"})  # an axis has its own
ABSENT = frozenset({"gravity", "stiffness"})  # what an axis may not have at all: not as a factor
INVERTED = frozenset({"encoder-eccentricity"})  # sensors' laws of which a balance finds the input


def position_noise(logs: Sequence[Log]) -> tuple[float, str]:
    """1-sigma of the measured position, and where it is from."""
    declared = [log.noise["position"] for log in logs if "position" in log.noise]
    if declared:
        return float(np.sqrt(np.mean(np.array(declared) ** 2))), "declared"
    sigmas = []
    for order in ORDERS:
        squares = [np.mean(np.diff(log.outputs["position"], order) ** 2) for log in logs]
        sigmas.append(np.sqrt(np.mean(np.array(squares, float)) / math.comb(2 * order, order)))
    return float(min(sigmas)), "differences"


def cutoff_of(logs: Sequence[Log], noise: float) -> float:
    """Hz: the widest low pass at which noise is a small part of the measured acceleration."""
    step = logs[0].step
    for share in CUTOFFS:
        f = share / step
        a = np.concatenate([smoothed(log.outputs["position"], step, f)[2] for log in logs])
        shaken = noise * (2 * np.pi * f) ** 2 * np.sqrt(2 * share / 5)
        if shaken < NOISY * np.std(a):
            return f
    return CUTOFFS[-1] / step


def priors_of(machine, uncertainty) -> list[Prior]:
    """Priors of the uncertain fields: relative, or absolute where a field is or may be 0."""
    out, units = [], field_units(machine)
    for name, sigma in uncertainty.items():
        value, unit = float(getattr(machine, name)), units.get(name, "")
        factor = value != 0 and not (isinstance(machine, Axis) and name in ABSENT)
        size = float(sigma) * (1.0 if factor or value == 0 else abs(value))
        out.append(Prior(name, value, size, relative=factor, unit=unit))
    return out


def build_model(case: MachineCase, laws: dict | None = None) -> tuple[OdeModel, dict, list[str]]:
    """(model, noise table, remarks) of a case; `laws` are users' own by id."""
    file, machine = case.file, case.file.machine
    if "position" not in machine.outputs:
        raise InputError(f"{file.source}: the machine has no output `position`.")
    noise, source = position_noise(case.logs)
    if noise <= 0:
        noise = 1e-6 * float(np.std(case.logs[0].outputs["position"]))
        source = "noise-free"
    cutoff = file.compare.cutoff or cutoff_of(case.logs, noise)
    runs = [
        OdeRun(log.name, log.role, log.time, log.inputs, log.outputs, cutoff, file.compare.hold)
        for log in case.logs
    ]
    one = _one_inertia(machine)
    memory = machine.memory()
    chosen = file.compare.criterion
    if chosen == "auto":
        free = not np.isfinite(memory) or (one is not None and runs_away(one, runs))
        chosen = "balance" if one is not None and free else "free-run"
    if chosen == "balance" and one is None:
        raise InputError(f"{file.source}: `compare.criterion` balance needs one inertia only; "
                         "choose free-run.")  # fmt: skip
    library = {**AXIS_EFFECTS, **(laws or {})}
    places = _places(machine, library, chosen, file.uncertainty)
    used = {i: library[i] for i, _ in places}

    def criterion(numbers: Numbers, run: OdeRun):
        if chosen == "balance":
            return Balance(numbers, run)
        return _free(numbers, run, memory, max(len(r.time) for r in runs))

    model = OdeModel(machine, priors_of(machine, file.uncertainty), runs, used, places, criterion,
                     noise, file.placed)  # fmt: skip
    table = {model.rows[0].group: {"sigma": float(model.scale[0]), "source": source, "error": 0.05}}
    how = (
        f"Compared is the balance of accelerations: position low-passed at {cutoff:.4g} Hz, rows "
        f"every {1e3 * model.rows[0].thin * runs[0].step:.4g} ms."
        if chosen == "balance" else
        "Compared is the position of free runs, simulated from the inputs alone."
    )  # fmt: skip
    return model, table, [how, *file.assumed]


def _one_inertia(machine: AbstractMachine) -> Axis | None:
    """The machine where it is an axis of one inertia."""
    return machine if isinstance(machine, Axis) and machine.second_inertia is None else None


def runs_away(axis: Axis, runs: Sequence[OdeRun]) -> bool:
    """Whether small errors of an axis grow for long: a pendulum that its motor turns over the top.

    A free run says nothing then, however right the model.  A servo's controller holds its axis.
    """
    if axis.drives == "goal" or axis.motion == "translation":
        return False
    pulls = float(axis.stiffness) + float(axis.gravity) * np.cos(
        np.concatenate([r.outputs["position"] for r in runs]) + float(axis.gravity_angle)
    )
    return bool(np.mean(pulls < 0) > AWAY)


def _places(machine, library, criterion: str, uncertain) -> list[tuple[str, str]]:
    """(id, place) of every law that may act on the machine."""
    own, out = _own_places(machine), []
    for id, law in library.items():
        if any(p.shape for p in law.parameters.values()) or law.places == ("dR",):
            continue
        if law.port == "sensor":
            seen = id in INVERTED if criterion == "balance" else id not in KNOWN
            turns = getattr(machine, "motion", "rotation") == "rotation"
            if seen and (turns or id not in INVERTED):
                out.append((id, "position"))
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
    own, one = dict(machine.places), _one_inertia(machine)
    if one is not None and float(one.stiffness) == 0:
        own.pop("mount")
    return own


def _free(numbers: Numbers, run: OdeRun, memory: float, longest: int) -> FreeRun:
    """Free runs in windows, of one length for runs of about one length."""
    n, free = len(run.time), not np.isfinite(memory)
    lead = 0 if free else min(n, math.ceil(memory / run.step))
    whole = not free and n <= LEADS * 4 * max(lead, 64)
    filled = longest
    while filled >= 2 * n:
        filled = -(-filled // 2)
    length = filled if whole else max(LEADS * lead, longest // 16, 64)
    lead = 0 if whole else lead
    return FreeRun(numbers, run, lead, length, max(1, n // ROWS))
