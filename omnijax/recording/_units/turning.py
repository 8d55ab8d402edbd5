"""What wheels and sphere turned by: each of them tells the other, in units that fit or do not."""

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import null_space

from .._columns import channels
from .._recording import Recording
from .factors import FACTORS, Wrong, pieces

CLOSE = 0.1  # relative misfit of the rolling relation that a real machine stays below
KNOWN = 0.9  # share of the samples of Omega that integrate to an angle
FEWEST = 4  # pieces that tell a unit


class _Turned(NamedTuple):
    """What n wheels and the sphere turned by about m axes in pieces, of what was measured.

    `wheels` (pieces, n) and `sphere` (pieces, m) in rad of the sphere, which a wheel rolls off by
    its component along the wheel's one of the `axes` (n, m); `free` (n, k) are the combinations of
    wheels that turns about the axes not measured do not move.
    """

    wheels: np.ndarray
    sphere: np.ndarray
    axes: np.ndarray
    free: np.ndarray

    @property
    def rolls(self) -> bool:
        """Whether either turned at all."""
        return max(_rms(self.wheels), _rms(self.sphere)) >= 1e-3

    def misfit(self, theta_scale, omega_scale) -> float:
        """The worst combination's relative misfit with the columns scaled."""
        left = (self.sphere * omega_scale) @ self.axes.T @ self.free
        right = (self.wheels * theta_scale) @ self.free
        size = _rms(left, 0) + _rms(right, 0) + 1e-4
        return float(np.max(_rms(left - right, 0) / size))


def rolling(run: Recording, rig: Any) -> Wrong:
    """theta and Omega that do not roll on each other, and the factor that makes them.

    Both sides are compared over half-second pieces; the single column or group is taken whose
    change of unit removes the misfit.
    """
    theta, omega = _measured(run, "theta"), _measured(run, "Omega", KNOWN)
    turned = _turned(run, rig, theta, omega)
    if turned is None or not turned.rolls or turned.misfit(1.0, 1.0) < 2 * CLOSE:
        return
    best = min(_hypotheses(theta, omega, run.wheels), key=lambda h: turned.misfit(h[2], h[3]))
    if turned.misfit(best[2], best[3]) < CLOSE:
        yield best[0], best[1]


def greatest_turn(run: Recording, rig: Any) -> float:
    """Angle of the wheel that turned most, rad: by its encoder, else by what the sphere rolled."""
    theta = _measured(run, "theta")
    rolled = _rolled(run) @ np.asarray(rig.wheels.spin_axis).T
    angles = run.table(theta) if theta else rolled / _ratio(rig)
    return float(np.max(np.nanmax(angles, axis=0) - np.nanmin(angles, axis=0)))


def turning(run: Recording, rig: Any) -> np.ndarray:
    """Omega, rad/s, (samples, 3): as measured, an axis that was not as the wheels roll.

    NaN where neither tells.
    """
    omega, theta = run.group("Omega"), _measured(run, "theta")
    wheels, lost = _at(theta, "theta", run.wheels), ~np.isfinite(omega).any(axis=0)
    axes = np.asarray(rig.wheels.spin_axis)[wheels]
    if not lost.any() or np.linalg.matrix_rank(axes) < 3:
        return omega
    rolled = (_speeds(run, theta) * _ratio(rig)[wheels]) @ np.linalg.pinv(axes).T
    return np.where(lost, rolled, omega)


def _speeds(run: Recording, theta: list[str]) -> np.ndarray:
    """Wheels' speeds, rad/s, (samples, wheels): over a tenth of a piece, as noise is less there."""
    near = max(pieces(run) // 20, 1)
    at = np.arange(len(run))
    before, after = np.maximum(at - near, 0), np.minimum(at + near, len(run) - 1)
    angles = run.table(theta)
    return (angles[after] - angles[before]) / (run.time[after] - run.time[before])[:, None]


def _measured(run: Recording, group: str, least: float = 0.0) -> list[str]:
    """Columns with more than a share `least` of usable values."""
    shares = run.mask(group).mean(axis=0)
    return [c for c, x in zip(channels(group, run.wheels), shares, strict=True) if x > least]


def _at(names: list[str], group: str, wheels: int) -> np.ndarray:
    """Which columns of a group `names` are."""
    return np.isin(channels(group, wheels), names)


def _ratio(rig: Any) -> np.ndarray:
    """Rad that the sphere turns per rad of each wheel, (wheels,)."""
    return np.asarray(rig.wheel_radius / rig.sphere.radius)


def _rolled(run: Recording) -> np.ndarray:
    """Angle that the sphere turned about each axis, rad, (samples, 3); NaN samples add nothing."""
    omega = np.nan_to_num(run.group("Omega"))
    steps = 0.5 * (omega[1:] + omega[:-1]) * np.diff(run.time)[:, None]
    return np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])


def _turned(run: Recording, rig: Any, theta: list[str], omega: list[str]) -> _Turned | None:
    """Wheels and sphere in the pieces where all angles are known; None where too few are."""
    if not theta or not omega:
        return None
    wheels, about = _at(theta, "theta", run.wheels), _at(omega, "Omega", run.wheels)
    axes, stride = np.asarray(rig.wheels.spin_axis)[wheels], pieces(run)
    free = null_space(axes[:, ~about].T) if not about.all() else np.eye(len(axes))
    turned = np.diff(run.table(theta)[::stride], axis=0) * _ratio(rig)[wheels]
    good = np.isfinite(turned).all(axis=1)
    if good.sum() < FEWEST or free.shape[1] == 0:
        return None
    rolled = np.diff(_rolled(run)[::stride], axis=0)
    return _Turned(turned[good], rolled[good][:, about], axes[:, about], free)


def _rms(values: np.ndarray, axis: int | None = None):
    return np.sqrt(np.mean(values**2, axis=axis))


Hypothesis = tuple[tuple[str, ...], float, np.ndarray, np.ndarray]


def _hypotheses(theta: list[str], omega: list[str], wheels: int) -> Iterator[Hypothesis]:
    """(columns, factor, scale of theta, scale of Omega) of every change of one column or group."""
    for group, names in (("theta", theta), ("Omega", omega)):
        one_by_one = [((name,), np.array([name == n for n in names])) for name in names]
        masks = [(channels(group, wheels), np.ones(len(names), bool)), *one_by_one]
        for factor in FACTORS[group].values():
            for columns, mask in masks:
                scale = np.where(mask, 1 / factor, 1.0)
                if group == "theta":
                    yield columns, factor, scale, np.ones(len(omega))
                else:
                    yield columns, factor, np.ones(len(theta)), scale
