"""Rolling kinematics: wheel shapes, rolling radii, driven axes (eqs. 1-11, 39, 43)."""

from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..laws import DualRow
from ..rig import Rig, grouped_profiles, law_output, over_wheels, put_wheels, take_wheels
from ._attitude import rotation_matrix
from ._small import least_squares


def wheel_shape(rig: Rig, angle: Float[Array, " n"]) -> Float[Array, " n"]:
    """rho_i(theta_i) in m: profiles and every law at the port `shape` (eq. 2)."""
    gaps = rig.gaps
    rho = jnp.zeros(rig.size)
    for shape, wheels in grouped_profiles(rig):
        heights = shape(*take_wheels((angle, gaps), wheels, rig.size))
        rho = put_wheels(rho, wheels, heights)
    for placed in rig.at("shape"):
        for i in placed.wheels:
            gap = jax.tree.map(lambda x, i=i: x[i], gaps)
            rho = rho.at[i].add(law_output(placed.law, (), angle[i], gap))
    return rho


def surface_shape(rig: Rig, attitude: Float[Array, "4"]) -> Float[Array, " n"]:
    """Change of the position input by a sphere that is out of round, m."""
    placed = rig.at("surface")
    if not placed:
        return jnp.zeros(rig.size)
    directions = -rig.wheels.normal @ rotation_matrix(attitude)  # rows: Q^T R_i, body frame
    heights = (jax.vmap(partial(law_output, p.law, ()))(directions) for p in placed)
    return sum(heights, jnp.zeros(rig.size))


def position_input(rig, angle, attitude) -> Float[Array, " n"]:
    """The elastic model's input rho_i in m: wheel shape and sphere surface."""
    return wheel_shape(rig, angle) + surface_shape(rig, attitude)


def spin_axes(rig: Rig, angle: Float[Array, " n"]) -> Float[Array, "n 3"]:
    """Sphere axes that the wheels drive; a dual-row wheel's axis tilts to the row in contact.

    A contact at the offset s along the axle turns the arm by asin(s/R) about `drive`.
    """
    axes = rig.wheels.spin_axis
    gaps = rig.gaps
    for i, profile in enumerate(rig.profiles):
        if isinstance(profile, DualRow):
            gap = jax.tree.map(lambda x, i=i: x[i], gaps)
            sine = profile.lateral(angle[i], gap) / rig.sphere.radius
            tilted = jnp.sqrt(1 - sine**2) * axes[i] + sine * rig.wheels.normal[i]
            axes = axes.at[i].set(tilted)
    return axes


class Rolling(NamedTuple):
    """Rolling geometry at one instant, one entry a wheel."""

    radius: Float[Array, " n"]  # m, (1 - creepage) r_w: what the velocity constraint sees
    axes: Float[Array, "n 3"]  # driven sphere axes


def rolling(rig: Rig, angle: Float[Array, " n"], speed: Float[Array, " n"]) -> Rolling:
    """Rolling radii (eq. 2, with creep) and driven axes of wheels that turn at `speed` (rad/s)."""
    return Rolling(rolling_radius(rig, wheel_shape(rig, angle), speed), spin_axes(rig, angle))


def rolling_under(rig: Rig, angle: Float[Array, " n"], omega: Float[Array, "3"]) -> Rolling:
    """`rolling` of wheels that a sphere turns: their speed follows from Omega (rad/s)."""
    axes = spin_axes(rig, angle)
    rim = rig.sphere.radius * (axes @ omega)
    return Rolling(radius_under(rig, wheel_shape(rig, angle), rim), axes)


def rolling_radius(rig: Rig, shape: Float[Array, " n"], speed: Float[Array, " n"]):
    """(1 - creepage) (r_b + rho) in m of wheels that show the shape rho (m) at `speed` (rad/s)."""
    factor = 1 + over_wheels(rig.at("kinematics"), speed, rig.size)
    return factor * (rig.wheel_radius + shape)


SPEED_STEPS = 4  # of Newton's method; one is exact where the laws do not ask for the speed


def radius_under(rig: Rig, shape: Float[Array, " n"], rim: Float[Array, " n"]):
    """Rolling radii in m of wheels whose rims the sphere moves at R axis . Omega = `rim` (m/s).

    A law at `kinematics` may hang on the speed omega, which then solves omega radius(omega) = rim.
    """
    if not rig.at("kinematics"):
        return rig.wheel_radius + shape
    speed = rim / (rig.wheel_radius + shape)
    one = jnp.ones(rig.size)
    for _ in range(SPEED_STEPS):
        moved, slope = jax.jvp(lambda w: w * rolling_radius(rig, shape, w), (speed,), (one,))
        speed = speed - (moved - rim) / slope
    return rolling_radius(rig, shape, speed)


def wheel_speeds(rig: Rig, geometry: Rolling, omega: Float[Array, "3"]) -> Float[Array, " n"]:
    """omega_i = R axis_i . Omega / r_w,i in rad/s: no slip along `drive` (eq. 43)."""
    return rig.sphere.radius * (geometry.axes @ omega) / geometry.radius


def sphere_velocity(rig: Rig, geometry: Rolling, speed: Float[Array, " n"]) -> Float[Array, "3"]:
    """Omega in rad/s from wheel speeds: J omega, J = [axes]^-T diag(r_w)/R (eq. 44).

    With more than three wheels the least-squares velocity, with fewer the one of least size (the
    axes that no wheel drives stand still).
    """
    rim = geometry.radius * speed / rig.sphere.radius
    return least_squares(geometry.axes, rim)


def incompatibility(rig: Rig, geometry: Rolling, speed: Float[Array, " n"]) -> Float[Array, " n"]:
    """Sliding speed R axis_i . Omega - r_w,i omega_i in m/s that prescribed speeds force."""
    omega = sphere_velocity(rig, geometry, speed)
    return rig.sphere.radius * (geometry.axes @ omega) - geometry.radius * speed
