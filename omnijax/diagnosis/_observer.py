"""Omega where dry friction hangs on it: the model's own Omega, held gently to the measured one.

Near a reversal tanh(Omega/epsilon) changes within 1e-4 rad/s, less than smoothed angles resolve, so
the laws are evaluated along dOmega/dt = model + pull (measured - Omega).  Where the model is right
the pull does nothing; where it is not, Omega stays near the measured one.
"""

import jax
import jax.numpy as jnp
import numpy as np

from ..laws import BodySignal, RollingSignal, RollingTorque, ShaftSignal
from ..rig import Rig, over_wheels
from ._motion import Motion
from ._rotation import Turning
from ._runs import FINE

TURNING = ("shaft", "rolling", "sphere")  # ports whose laws act on the rotation
PULL = 5.0  # 1/s


def needs_observer(rig: Rig) -> bool:
    """Whether a law with a friction width acts on the rotation."""
    placed = (*rig.at("rolling"), *rig.at("shaft"))
    return any("width" in p.law.parameters for p in placed)


def observed_turning(
    rigs: Rig, motion: Motion, response: Turning, torque, normal, step: float, at_rest: bool
):
    """(Omega (t, 3), wheel speeds (t, n)) at the FINE points, from Omega at the samples.

    A run that begins at rest begins at zero: smoothed angles say so only to 1e-2 rad/s, which
    already is sliding.
    """
    radius = motion.factor * (np.asarray(rigs.wheels.radius) + motion.shape)
    half = FINE // 2
    points = len(torque)

    def every(x):
        return jnp.asarray(np.broadcast_to(x, (points, *x.shape[1:]))[::half])

    here = tuple(
        every(x)
        for x in (
            torque, motion.theta, radius, normal, motion.attitude, motion.axes,
            response.torque_gain, response.force, response.body, response.inverse_inertia,
            motion.turning,
        )
    )  # fmt: skip
    first = np.zeros(3) if at_rest else motion.turning[0]
    omega = np.asarray(_integrate(rigs, here, step, first))
    fine = _hermite(omega, motion.turning, FINE)
    speed = float(rigs.sphere.radius) * np.einsum("tij,tj->ti", motion.axes, fine) / radius
    return fine, speed


def _hermite(samples: np.ndarray, measured: np.ndarray, parts: int) -> np.ndarray:
    """Samples refined smoothly by a cubic spline."""
    from scipy.interpolate import CubicSpline

    at = np.arange(len(samples))
    return CubicSpline(at, samples)(np.arange(len(measured)) / parts)


@jax.jit
def _integrate(rig: Rig, here, step, first):
    pairs = jax.tree.map(lambda x: (x[:-1:2], x[1::2], x[2::2]), here)
    start, middle, end = (tuple(p[k] for p in pairs) for k in range(3))

    def body(omega, now):
        a, b, c = now
        k1 = _rate(rig, omega, a)
        k2 = _rate(rig, omega + step / 2 * k1, b)
        k3 = _rate(rig, omega + step / 2 * k2, b)
        k4 = _rate(rig, omega + step * k3, c)
        omega = omega + step / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        return omega, omega

    _, out = jax.lax.scan(body, first, (start, middle, end))
    return jnp.concatenate([first[None], out])


def _rate(rig: Rig, omega, here):
    torque, theta, radius, normal, Q, axes, gain, force, body, inverse, measured = here
    roll = axes @ omega
    speed = rig.sphere.radius * roll / radius
    shaft = torque + over_wheels(rig.at("shaft"), ShaftSignal(theta, speed, torque), rig.size)
    inertia = rig.sphere.inertia_matrix
    opposing = jnp.cross(omega, Q @ (inertia @ (Q.T @ omega)))
    signals = RollingSignal(
        roll, -rig.wheels.normal @ omega, jnp.maximum(normal, 0.0), rig.wheels.contact.friction
    )
    zero = RollingTorque(0.0, 0.0, 0.0)  # pyright: ignore[reportArgumentType]
    rolling = over_wheels(rig.at("rolling"), signals, rig.size, zero)
    opposing = opposing + axes.T @ rolling.roll - rig.wheels.normal.T @ rolling.spin
    shaft = shaft - rolling.shaft
    weight = rig.sphere.mass * rig.platform.gravity
    opposing = opposing - jnp.cross(Q @ rig.sphere.centre_of_mass, weight)
    for placed in rig.at("sphere"):
        opposing = opposing - placed.law(
            BodySignal(omega, Q, rig.sphere.mass, rig.platform.gravity)
        )
    drive = force @ (gain * shaft + body @ opposing)
    rate = inverse @ (rig.sphere.radius * axes.T @ drive - opposing)
    return rate + PULL * (measured - omega)
