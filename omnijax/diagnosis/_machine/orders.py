"""Orders of a wheel's angle that stand out in what is left of the rotation: a fine scan.

A line of order N in the torque on shaft k turns the sphere by the integral of its response times
exp(i N theta_k).  Its inner product with the residual is a sum over the torque's times of the
residual integrated backwards: one pass for all orders.
"""

from collections.abc import Sequence

import numpy as np

from .linearisation import THIN, Base
from .runs import FINE

GRID = 4  # orders tried within one resolution of the travel
PEAKS = 3
MOST = 4000  # orders of a wheel
LOWEST = 1.0  # windows take off what is slower


def strongest_orders(
    bases: Sequence[Base], rests: Sequence[np.ndarray], weights: Sequence[np.ndarray]
) -> dict[str, list[tuple[list[float], int]]]:
    """By law and wheel the orders of the strongest lines, and how many were to choose from.

    `rests` are the whitened rotation rows (samples, 3 + n) left in each base's run, with `weights`.
    """
    pulls = [backwards(b, r, w) for b, r, w in zip(bases, rests, weights, strict=True)]
    out: dict[str, list[tuple[list[float], int]]] = {"motor-ripple": [], "current-ripple": []}
    for k in range(bases[0].rig.size):
        theta = np.concatenate([b.motion.theta[::FINE, k] for b in bases])
        torque = np.concatenate([b.torque[::FINE, k] for b in bases])
        pull = np.concatenate([p[:, k] for p in pulls])
        grid, trials = _grid(bases, k)
        for law, forcing in (("motor-ripple", pull), ("current-ripple", pull * torque)):
            power = np.array([abs(np.exp(1j * n * theta) @ forcing) ** 2 for n in grid])
            out[law].append((_peaks(grid, power * grid**2), trials))
    return out


def backwards(base: Base, rest: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """(samples, n): inner product of the residual with a pulse of torque on each shaft."""
    h, parts = base.run.step, FINE // THIN
    left = rest * weight
    axes = base.response.axes
    axes = axes if len(axes) == 1 else axes[::parts]
    later = h * _from_the_end(left[:, 3:])
    turned = h * _from_the_end(left[:, :3] + np.einsum("tij,ti->tj", axes, later))
    return np.einsum("tkj,tj->tk", base.response.rates[::parts, : base.rig.size], turned)


def _from_the_end(x: np.ndarray) -> np.ndarray:
    return np.cumsum(x[::-1], axis=0)[::-1]


def _grid(bases: Sequence[Base], k: int) -> tuple[np.ndarray, int]:
    """Orders of wheel `k`: from `LOWEST` to half a sample at the typical speed."""
    travel = max(float(np.ptp(b.motion.theta[:, k])) for b in bases)
    speed = np.median(np.abs(np.concatenate([b.motion.speed[:, k] for b in bases])))
    resolution = 2 * np.pi / max(travel, 2 * np.pi)
    top = np.pi / bases[0].run.step / max(float(speed), 1e-6)
    top = min(top, LOWEST + MOST * resolution / GRID)
    grid = np.arange(LOWEST, max(top, LOWEST + 2 * resolution), resolution / GRID)
    return grid, max(1, round(len(grid) / GRID))


def _peaks(grid: np.ndarray, power: np.ndarray) -> list[float]:
    inner = (power[1:-1] > power[:-2]) & (power[1:-1] >= power[2:])
    best = sorted(np.flatnonzero(inner) + 1, key=lambda j: -power[j])
    kept: list[int] = []
    for j in best:  # side lobes of a line are no lines
        if all(abs(j - other) > 2 * GRID for other in kept):
            kept.append(j)
        if len(kept) == PEAKS:
            break
    return [float(grid[j]) for j in kept]
