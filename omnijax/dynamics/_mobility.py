"""Which motions of the sphere the wheels can drive, on round wheels; outside of transformations."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..rig import Rig

SINGULAR = 1e-9  # of the largest singular value of the driven axes: nothing is driven below it
WEAK = 0.05  # below it a direction is driven at a ratio that no machine is built with


class Mobility(NamedTuple):
    """Wheel speeds against Omega where every wheel has its largest radius (eqs. 43, 44).

    `to_wheels` (n, 3) gives wheel speeds from Omega, `to_sphere` (3, n) Omega from wheel speeds
    (least squares with more than three wheels, of least size with fewer).  `strength` holds the
    singular values of the driven axes over the largest, `directions` the sphere's axes that belong
    to them as rows, `conflicts` (n - rank, n) unit combinations of wheel speeds that turn nothing:
    their part of given speeds slides.
    """

    to_wheels: np.ndarray
    to_sphere: np.ndarray
    strength: np.ndarray
    directions: np.ndarray
    conflicts: np.ndarray

    @property
    def driven(self) -> int:
        """Number of the sphere's axes that the wheels turn."""
        return int(np.sum(self.strength > SINGULAR))

    @property
    def condition(self) -> float:
        """Largest over smallest strength of the driven axes."""
        return float(1 / self.strength[self.driven - 1]) if self.driven else float("inf")

    def undriven(self) -> np.ndarray:
        """Axes of the sphere that no wheel turns, as rows."""
        return self.directions[self.driven :]

    def weak(self) -> np.ndarray:
        """Axes that are driven, but hardly, as rows."""
        return self.directions[: self.driven][self.strength[: self.driven] < WEAK]


def mobility(rig: Rig) -> Mobility:
    """What the wheels of `rig` can drive."""
    axes = np.cross(np.asarray(rig.wheels.drive), np.asarray(rig.wheels.normal))
    ratio = float(rig.sphere.radius) / np.asarray(rig.wheel_radius)
    left, values, right = np.linalg.svd(axes)
    strength = np.zeros(3)
    strength[: len(values)] = values / values.max()
    rank = int(np.sum(strength > SINGULAR))
    back = np.linalg.pinv(axes, rcond=SINGULAR)
    conflicts = left[:, rank:].T * ratio  # of rim speeds over R; of wheel speeds times the ratio
    return Mobility(ratio[:, None] * axes, back / ratio, strength, right, conflicts)


def fitting_speeds(rig: Rig, omega: Sequence[float] | np.ndarray) -> list[float]:
    """Wheel speeds in rad/s, one a wheel, that turn the sphere with Omega (3,), round wheels."""
    return (mobility(rig).to_wheels @ np.asarray(omega, float)).tolist()


class Weight(NamedTuple):
    """What the weight alone presses with, one entry a contact, N; `what` rests on the others."""

    what: str  # "the sphere" on the wheels, or "the platform" on the sphere
    force: float  # N
    normal: np.ndarray  # N, of least size; negative where a wheel would have to pull
    missing: float  # N of the weight that contacts cannot bear: it stands along no normal


def weight(rig: Rig) -> Weight | None:
    """How gravity presses on the contacts; None where the rig has none.

    Wheels below carry the sphere, sum N r = -M_s g; wheels above press with platform and wheels on
    a sphere that stands on the ground, sum N r = (M_l + sum m) g.
    """
    gravity = np.asarray(rig.platform.gravity)
    size = float(np.linalg.norm(gravity))
    if size == 0:
        return None
    normal = np.asarray(rig.wheels.normal)
    above = float(np.mean(normal @ gravity)) > 0
    mass = float(rig.platform.mass) + float(np.sum(np.asarray(rig.wheels.mass))) if above else 0.0
    needed = mass * gravity if above else -float(rig.sphere.mass) * gravity
    forces, *_ = np.linalg.lstsq(normal.T, needed, rcond=None)
    left = float(np.linalg.norm(normal.T @ forces - needed))
    what = "platform and wheels on the sphere" if above else "the sphere on the wheels"
    return Weight(what, float(np.linalg.norm(needed)), forces, left)


def sliding(rig: Rig, speed: np.ndarray) -> np.ndarray:
    """Sliding speed in m/s (..., n) that wheel speeds (..., n) in rad/s force on the contacts.

    Zero where the speeds fit each other; with more than three wheels most do not.
    """
    driven = mobility(rig)
    rim = np.asarray(speed) * np.asarray(rig.wheel_radius)
    fitting = (np.asarray(speed) @ driven.to_sphere.T) @ driven.to_wheels.T
    return fitting * np.asarray(rig.wheel_radius) - rim
