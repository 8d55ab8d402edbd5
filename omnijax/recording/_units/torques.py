"""Torques in a wrong unit by how the sphere turns, or what alone tells that."""

from typing import Any

import numpy as np
from scipy import special

from .._columns import channels
from .._recording import Recording
from .factors import FACTORS, Wrong, pieces
from .turning import turning

UNIT_NEAR = 5.0  # times off a thousand that torques may be, since friction is fitted beside them
DEGREES_NEAR = 2.0  # the same of angles in deg
SURE = 5.0  # sigma by which a torque's factor stands out


def torques(run: Recording, rig: Any) -> Wrong:
    """Torques that are about a thousand times off what the sphere's turning shows.

    A wheel without torque says nothing.  Where all are off as deg are, theta or Omega is, whichever
    alone tells how the sphere turns.
    """
    factors, given = _factors(run, rig), np.any(run.torque != 0, axis=0)
    if factors is None or not given.any():
        return
    sure = np.where(given, factors, 1.0)
    tell, degrees = [g for g in ("theta", "Omega") if g in run.groups], FACTORS["theta"]["deg"]
    if len(tell) == 1 and np.all(_near(sure[given], degrees, DEGREES_NEAR)):
        yield channels(tell[0], run.wheels), degrees
        return
    off = _near(sure, 1e3, UNIT_NEAR) | _near(sure, 1e-3, UNIT_NEAR)
    names = channels("torque", run.wheels)
    if off[given].all():
        yield names, 1e3 if sure[given][0] < 1 else 1e-3
        return
    for i in np.flatnonzero(off):
        yield (names[i],), 1e3 if sure[i] < 1 else 1e-3


def _near(factors: np.ndarray, unit: float, most: float) -> np.ndarray:
    """Which factors are those of a unit, but for up to `most` times."""
    return np.abs(np.log10(factors / unit)) < np.log10(most)


def _factors(run: Recording, rig: Any) -> np.ndarray | None:
    """By wheel what its torque turns over what it should, 1 where that is not sure.

    Friction and drag are left free.  None where the run does not tell the wheels apart.
    """
    stride, omega = pieces(run), turning(run, rig)
    gained = np.diff(omega[::stride], axis=0)
    resisted = _resisted(np.nan_to_num(omega), run.time, stride)
    columns = np.concatenate([_given(run, rig, stride), resisted], axis=2)
    good = np.isfinite(gained)
    columns, target = columns[good], gained[good]
    size = np.sqrt(np.sum(columns**2, axis=0)) + 1e-300
    if len(target) < 2 * len(size):
        return None
    left, strength, right = np.linalg.svd(columns / size, full_matrices=False)
    rank = int(np.sum(strength > 1e-9 * strength[0]))
    if rank < run.wheels:
        return None
    inverse = right[:rank].T / strength[:rank]
    factors = inverse @ (left[:, :rank].T @ target)
    free = len(target) - rank
    scatter = np.linalg.norm(target - columns / size @ factors) / np.sqrt(free)
    sigma = scatter * np.linalg.norm(inverse, axis=1)
    surely = special.stdtrit(free, special.ndtr(SURE))  # few rows tell their own scatter badly
    factors, sigma = ((x / size)[: run.wheels] for x in (factors, sigma))
    return np.where(factors > surely * sigma, factors, 1.0)


def _given(run: Recording, rig: Any, stride: int) -> np.ndarray:
    """Change of Omega in each piece by each wheel's torque alone, (pieces, 3, wheels)."""
    axes = np.asarray(rig.wheels.spin_axis)
    lever = np.asarray(rig.sphere.radius / rig.wheel_radius)
    inertia = np.asarray(rig.sphere.inertia_matrix)
    inertia = inertia + axes.T @ np.diag(np.asarray(rig.wheels.inertia) * lever**2) @ axes
    per_wheel = np.linalg.solve(inertia, axes.T * lever)  # rad/s^2 per N m
    impulse = np.cumsum(run.torque * np.gradient(run.time)[:, None], axis=0)[::stride]
    return np.einsum("ti,ai->tai", np.diff(impulse, axis=0), per_wheel)


def _resisted(omega: np.ndarray, time: np.ndarray, stride: int) -> np.ndarray:
    """What dry friction and drag about each axis take in each piece, (pieces, 3, 6)."""
    terms = np.stack([np.tanh(omega / 0.01), omega], axis=2) * np.gradient(time)[:, None, None]
    taken = np.diff(np.cumsum(terms, axis=0)[::stride], axis=0)
    return np.concatenate([taken[:, :, :1] * np.eye(3), taken[:, :, 1:] * np.eye(3)], axis=2)
