"""Rotation along the measured motion: drive forces, dOmega/dt, and their response to torques."""

import dataclasses
import functools

import numpy as np

from ...laws import BodySignal, RollingSignal, ShaftSignal
from ...rig import Rig
from .laws import along, packed
from .motion import Motion, rolling_radius


@dataclasses.dataclass(frozen=True)
class Turning:
    """Linear response of one run's rotation to shaft and opposing torques (spec section 4)."""

    torque_gain: np.ndarray  # (t, n) r_w / I_w
    force: np.ndarray  # (t, n, n) inverse of the drive forces' matrix
    body: np.ndarray  # (t or 1, n, 3) R A I^-1
    inverse_inertia: np.ndarray  # (t or 1, 3, 3)
    axes: np.ndarray  # (t or 1, n, 3)
    radius: float

    def thin(self, step: int) -> "Turning":
        """The same at every `step`-th time."""

        def less(x):
            return x if len(x) == 1 else x[::step]

        return Turning(
            less(self.torque_gain), less(self.force), less(self.body), less(self.inverse_inertia),
            less(self.axes), self.radius,
        )  # fmt: skip

    @functools.cached_property
    def rates(self) -> tuple[np.ndarray, np.ndarray]:
        """dOmega/dt of a torque on each shaft (t, 3, n), and of an opposing torque (t, 3, 3)."""
        axes = np.swapaxes(self.axes, 1, 2)
        drive = self.radius * self.inverse_inertia @ axes @ self.force
        return drive * self.torque_gain[:, None, :], drive @ self.body - self.inverse_inertia

    @functools.cached_property
    def _each(self) -> tuple[list[np.ndarray], list[np.ndarray]]:
        """Drive forces and dOmega/dt (t, n + 3) of a torque on each shaft, and opposing each axis.

        The part that does not pass through the drive forces is in them too.
        """
        force = self.force * self.torque_gain[:, None, :], self.force @ self.body
        both = (np.concatenate(x, axis=1) for x in zip(force, self.rates, strict=True))
        shaft, opposing = (list(np.ascontiguousarray(np.moveaxis(x, 2, 0))) for x in both)
        return shaft, opposing

    def respond(self, shaft: np.ndarray | None, opposing: np.ndarray | None):
        """(drive forces (t, n), dOmega/dt (t, 3)) caused by torques (t, n) and (t, 3)."""
        out = np.zeros((len(self.force), self.force.shape[1] + 3))
        for torques, responses in zip((shaft, opposing), self._each, strict=True):
            if torques is None:
                continue
            for k, response in enumerate(responses):
                if torques[:, k].any():
                    out += response * torques[:, k : k + 1]
        n = self.force.shape[1]
        return out[:, :n], out[:, n:]


def isotropic(inertia: np.ndarray) -> bool:
    """Whether an inertia is a multiple of the unit matrix, so that attitude does not matter."""
    return bool(np.all(inertia == inertia[0, 0] * np.eye(3)))


def turning(rig: Rig, motion: Motion) -> Turning:
    """The response matrices along one run's motion."""
    R, wheels = float(rig.sphere.radius), rig.wheels
    inertia = np.asarray(rig.sphere.inertia_matrix)
    inverse = np.linalg.inv(inertia)[None]
    if not isotropic(inertia):
        Q = motion.attitude
        inverse = Q @ inverse @ np.swapaxes(Q, 1, 2)
    radius = rolling_radius(rig, motion)
    body = R * motion.axes @ inverse
    wheel_inertia = np.asarray(wheels.inertia)
    matrix = R * body @ np.swapaxes(motion.axes, 1, 2)
    matrix = matrix + (radius**2 / wheel_inertia)[:, :, None] * np.eye(rig.size)
    return Turning(radius / wheel_inertia, np.linalg.inv(matrix), body, inverse, motion.axes, R)


def shaft_signals(motion: Motion, torque: np.ndarray) -> ShaftSignal:
    """Signals of the shafts, (t, n) each."""
    return packed(ShaftSignal, motion.theta, motion.speed, torque)


def rolling_signals(rig: Rig, motion: Motion, normal_force: np.ndarray) -> RollingSignal:
    """Signals of the contact patches, (t, n) each."""
    roll = np.einsum("tij,tj->ti", motion.axes, motion.turning)
    spin = -motion.turning @ np.asarray(rig.wheels.normal).T
    friction = np.broadcast_to(np.asarray(rig.wheels.contact.friction), roll.shape)
    return packed(RollingSignal, roll, spin, np.maximum(normal_force, 0.0), friction)


def body_signals(rig: Rig, motion: Motion) -> BodySignal:
    """Signals of the sphere, one entry a time."""
    t = len(motion.turning)
    mass = np.broadcast_to(np.asarray(rig.sphere.mass), (t,))
    gravity = np.broadcast_to(np.asarray(rig.platform.gravity), (t, 3))
    return packed(BodySignal, motion.turning, motion.attitude, mass, gravity)


def wheel_law(law, wheels: tuple[int, ...], signals, shape) -> list[np.ndarray]:
    """A per-wheel law on the wheels it is placed at: one array (t, n) an output of the law."""
    import jax

    outputs = None
    for i in wheels:
        value = along(law, jax.tree.map(lambda x, i=i: np.ascontiguousarray(x[:, i]), signals))
        leaves = jax.tree.leaves(value)
        if outputs is None:
            outputs = [np.zeros(shape) for _ in leaves]
        for out, leaf in zip(outputs, leaves, strict=True):
            out[:, i] += leaf
    return outputs or []


def resistance(rig: Rig, motion: Motion, roll, spin) -> np.ndarray:
    """Torque (t, 3) that opposes the sphere, from rolling and spin torques (t, n)."""
    return np.einsum("tij,ti->tj", motion.axes, roll) - spin @ np.asarray(rig.wheels.normal)


def base_torques(rig: Rig, motion: Motion, torque, normal_force):
    """Shaft torques (t, n) and opposing torque (t, 3) of the rig with all its laws."""
    shaft = torque.copy()
    for placed in rig.at("shaft"):
        signals = shaft_signals(motion, torque)
        shaft += wheel_law(placed.law, placed.wheels, signals, shaft.shape)[0]
    opposing = np.zeros((len(torque), 3))
    inertia = np.asarray(rig.sphere.inertia_matrix)
    if not isotropic(inertia):
        Q, turning = motion.attitude, motion.turning
        spin = np.einsum("tji,tj->ti", Q, turning)
        opposing += np.cross(turning, np.einsum("tij,tj->ti", Q, spin @ inertia.T))
    for placed in rig.at("rolling"):
        signals = rolling_signals(rig, motion, normal_force)
        roll, spin_torque, on_shaft = wheel_law(placed.law, placed.wheels, signals, shaft.shape)
        opposing += resistance(rig, motion, roll, spin_torque)
        shaft -= on_shaft
    weight = np.asarray(rig.sphere.mass * rig.platform.gravity)
    offset = np.asarray(rig.sphere.centre_of_mass)
    if offset.any():
        opposing -= np.cross(motion.attitude @ offset, weight)
    for placed in rig.at("sphere"):
        opposing -= along(placed.law, body_signals(rig, motion))
    return shaft, opposing
