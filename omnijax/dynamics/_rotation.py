"""Rotation of the sphere: inertia, no-slip drive forces, response (eqs. 39, 40, 46)."""

from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..rig import Rig
from ._forces import Torques
from ._kinematics import Rolling
from ._small import solve


def inertia_at(body_inertia: Float[Array, "3 3"], rotation: Float[Array, "3 3"]):
    """Q I Q^T: the sphere's inertia (3, 3) in the inertial frame, kg m^2."""
    return rotation @ body_inertia @ rotation.T


def turned(
    axes: Float[Array, "n 3"],
    radius: Float[Array, " n"],
    sphere_radius: Float[Array, ""],
    wheel_inertia: Float[Array, " n"],
    inertia: Float[Array, "3 3"],
    shaft_torque: Float[Array, " n"],
    opposing: Float[Array, "3"],
    radius_term: Float[Array, " n"] | float = 0.0,
) -> tuple[Float[Array, " n"], Float[Array, "3"]]:
    """Drive forces f_i in N on the sphere along `drive` without slip, and dOmega/dt in rad/s^2.

    With A the rows of driven axes, g = Omega x I Omega + resistances (eqs. 39, 40, 43):

    r f = torque - I_w domega/dt,  domega/dt = (R A dOmega/dt - radius_term)/r,
    I dOmega/dt = R A^T f - g

    The forces taken out, the wheels' inertias go to the sphere's, three equations for any number of
    wheels: (I + R^2 A^T diag(I_w/r^2) A) dOmega/dt = R A^T (torque/r + I_w/r^2 radius_term) - g.
    Eq. 46 takes out dOmega/dt in their place.  `radius_term` is (dr_w/dt) omega where it is kept.
    """
    arms = sphere_radius * axes
    carried = wheel_inertia / radius**2
    pushed = shaft_torque / radius + carried * radius_term
    whole = inertia + (arms.T * carried) @ arms
    acceleration = solve(whole, arms.T @ pushed - opposing)
    return pushed - carried * (arms @ acceleration), acceleration


def drive_forces(*arguments: Any, **named: Any) -> Float[Array, " n"]:
    """The forces of `turned` alone, N."""
    return turned(*arguments, **named)[0]


def rotation_under(
    rig: Rig, geometry: Rolling, inertia, caused: Torques, radius_term=0.0
) -> tuple[Float[Array, " n"], Float[Array, "3"]]:
    """(drive forces in N, dOmega/dt in rad/s^2) under torques; linear in them."""
    R, spin = rig.sphere.radius, rig.wheels.inertia
    return turned(geometry.axes, geometry.radius, R, spin, inertia, *caused, radius_term)


def rotation_response(rig: Rig, geometry: Rolling, inertia) -> Float[Array, "k m"]:
    """Rows: torque on each shaft (n), then opposing the sphere about each axis (3).

    Columns: the drive forces (n) and dOmega/dt (3) that a unit of it causes; read off
    `rotation_under` by differentiation, exact because that is linear.
    """
    n = rig.size

    def turned(torque):
        caused = Torques(torque[:n], torque[n:])
        return jnp.concatenate(rotation_under(rig, geometry, inertia, caused))

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
