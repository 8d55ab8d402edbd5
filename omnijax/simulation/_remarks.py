"""What the wheels' places and speeds say against a run or a steady state, a sentence each."""

from collections.abc import Sequence
from typing import Any

import jax
import numpy as np

from ..dynamics import Sliding, driving_remarks, hold_obstacle, sliding_of, sliding_remarks
from ..rig import Rig
from ._drives import AbstractDrive, SpeedDrive
from ._signals import Signal, is_traced

Span = tuple[Any, Any]  # s, first and last moment of a run; traced where the times are


def remarks(rig: Rig, drive: AbstractDrive, span: Span | None, model: str) -> list[str]:
    """What speaks against the run of `rig` under `drive`, or against its steady state.

    `span` is None for a steady state, whose status says where nothing holds the sphere.  Empty
    while something of rig, drive and span is traced: numbers are not known then.
    """
    if is_traced((rig, drive, span)):
        return []
    with jax.ensure_compile_time_eval():  # a caller may be traced, though these are numbers
        return [*drift_remarks(rig, span, model), *speed_remarks([(rig, drive)], span)]


def speed_remarks(moved: Sequence[tuple[Rig, AbstractDrive]], span: Span | None) -> list[str]:
    """What speaks against prescribed speeds; of several designs of one rig the worst is told."""
    driven = [(rig, _reached(drive, span)) for rig, drive in moved if isinstance(drive, SpeedDrive)]
    if not driven:
        return []
    rig = driven[0][0]
    slides: list[Sliding] = [sliding_of(machine, speed) for machine, speed in driven]
    worst = max(slides, key=lambda each: each.share)
    return [*driving_remarks(rig), *sliding_remarks(rig.names, worst)]


def ends(times: Any) -> Span:
    """First and last of sample times in s, as they are where they are traced."""
    if is_traced(times):
        return times[0], times[-1]
    known = np.asarray(times)  # a part of a JAX array is traced where a caller is
    return float(known[0]), float(known[-1])


def drift_remarks(rig: Rig, span: Span | None, model: str) -> list[str]:
    """Of a run, that the sphere drifts off; three wheels or more are meant to hold it."""
    if span is None or rig.size < 3 or hold_obstacle(rig, model) is None:
        return []
    return [
        "the wheels do not hold the sphere in every direction: it drifts off, and the figures "
        "of |ΔR| say how far; `omnijax check` says more."
    ]


def _reached(drive: SpeedDrive, span: Span | None) -> np.ndarray:
    """Wheel speeds (k, n) in rad/s between whose rows the drive's all lie."""
    signal = drive.speed
    if span is None:
        return np.asarray(signal.values)[:1]
    return extremes(signal, *span)


def extremes(signal: Signal, first: float, last: float) -> np.ndarray:
    """Values (k, d) of a signal from `first` to `last` (s) at their ends and about the knots."""
    knots, values, slopes = (np.asarray(x) for x in (signal.knots, signal.values, signal.slopes))
    inside = knots[(knots > first) & (knots < last)]
    times = np.concatenate([[first], inside, [last]])
    piece = np.clip(np.searchsorted(knots, times, side="right") - 1, 0, len(knots) - 1)

    def at(time: np.ndarray, i: np.ndarray) -> np.ndarray:
        since = np.maximum(time - knots[i], 0.0)
        return values[i] + slopes[i] * since[:, None]

    return np.concatenate([at(times, piece), at(times[1:], piece[:-1])])
