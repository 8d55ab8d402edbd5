"""Torque-driven sweeps by fixed exponential steps: where they serve, and how fine they must be."""

import dataclasses
import itertools

import numpy as np

from ...laws import DualRow
from ...rig import Rig
from ...simulation import TorqueDrive
from .._drive import Drive, is_constant
from .._points import LatinHypercube, PointSet
from .evaluator import Evaluator
from .spec import SweepSpec

TOLERANCE = 1e-4  # of the figures when the step is halved
FINEST = 16  # substeps
CORNERS, INSIDE = 8, 8  # designs that the step is tried on


def no_fixed_steps(rig: Rig, drive: Drive, chosen: bool, gradient: bool) -> str | None:
    """Why a design is integrated adaptively, in words; None where fixed steps serve."""
    constant = isinstance(drive, TorqueDrive) and is_constant(drive.torque)
    if not (constant and is_constant(drive.force)):
        return "fixed steps take constant motor torques and forces"
    if chosen:
        return "a solver or its tolerance is given"
    if gradient:
        return "gradients are asked for"
    if any(rig.at(port) for port in ("contact", "mount", "separation", "platform")):
        return "laws act at contacts, mounts or platform"
    dual = any(isinstance(profile, DualRow) for profile in rig.profiles)
    return "contacts jump between two rows" if dual else None


def _trial(points: PointSet) -> np.ndarray:
    """Corners of the ranges and designs inside, (t, d)."""
    ends = [sorted({axis.low, axis.high}) for axis in points.axes]
    every = list(itertools.product(*ends))
    corners = [every[i] for i in np.unique(np.linspace(0, len(every) - 1, CORNERS).astype(int))]
    inside = LatinHypercube(tuple(points.axes), INSIDE, 0).at(np.arange(INSIDE))
    return np.concatenate([np.array(corners), inside])


def with_substeps(spec: SweepSpec, devices: int) -> tuple[SweepSpec, str] | None:
    """The spec with the least power of two of substeps that will do, and why those.

    They do where no figure of the trial designs changes by more than `TOLERANCE` when the step is
    halved; None where `FINEST` substeps are too coarse.
    """
    rows = _trial(spec.points)[: spec.batch]
    tried = dataclasses.replace(spec, substeps=1)
    coarse = Evaluator(tried, devices).figures(rows)
    for substeps in 2 ** np.arange(FINEST.bit_length()):
        finer = dataclasses.replace(spec, substeps=2 * int(substeps))
        fine = Evaluator(finer, devices).figures(rows)
        change = _change(coarse, fine)
        if change <= TOLERANCE:
            assert tried.rate is not None
            step = 2e3 / tried.rate / substeps
            return tried, (
                f"motor torques drive the wheels; halving the step of {step:.3g} ms changes the "
                f"figures of {len(rows)} trial designs by {change:.0e} at most"
            )
        coarse, tried = fine, finer
    return None


def _change(coarse: np.ndarray, fine: np.ndarray) -> float:
    """Largest relative change; figures near zero count by 1 % of the largest one."""
    if not np.isfinite(fine).all() or not np.isfinite(coarse).all():
        return float("inf")
    size = np.abs(fine) + 0.01 * np.abs(fine).max(axis=0)
    return float((np.abs(fine - coarse) / np.where(size > 0, size, 1.0)).max())
