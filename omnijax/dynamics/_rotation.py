"""Rotation of the sphere: inertia, no-slip drive forces, response (eqs. 39, 40, 46)."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..rig import Rig
from ._forces import Torques
from ._kinematics import Rolling
from ._small import inverse, solve


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


def rotation_under(
    rig: Rig, geometry: Rolling, inverse_inertia, caused: Torques, radius_term=0.0
) -> tuple[Float[Array, " n"], Float[Array, "3"]]:
    """(drive forces in N, dOmega/dt in rad/s^2) under torques; linear in them."""
    R, axes = rig.sphere.radius, geometry.axes
    drive = drive_forces(
        axes, geometry.radius, R, rig.wheels.inertia, inverse_inertia, *caused, radius_term
    )
    return drive, angular_acceleration(axes, R, inverse_inertia, drive, caused.opposing)


def rotation_response(rig: Rig, geometry: Rolling, inverse_inertia) -> Float[Array, "k m"]:
    """Rows: torque on each shaft (n), then opposing the sphere about each axis (3).

    Columns: the drive forces (n) and dOmega/dt (3) that a unit of it causes; read off
    `rotation_under` by differentiation, exact because that is linear.
    """
    n = rig.size

    def turned(torque):
        caused = Torques(torque[:n], torque[n:])
        return jnp.concatenate(rotation_under(rig, geometry, inverse_inertia, caused))

    return jax.jacfwd(turned)(jnp.zeros(n + 3)).T


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
