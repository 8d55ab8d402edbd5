"""What a diagnosis can take: runs that are long enough, and no more samples than memory holds."""

import math
from typing import Any

import numpy as np

from .._errors import InputError, tell
from .._memory import SHARE, available, in_words
from ..recording import Case, channels
from ..vibration import natural_frequencies
from ._machine import FLOOR_LINES, Context, candidates
from ._settings import SETTINGS

PERIOD_SAMPLES = SETTINGS.room.period_samples
FEWEST_SAMPLES = SETTINGS.room.fewest_samples
TABLES = 7  # arrays with a row a candidate that a search holds at once: measured, at most
DEFLECTION = SETTINGS.room.deflection


def check_room(case: Case, laws: dict[str, Any]) -> None:
    """`InputError` where a run is too short or all are too long; a warning from half the memory."""
    short = [
        f"{run.path.name} has {len(run.time)}"
        for run in case.runs
        if len(run.time) < FEWEST_SAMPLES
    ]
    if short:
        raise InputError(f"{case.path}: a run needs {FEWEST_SAMPLES} samples: {', '.join(short)}.")
    need, free = memory_of(case, laws), available()
    if need <= SHARE * free:
        return
    samples = sum(len(run.time) for run in case.runs)
    said = (
        f"{case.path}: a diagnosis of {samples} samples needs about {in_words(need)} of memory, "
        f"and {in_words(free)} are free: {_less(case, math.ceil(need / (SHARE * free)))}."
    )
    if need > free:
        raise InputError(said)
    tell([said])


def _less(case: Case, few: int) -> str:
    """How to ask for one sample in `few`: by the rate where the machine's modes allow it."""
    longest = max(run.duration for run in case.runs) / few
    step = max(run.step for run in case.runs)
    short = f"`--first {longest:.3g}s` uses so much of every run"
    slowest = float(np.min(natural_frequencies(case.rig)))
    if few * step * slowest * PERIOD_SAMPLES > 1:
        return f"{short} (one sample in {few} is too few for the sphere's mode at {slowest:.3g} Hz)"
    return f"`--thin {few}` keeps one sample in {few}, {short}"


def memory_of(case: Case, laws: dict[str, Any]) -> float:
    """Bytes that the search's tables take: one row a candidate, one column a measured value."""
    groups = {group for run in case.runs for group in run.groups}
    lines = tuple(float(k) for k in range(1, FLOOR_LINES + 1))
    longest = max(len(run.time) for run in case.runs)
    typical = np.full(case.rig.size, DEFLECTION)
    considered = candidates(Context(case.rig, tuple(groups), typical, lines, longest), laws)
    rows = sum(len(c.columns) for c in considered)
    values = [
        len(run.time) * sum(len(channels(g, case.rig.size)) for g in run.groups)
        for run in case.train or case.runs
    ]
    return 8.0 * TABLES * rows * sum(values)
