"""Isolated samples that fit neither their neighbours nor the model: left out, and said.

Found in what is measured less predicted, so that the motion itself is no outlier.  Calibration and
scores are quadratic: one wild sample of 100 sigma weighs as much as 1e4 good ones.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np
from scipy.ndimage import median_filter

from ...rig import Rig
from .._settings import SETTINGS
from .machine import Machine
from .runs import Run

WILD = SETTINGS.outliers.wild
MOST = SETTINGS.outliers.most
EDGE = SETTINGS.outliers.edge
BESIDE = SETTINGS.outliers.beside
USUAL = SETTINGS.outliers.usual
AT_EDGES = SETTINGS.outliers.at_edges


def spikes(values: np.ndarray, sigma: float) -> np.ndarray:
    """Mask (n, c) of one or two samples that stand out to one side of the samples around them.

    By more than `WILD` times the noise and the usual change from one sample to the next, in all the
    record and about them: where a misfit rings near half the sampling rate every sample stands out.
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
    about = median_filter(np.nan_to_num(change), (2 * BESIDE + 1, 1), mode="nearest")
    usual = np.maximum(about[np.minimum(np.arange(n), n - 2)], _median(change)) / USUAL
    return np.nan_to_num(height) > WILD * np.maximum(usual, sigma)


def _median(values: np.ndarray) -> np.ndarray:
    """Median over the first axis of what was measured; 0 where nothing was."""
    return np.nanmedian(np.where(np.isnan(values).all(axis=0), 0.0, values), axis=0)


def near_edges(machine: Machine, rig: Rig, i: int) -> np.ndarray:
    """Samples (n,) of run `i` at which some wheel's slope has just changed or is about to."""
    run, m = machine.runs[i], machine.motions(rig, [i])[i]
    fine = (len(m.theta) - 1) // (run.samples - 1)
    on_gap = np.abs(machine.tables_of(rig).rho_slope(m.theta[::fine])) > 1e-9
    changed = np.any(np.diff(on_gap, axis=0, prepend=on_gap[:1]), axis=1)
    return np.convolve(changed, np.ones(2 * EDGE + 1), "same") > 0


def outliers(machine: Machine, rig: Rig, i: int, groups: Sequence[str]) -> dict[str, np.ndarray]:
    """Masks (n, c) of the outliers of run `i` by output group, at a rig not yet calibrated."""
    elastic, rotation = machine.residual_tables(rig, i)
    tables = {"dR": elastic[:, :3], "a": elastic[:, 3:]}
    tables |= {"Omega": rotation[:, :3], "theta": rotation[:, 3:]}
    noise = machine.noise | {"theta": float(np.mean(machine.length_noise))}
    edges, masks = near_edges(machine, rig, i), {}
    for group in groups:
        if group not in machine.runs[i].outputs:
            continue
        mask = spikes(tables[group], noise[group])
        both = edges.any() and not edges.all()  # a profile without a gate has edges everywhere
        if group in ("dR", "a") and both and mask[edges].mean() > AT_EDGES * mask[~edges].mean():
            mask[edges] = False
        mask[:, mask.mean(axis=0) > MOST] = False
        if mask.any():
            masks[group] = mask
    return masks


def without_outliers(
    machine: Machine, rig: Rig, groups: Sequence[str]
) -> tuple[list[Run], list[str]]:
    """The runs with the groups' outliers marked as missing, and a sentence for each run."""
    runs, said = [], []
    for i, run in enumerate(machine.runs):
        outputs, out = dict(run.outputs), {}
        for group, mask in outliers(machine, rig, i, groups).items():
            outputs[group] = np.where(mask, np.nan, outputs[group])
            for c in np.flatnonzero(mask.any(axis=0)):
                name = f"{group}_{c + 1}" if group == "theta" else f"{group}_{'xyz'[c]}"
                out[name] = run.time[mask[:, c]]
        if out:
            said.append(_sentence(run, out))
        runs.append(dataclasses.replace(run, outputs=outputs))
    return runs, said


def _sentence(run: Run, out: dict[str, np.ndarray]) -> str:
    count = sum(map(len, out.values()))
    times = np.unique(np.concatenate(list(out.values())))
    at = ", ".join(f"{t:.3f}" for t in times[:5]) + (", ..." if len(times) > 5 else "")
    return (
        f"{run.name}: left out of {', '.join(out)}: {count} isolated "
        f"sample{'s' if count > 1 else ''} more than {WILD:g} sigma from the neighbours, a shock "
        f"or a bad reading (at {at} s)."
    )
