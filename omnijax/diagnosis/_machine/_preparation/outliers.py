"""Isolated samples that fit neither their neighbours nor the model: left out, and said.

Found in what is measured less predicted, so that the motion itself is no outlier.  Calibration and
scores are quadratic: one wild sample of 100 sigma weighs as much as 1e4 good ones.  What is not
known yet makes some too (the impacts of a play): a run keeps them `aside`, and those that stand out
no longer beside what was found are put back.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np
from scipy.ndimage import median_filter

from ....recording import channels
from ....rig import Rig
from ..._settings import SETTINGS
from ..machine import Machine
from ..runs import Run

WILD_SIGMAS = SETTINGS.outliers.wild_sigmas
MOST_SHARE = SETTINGS.outliers.most_share
CUT_SIGMAS = SETTINGS.outliers.cut_sigmas
EDGE_SAMPLES = SETTINGS.outliers.edge_samples
KINK_SLOPE = SETTINGS.outliers.kink_slope
NEIGHBOURS = SETTINGS.outliers.neighbours
MEDIAN_DIFFERENCE = SETTINGS.outliers.median_difference
EDGE_RATIO = SETTINGS.outliers.edge_ratio
FITS_SIGMAS = SETTINGS.outliers.fits_sigmas
FEWEST_BACK = SETTINGS.outliers.fewest_back


def spikes(values: np.ndarray, sigma: np.ndarray | float, wild: float = WILD_SIGMAS) -> np.ndarray:
    """Mask (n, c) of one or two samples that stand out to one side of the samples around them.

    They stand out by more than `wild` times the noise `sigma` (c,), or one of all, and times the
    median change from one sample to the next, both over the record and nearby.  (Where a misfit
    rings near half the sampling rate, every sample stands out, and none of them is an outlier.)
    """
    padded = np.pad(values, ((2, 2), (0, 0)), mode="edge")
    n = len(values)

    def away(before: int, after: int) -> np.ndarray:
        left, right = values - padded[2 - before :][:n], values - padded[2 + after :][:n]
        return np.where(left * right > 0, np.minimum(np.abs(left), np.abs(right)), 0.0)

    height = np.maximum(away(1, 1), np.maximum(away(1, 2), away(2, 1)))
    height[[0, -1]] = 0.0
    around = np.stack([padded[k:][:n] for k in (0, 1, 3, 4)])
    height = np.minimum(height, np.abs(values - _median(around)))
    change = np.abs(np.diff(values, axis=0))
    about = median_filter(np.nan_to_num(change), (2 * NEIGHBOURS + 1, 1), mode="nearest")
    usual = np.maximum(about[np.minimum(np.arange(n), n - 2)], _median(change)) / MEDIAN_DIFFERENCE
    return np.nan_to_num(height) > wild * np.maximum(usual, sigma)


def _median(values: np.ndarray) -> np.ndarray:
    """Median over the first axis of what was measured; 0 where nothing was."""
    return np.nanmedian(np.where(np.isnan(values).all(axis=0), 0.0, values), axis=0)


def near_edges(machine: Machine, rig: Rig, i: int) -> np.ndarray:
    """Samples (n,) of run `i` at which some wheel's slope has just changed or is about to.

    Where a gap begins or ends, and where two rollers meet in it.
    """
    run, m = machine.runs[i], machine.motions(rig, [i])[i]
    fine = (len(m.theta) - 1) // (run.samples - 1)
    slope = machine.tables_of(rig).rho_slope(m.theta[::fine])
    on_gap = np.abs(slope) > 1e-9
    steepest = np.abs(slope).max(axis=0)
    kinks = np.abs(np.diff(slope, axis=0, prepend=slope[:1])) > KINK_SLOPE * steepest
    changed = np.any(np.diff(on_gap, axis=0, prepend=on_gap[:1]) | kinks, axis=1)
    return np.convolve(changed, np.ones(2 * EDGE_SAMPLES + 1), "same") > 0


def at_limits(
    readings: Sequence[np.ndarray], left: Sequence[np.ndarray], masks: Sequence[np.ndarray],
    sigma: float,
) -> list[np.ndarray]:  # fmt: skip
    """Masks (n, c) of the outliers among `masks`, by run, that stand at their channel's limit.

    A saturated sensor cuts peaks off: several readings have the same largest size, none exceeds
    it, and the prediction (the reading less what is `left`) does.
    """
    near = WILD_SIGMAS * sigma
    over = [np.sign(x) * r < -CUT_SIGMAS * sigma for x, r in zip(readings, left, strict=True)]
    sizes = [np.abs(x) for x in readings]

    def largest(some: Sequence[np.ndarray]) -> np.ndarray:
        each = (np.where(m & np.isfinite(x), x, 0.0) for x, m in zip(sizes, some, strict=True))
        return np.max([x.max(axis=0) for x in each], axis=0)

    top = largest([m & o for m, o in zip(masks, over, strict=True)])
    same = [o & (x > top - near) for x, o in zip(sizes, over, strict=True)]
    several = sum(m.sum(axis=0) for m in same) > 1
    limits = several & (largest([~m for m in masks]) < top + near)
    return [m & s & limits for m, s in zip(masks, same, strict=True)]


def outliers(machine: Machine, rig: Rig, groups: Sequence[str]) -> list[dict[str, np.ndarray]]:
    """By run the masks (n, c) of outliers by output group, at a rig not yet calibrated."""
    masks: list[dict[str, np.ndarray]] = [{} for _ in machine.runs]
    left = []
    for i in range(len(machine.runs)):
        elastic, rotation = machine.residual_tables(rig, i)
        left.append({"dR": elastic[:, :3], "a": elastic[:, 3:],
                     "Omega": rotation[:, :3], "theta": rotation[:, 3:]})  # fmt: skip
    noise = machine.noise | {"theta": float(np.mean(machine.length_noise))}
    edges = [near_edges(machine, rig, i) for i in range(len(machine.runs))]
    for group in groups:
        have = [i for i, run in enumerate(machine.runs) if group in run.outputs]
        tables = [left[i][group] for i in have]
        each = [
            _isolated(x, noise[group], edges[i], group) for i, x in zip(have, tables, strict=True)
        ]
        if have and group != "theta":
            readings = [machine.runs[i].outputs[group] for i in have]
            cut = at_limits(readings, tables, each, noise[group])
            each = [m & ~c for m, c in zip(each, cut, strict=True)]
        for i, mask in zip(have, each, strict=True):
            if mask.any():
                masks[i][group] = mask
    return masks


def _isolated(left: np.ndarray, sigma: float, edges: np.ndarray, group: str) -> np.ndarray:
    """Mask (n, c) of the spikes in what is `left` of a group that no mistimed edge makes."""
    mask = spikes(left, sigma)
    both = edges.any() and not edges.all()  # a profile without a gate has edges everywhere
    if group in ("dR", "a") and both and mask[edges].mean() > EDGE_RATIO * mask[~edges].mean():
        mask[edges] = False
    mask[:, mask.mean(axis=0) > MOST_SHARE] = False
    return mask


def without_outliers(
    machine: Machine, rig: Rig, groups: Sequence[str]
) -> tuple[list[Run], list[str]]:
    """The runs with the groups' outliers set aside, and what is said of all that are.

    Nothing is said where there is none in these groups.
    """
    runs, any_new = [], False
    for run, masks in zip(machine.runs, outliers(machine, rig, groups), strict=True):
        outputs, aside = dict(run.outputs), dict(run.aside)
        for group, mask in masks.items():
            before = aside.get(group, np.full(mask.shape, np.nan))
            aside[group] = np.where(mask, outputs[group], before)
            outputs[group] = np.where(mask, np.nan, outputs[group])
            any_new = True
        runs.append(dataclasses.replace(run, outputs=outputs, aside=aside))
    return runs, said_of_outliers(runs) if any_new else []


def readmitted(machine: Machine, rig: Rig) -> tuple[list[Run], list[str]]:
    """The runs with those samples back that stand out no longer, and a sentence for each run.

    From their neighbours in what the rig leaves, by less than `FITS_SIGMAS` sigma.  Of dR, a and
    Omega: the angles are what the motion is told by, and no law makes a single one jump.  Fewer
    than `FEWEST_BACK` in all stay out.
    """
    fitting = [_fitting(machine, rig, i) for i in range(len(machine.runs))]
    if sum(int(mask.sum()) for masks in fitting for mask in masks.values()) < FEWEST_BACK:
        return list(machine.runs), []
    runs = []
    back: dict[str, dict[str, set[float]]] = {}
    for i, run in enumerate(machine.runs):
        outputs, aside = dict(run.outputs), dict(run.aside)
        for group, mask in fitting[i].items():
            outputs[group] = np.where(mask, aside[group], outputs[group])
            aside[group] = np.where(mask, np.nan, aside[group])
            _note(back, run, group, mask)
        runs.append(dataclasses.replace(run, outputs=outputs, aside=aside))
    said = []
    for name, out in back.items():
        count = sum(map(len, out.values()))
        which = f"{count} sample{'s' if count > 1 else ''} of {', '.join(out)}"
        stand, they = ("stand", "they count") if count > 1 else ("stands", "it counts")
        said.append(
            f"{name}: {which} that had been left out {stand} out no longer beside the best fit: "
            f"{they} again."
        )
    return runs, said


def _fitting(machine: Machine, rig: Rig, i: int) -> dict[str, np.ndarray]:
    """By group the masks (n, c) of samples of run `i` that are set aside and stand out no longer.

    Each group is judged with its own samples back, the motion without them.
    """
    run, out = machine.runs[i], {}
    for group, values in run.aside.items():
        kept = np.isfinite(values)
        if group == "theta" or not kept.any():
            continue
        whole = {**run.outputs, group: np.where(kept, values, run.outputs[group])}
        elastic, rotation = machine.residual_tables(rig, i, whole)
        left = {"dR": elastic[:, :3], "a": elastic[:, 3:], "Omega": rotation[:, :3]}[group]
        mask = kept & ~spikes(left, machine.noise[group] * run.level(group), FITS_SIGMAS)
        if mask.any():
            out[group] = mask
    return out


def said_of_outliers(runs: Sequence[Run]) -> list[str]:
    """A sentence for each run with samples that are set aside.

    A run that is split into a fitted and a held-out part gets one sentence, not two.
    """
    left_out: dict[str, dict[str, set[float]]] = {}
    for run in runs:
        for group, values in run.aside.items():
            _note(left_out, run, group, np.isfinite(values))
    return [_sentence(*run) for run in left_out.items()]


def _note(into: dict[str, dict[str, set[float]]], run: Run, group: str, mask: np.ndarray) -> None:
    """By run and channel the times of a group's samples in `mask` (n, c)."""
    for c in np.flatnonzero(mask.any(axis=0)):
        name = channels(group, mask.shape[1])[c]
        into.setdefault(run.name, {}).setdefault(name, set()).update(run.time[mask[:, c]].tolist())


def _sentence(run: str, out: dict[str, set[float]]) -> str:
    count = sum(map(len, out.values()))
    times = sorted(set().union(*out.values()))
    at = ", ".join(f"{t:.3f}" for t in times[:5]) + (", ..." if len(times) > 5 else "")
    return (
        f"{run}: left out of {', '.join(out)}: {count} isolated "
        f"sample{'s' if count > 1 else ''} more than {WILD_SIGMAS:g} sigma from the neighbours "
        f"(at {at} s): {'they are' if count > 1 else 'it is'} not used."
    )
