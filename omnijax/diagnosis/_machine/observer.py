"""Omega where dry friction hangs on it: the model's own Omega, held gently to the measured one.

Near a reversal tanh(Omega/epsilon) changes within 1e-4 rad/s, less than smoothed angles resolve, so
the laws are evaluated along dOmega/dt = model + pull (measured - Omega).  Where the model is right
the pull does nothing; where it is not, Omega stays near the measured one.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from scipy.interpolate import CubicSpline

from ...laws import BodySignal, RollingSignal, ShaftSignal
from ...rig import Rig
from .laws import packed
from .motion import Motion, rolling_radius
from .rotation import Turning
from .runs import FINE, padded

TURNING = ("shaft", "rolling", "sphere")  # ports whose laws act on the rotation
PULL = 5.0  # 1/s


def needs_observer(rig: Rig) -> bool:
    """Whether a law with a friction width acts on the rotation."""
    placed = (*rig.at("rolling"), *rig.at("shaft"))
    return any("width" in p.law.parameters for p in placed)


class Path(NamedTuple):
    """What Omega's rate hangs on beside Omega, (t, ...): dOmega/dt = still + shaft T + opposing g.

    T are the laws' torques on the shafts, g what opposes the sphere.
    """

    still: jax.Array  # (t, 3) rad/s^2, of the motor torques and of gravity
    shaft: jax.Array  # (t, 3, n)
    opposing: jax.Array  # (t, 3, 3)
    inertia: jax.Array  # (t, 3, 3), of the sphere in inertial axes
    axes: jax.Array  # (t, n, 3)
    radius: jax.Array  # (t, n) m
    theta: jax.Array  # (t, n) rad
    torque: jax.Array  # (t, n) N m
    normal: jax.Array  # (t, n) N
    attitude: jax.Array  # (t, 3, 3)
    measured: jax.Array  # (t, 3) rad/s


def observed_turning(rig: Rig, motion: Motion, path: Path, normal, step: float, at_rest: bool):
    """(Omega (t, 3), wheel speeds (t, n)) at the FINE points, from Omega at the samples.

    `path` is that of `path_along`, `normal` (t, n) the contacts' forces.  A run that begins at rest
    begins at zero: smoothed angles say so only to 1e-2 rad/s, which already is sliding.
    """
    samples = (len(normal) - 1) // FINE + 1
    path = path._replace(normal=padded(normal[:: FINE // 2], len(path.still)))
    first = np.zeros(3) if at_rest else motion.turning[0]
    omega = np.asarray(_integrate(rig, path, step, first))[:samples]
    fine = CubicSpline(np.arange(samples), omega)(np.arange(len(normal)) / FINE)
    radius = rolling_radius(rig, motion)
    speed = float(rig.sphere.radius) * np.einsum("tij,tj->ti", motion.axes, fine) / radius
    return fine, speed


def path_along(rig: Rig, motion: Motion, response: Turning, torque, longest: int) -> Path:
    """The path at two points a sample (starts, middles, ends of the steps), without normal forces.

    Runs are padded to `longest` samples, so that one program serves all.
    """
    half, length = FINE // 2, 2 * (longest - 1) + 1

    def every(x):
        return np.broadcast_to(x, (len(torque), *x.shape[1:]))[::half]

    axes, Q = every(response.axes), every(motion.attitude)
    shaft, opposing = (every(x) for x in response.rates)
    weight = np.asarray(rig.sphere.mass * rig.platform.gravity)
    lever = np.cross(Q @ np.asarray(rig.sphere.centre_of_mass), weight)
    still = shaft @ every(torque)[:, :, None] - opposing @ lever[:, :, None]
    inertia = Q @ np.asarray(rig.sphere.inertia_matrix) @ np.swapaxes(Q, 1, 2)
    radius = every(rolling_radius(rig, motion))
    path = packed(
        Path, still[:, :, 0], shaft, opposing, inertia, axes, radius, every(motion.theta),
        every(torque), np.zeros_like(radius), Q, every(motion.turning),
    )  # fmt: skip
    return jax.tree.map(lambda x: jnp.asarray(padded(x, length)), path)


@jax.jit
def _integrate(rig: Rig, path: Path, step, first):
    """Omega (samples, 3): classical Runge-Kutta, one step a sample."""
    points = tuple(jax.tree.map(lambda x, k=k: x[k : len(x) - 2 + k : 2], path) for k in range(3))

    def ahead(omega, rate, h):
        return [o + h * r for o, r in zip(omega, rate, strict=True)]

    def body(omega, now):
        a, b, c = now
        k1 = _rate(rig, omega, a)
        k2 = _rate(rig, ahead(omega, k1, step / 2), b)
        k3 = _rate(rig, ahead(omega, k2, step / 2), b)
        k4 = _rate(rig, ahead(omega, k3, step), c)
        mean = [(p + 2 * q + 2 * r + s) / 6 for p, q, r, s in zip(k1, k2, k3, k4, strict=True)]
        omega = ahead(omega, mean, step)
        return omega, jnp.stack(omega)

    start = [first[k] for k in range(3)]
    _, out = jax.lax.scan(body, start, points)
    return jnp.concatenate([first[None], out])


def _rate(rig: Rig, omega: list, at: Path) -> list:
    """dOmega/dt at one moment, number by number."""
    shaft, opposing = _law_torques(rig, omega, at)
    spin = _times(at.inertia, omega)
    opposing = [g + w for g, w in zip(opposing, _cross(omega, spin), strict=True)]
    turned = zip(_times(at.shaft, shaft), _times(at.opposing, opposing), strict=True)
    return [
        at.still[k] + s + g + PULL * (at.measured[k] - omega[k]) for k, (s, g) in enumerate(turned)
    ]


def _law_torques(rig: Rig, omega: list, at: Path) -> tuple[list, list]:
    """The laws' torques on the shafts (n) and against the sphere (3)."""
    wheels, roll = rig.wheels, _times(at.axes, omega)
    speed = [rig.sphere.radius * r / at.radius[i] for i, r in enumerate(roll)]
    spin = _times(-wheels.normal, omega)
    shaft, opposing = [0.0 * r for r in roll], [0.0 * w for w in omega]
    for placed in rig.at("shaft"):
        for i in placed.wheels:
            shaft[i] += placed.law(ShaftSignal(at.theta[i], speed[i], at.torque[i]))
    for placed in rig.at("rolling"):
        for i in placed.wheels:
            pressed = jnp.maximum(at.normal[i], 0.0)
            found = placed.law(RollingSignal(roll[i], spin[i], pressed, wheels.contact.friction[i]))
            shaft[i] -= found.shaft
            for k in range(3):
                opposing[k] += at.axes[i, k] * found.roll - wheels.normal[i, k] * found.spin
    for placed in rig.at("sphere"):
        signal = BodySignal(jnp.stack(omega), at.attitude, rig.sphere.mass, rig.platform.gravity)
        torque = placed.law(signal)
        opposing = [g - torque[k] for k, g in enumerate(opposing)]
    return shaft, opposing


def _times(matrix, vector: list) -> list:
    return [sum(matrix[i, k] * x for k, x in enumerate(vector)) for i in range(len(matrix))]


def _cross(a: list, b: list) -> list:
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
