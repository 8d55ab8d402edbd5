"""Derivatives against finite differences with a reasoned step.

A central difference of step h errs by about h^2 f'''/6 from the curve and e f/h from the figures'
own precision e, which balance at h = (3 e)^(1/3) relative to the parameter: 1.4e-4 for closed
forms.  Where a bound is nearer than h the difference is the one-sided one of second order.
"""

from typing import NamedTuple

import numpy as np

from ...rig import Rig, parameter_info

FLOOR = 1e-3  # of the largest relative derivative of a metric: smaller ones are compared with this


class Check(NamedTuple):
    """Finite differences (m, p) and their relative distance to the derivatives (m, p)."""

    differences: np.ndarray
    error: np.ndarray

    @property
    def worst(self) -> float:
        """Largest relative error."""
        return float(np.max(self.error))


def steps(rig: Rig, paths: tuple[str, ...], values: np.ndarray, precision: float) -> np.ndarray:
    """Step of each parameter, in its unit; a parameter at zero steps by its range or by 1."""
    spans = []
    for path, value in zip(paths, values, strict=True):
        high = parameter_info(rig, path).high
        spans.append(abs(value) if value != 0 else (high if np.isfinite(high) else 1.0))
    return (3 * precision) ** (1 / 3) * np.array(spans)


def compare(figures_of, rig: Rig, paths: tuple[str, ...], values, raw, precision: float) -> Check:
    """Differences of `figures_of` (b, p) -> (b, m) at `values` beside derivatives `raw` (m, p)."""
    h = steps(rig, paths, values, precision)
    low = np.array([parameter_info(rig, path).low for path in paths])
    high = np.array([parameter_info(rig, path).high for path in paths])
    side = np.where(values - h < low, 1.0, np.where(values + h > high, -1.0, 0.0))
    first = np.where(side == 0, 1.0, side)  # offsets in steps: +-1, or 1 and 2 to one side
    second = np.where(side == 0, -1.0, 2 * side)
    moved = [np.zeros((1, len(h))), np.diag(first * h), np.diag(second * h)]
    figures = figures_of(values + np.concatenate(moved)).T  # the base too: alone it is no program
    zero, one, two = np.split(figures, (1, 1 + len(h)), axis=1)
    central = (one - two) / (2 * h)
    sided = side * (4 * one - two - 3 * zero) / (2 * h)
    differences = np.where(side == 0, central, sided)
    scale = np.abs(h)
    largest = np.max(np.abs(raw) * scale, axis=1, keepdims=True)
    size = np.maximum(np.maximum(np.abs(raw), np.abs(differences)) * scale, FLOOR * largest)
    gap = np.abs(raw - differences) * scale
    return Check(differences, np.where(gap > 0, gap / np.where(size > 0, size, 1.0), 0.0))
