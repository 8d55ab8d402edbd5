"""Rotation of the sphere: quaternion, inertia, no-slip drive forces (eqs. 39, 40, 44, 46)."""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from ._small import inverse, solve


def rotation_matrix(attitude: Float[Array, "4"]) -> Float[Array, "3 3"]:
    """Matrix body frame -> inertial frame of the quaternion (w, x, y, z), normalised here."""
    w, x, y, z = attitude / jnp.sqrt(attitude @ attitude)
    return jnp.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def attitude_rate(attitude: Float[Array, "4"], omega: Float[Array, "3"]) -> Float[Array, "4"]:
    """dq/dt = 1/2 (0, Omega) o q, Omega in the inertial frame (eq. 44)."""
    w, v = attitude[0], attitude[1:]
    vector = w * omega + jnp.cross(omega, v)
    return 0.5 * jnp.concatenate([jnp.atleast_1d(-(omega @ v)), vector])


class Inertia(NamedTuple):
    """Sphere's inertia in the inertial frame and its inverse."""

    matrix: Float[Array, "3 3"]  # kg m^2
    inverse: Float[Array, "3 3"]


def inertia_at(body_inertia: Float[Array, "3 3"], rotation: Float[Array, "3 3"]) -> Inertia:
    """Q I Q^T and its inverse."""
    body_inverse = inverse(body_inertia)
    return Inertia(rotation @ body_inertia @ rotation.T, rotation @ body_inverse @ rotation.T)


def drive_forces(
    axes: Float[Array, "n 3"],
    radius: Float[Array, " n"],
    sphere_radius: Float[Array, ""],
    wheel_inertia: Float[Array, " n"],
    inverse_inertia: Float[Array, "3 3"],
    shaft_torque: Float[Array, " n"],
    opposing: Float[Array, "3"],
    radius_term: Float[Array, " n"] | float = 0.0,
) -> Float[Array, " n"]:
    """Drive forces f_i in N on the sphere along `drive` that keep the wheels from slipping.

    (R^2 A I^-1 A^T + diag(r^2/I_w)) f = (r/I_w) torque + R A I^-1 g   (eqs. 39, 40, 43, 46)

    with A the rows of driven axes, g = Omega x I Omega + resistances; `radius_term` is
    (dr_w/dt) omega where that term is kept.
    """
    gain = sphere_radius * axes @ inverse_inertia
    matrix = sphere_radius * gain @ axes.T + jnp.diag(radius**2 / wheel_inertia)
    right = radius / wheel_inertia * shaft_torque + gain @ opposing + radius_term
    return solve(matrix, right)


def angular_acceleration(axes, sphere_radius, inverse_inertia, forces, opposing):
    """dOmega/dt = I^-1 (R A^T f - g) in rad/s^2 (eq. 40)."""
    return inverse_inertia @ (sphere_radius * axes.T @ forces - opposing)


def minimum_normal_force(forces: Float[Array, " n"], friction: Float[Array, " n"]):
    """N_i = |f_i| / mu_i: the least normal force without slip, N."""
    return jnp.abs(forces) / friction


def external_force(
    forces: Float[Array, " n"],
    platform_force: Float[Array, "3"],
    normal: Float[Array, "n 3"],
    drive: Float[Array, "n 3"],
    friction: Float[Array, " n"],
    sphere_mass: Float[Array, ""],
    total_mass: Float[Array, ""],
    outside: bool = False,
) -> Float[Array, "3"]:
    """Least external force on the sphere for no slip, N (eq. 45, rederived).

    F = M_s P/M_T - ([drive] - [contact direction][mu]^-1) f where the platform's own closure
    presses; times M_T/(M_T - M_s) where the force comes from `outside`.
    """
    contact = -normal  # wheel centre -> sphere centre is `normal`; the paper's R_i points back
    balance = sphere_mass / total_mass * platform_force
    balance = balance - (drive - contact / friction[:, None]).T @ forces
    return balance * (total_mass / (total_mass - sphere_mass)) if outside else balance
