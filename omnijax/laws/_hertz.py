"""Hertz contact of sphere and roller (eqs. 12-17) and the resistances it implies (eqs. 18-31)."""

import math
from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from ._base import Parameter
from ._ports import AbstractRolling, RollingTorque

Scalar = Float[Array, "..."] | float


def effective_radius(sphere_radius: Scalar, wheel_radius: Scalar) -> Scalar:
    """R' = R r / (R + r) in m (eq. 17)."""
    return sphere_radius * wheel_radius / (sphere_radius + wheel_radius)


def effective_modulus(
    sphere_modulus: Scalar, sphere_ratio: Scalar, wheel_modulus: Scalar, wheel_ratio: Scalar
) -> Scalar:
    """E' in Pa: 1/E' = (1 - nu_s^2)/E_s + (1 - nu_w^2)/E_w (eq. 16)."""
    flexibility = (1 - sphere_ratio**2) / sphere_modulus + (1 - wheel_ratio**2) / wheel_modulus
    return 1 / flexibility


def patch_radius(force: Scalar, radius: Scalar, modulus: Scalar) -> Float[Array, "..."]:
    """a = (3 N R' / 4 E')^(1/3) in m (eq. 13); 0 without contact, with a finite gradient."""
    pressed = jnp.asarray(force) > 0
    cube = 0.75 * jnp.where(pressed, force, 1.0) * radius / modulus
    return jnp.where(pressed, jnp.cbrt(cube), 0.0)


def peak_pressure(force: Scalar, radius: Scalar, modulus: Scalar) -> Float[Array, "..."]:
    """p0 = 3 N / (2 pi a^2) in Pa (eq. 14)."""
    a = patch_radius(force, radius, modulus)
    pressed = a > 0
    return jnp.where(pressed, 1.5 * force / (math.pi * jnp.where(pressed, a, 1.0) ** 2), 0.0)


def approach(force: Scalar, radius: Scalar, modulus: Scalar) -> Float[Array, "..."]:
    """delta = (9 N^2 / (16 R' E'^2))^(1/3) = a^2 / R' in m (eq. 15)."""
    return patch_radius(force, radius, modulus) ** 2 / radius


def normal_force(depth: Scalar, radius: Scalar, modulus: Scalar) -> Float[Array, "..."]:
    """N = (4/3) E' sqrt(R') delta^(3/2) in N, 0 without contact (eq. 15 solved for N)."""
    pressed = jnp.asarray(depth) > 0
    power = jnp.where(pressed, depth, 1.0) ** 1.5
    return jnp.where(pressed, 4 / 3 * modulus * jnp.sqrt(radius) * power, 0.0)


def tangent_stiffness(force: Scalar, radius: Scalar, modulus: Scalar) -> Float[Array, "..."]:
    """dN/d(delta) = 2 E' a at a normal force, in N/m."""
    return 2 * modulus * patch_radius(force, radius, modulus)


def spin_lever(force: Scalar, radius: Scalar, modulus: Scalar) -> Float[Array, "..."]:
    """l_s = 3 pi a / 16 in m (eq. 30): T_s = mu N l_s."""
    return 3 * math.pi / 16 * patch_radius(force, radius, modulus)


class HertzResistance(AbstractRolling):
    """Rolling arm l_r = a(N) and spin lever 3 pi a(N)/16 of the Hertz patch (eqs. 18-31).

    The rolling arm is zero for pure Hertz (eq. 22); `arm_ratio` times the patch radius is the
    paper's demonstration, 1 its value.
    """

    radius: Float[Array, ""]  # m, R'
    modulus: Float[Array, ""]  # Pa, E'
    arm_ratio: Float[Array, ""]
    width: Float[Array, ""]  # rad/s, regularisation of the sign

    id: ClassVar[str] = "hertz-resistance"
    places: ClassVar[tuple[str, ...]] = ("all",)
    formula: ClassVar[str] = "arm ratio × a(N) N tanh(Ω̂·Ω/ε), μ N (3π/16) a(N) tanh(R̂·Ω/ε)"
    source: ClassVar[str] = "eqs. 18-31"
    parameters: ClassVar[dict[str, Parameter]] = {
        "radius": Parameter("m", low=0),
        "modulus": Parameter("Pa", low=0),
        "arm_ratio": Parameter("1", low=0, linear=True),
        "width": Parameter("rad/s", low=0, above=True),
    }

    def __call__(self, signal, state=None):
        force = signal.normal_force
        a = patch_radius(force, self.radius, self.modulus)
        roll = self.arm_ratio * a * force * jnp.tanh(signal.roll / self.width)
        spin = 3 * math.pi / 16 * signal.friction * force * a
        return RollingTorque(roll=roll, spin=spin * jnp.tanh(signal.spin / self.width), shaft=roll)
