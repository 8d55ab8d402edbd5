"""Rolling and spin resistance, air drag, unbalance; and creep."""

from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from .._root import root
from ._base import Parameter
from ._ports import AbstractBody, AbstractKinematics, AbstractRolling, RollingTorque


class RollingResistance(AbstractRolling):
    """arm N tanh(spin_axis . Omega / epsilon) against sphere and shaft (eqs. 18-20)."""

    arm: Float[Array, ""]
    width: Float[Array, ""] = 3e-3  # pyright: ignore[reportAssignmentType]

    id: ClassVar[str] = "rolling-resistance"
    words: ClassVar[str] = "rolling resistance"
    places: ClassVar[tuple[str, ...]] = ("all",)
    formula: ClassVar[str] = "arm × N tanh(Ω̂_i·Ω/ε), on the sphere and on the wheel's shaft"
    source: ClassVar[str] = "eqs. 18-20"
    parameters: ClassVar[dict[str, Parameter]] = {
        "arm": Parameter("m", low=0, linear=True),
        "width": Parameter("rad/s", low=0, above=True, optional=True),
    }

    def __call__(self, signal, state=None):
        torque = self.arm * signal.normal_force * jnp.tanh(signal.roll / self.width)
        return RollingTorque(roll=torque, spin=jnp.zeros_like(torque), shaft=torque)


class SpinResistance(AbstractRolling):
    """mu N lever tanh(contact direction . Omega / epsilon) against the sphere (eqs. 24-25)."""

    lever: Float[Array, ""]
    width: Float[Array, ""] = 3e-3  # pyright: ignore[reportAssignmentType]

    id: ClassVar[str] = "spin-resistance"
    words: ClassVar[str] = "spin resistance"
    places: ClassVar[tuple[str, ...]] = ("all",)
    formula: ClassVar[str] = "μ N × lever tanh(R̂_i·Ω/ε) on the sphere"
    source: ClassVar[str] = "eqs. 24-25"
    parameters: ClassVar[dict[str, Parameter]] = {
        "lever": Parameter("m", low=0, linear=True),
        "width": Parameter("rad/s", low=0, above=True, optional=True),
    }

    def __call__(self, signal, state=None):
        torque = self.lever * signal.friction * signal.normal_force
        torque = torque * jnp.tanh(signal.spin / self.width)
        return RollingTorque(roll=jnp.zeros_like(torque), spin=torque, shaft=jnp.zeros_like(torque))


class AirDrag(AbstractBody):
    """Torque -D |Omega| Omega on the sphere."""

    D: Float[Array, ""]

    id: ClassVar[str] = "air-drag"
    words: ClassVar[str] = "air drag on the sphere"
    places: ClassVar[tuple[str, ...]] = ("sphere",)
    formula: ClassVar[str] = "torque −D |Ω| Ω on the sphere"
    parameters: ClassVar[dict[str, Parameter]] = {"D": Parameter("N m s^2", low=0, linear=True)}

    def __call__(self, signal, state=None):
        speed = root(signal.angular_velocity @ signal.angular_velocity)
        return -self.D * speed * signal.angular_velocity


class Unbalance(AbstractBody):
    """Gravity torque of a centre of mass off the centre: (Q offset) x (M_s g)."""

    offset: Float[Array, "3"]

    id: ClassVar[str] = "unbalance"
    words: ClassVar[str] = "a centre of mass off the sphere's centre"
    places: ClassVar[tuple[str, ...]] = ("sphere",)
    formula: ClassVar[str] = "gravity torque of a centre of mass off the centre"
    parameters: ClassVar[dict[str, Parameter]] = {"offset": Parameter("m", linear=True, shape=3)}

    def __call__(self, signal, state=None):
        return jnp.cross(signal.rotation @ self.offset, signal.mass * signal.gravity)


class Creep(AbstractKinematics):
    """R spin_axis . Omega = (1 - s) r_w omega, the drive-force rows likewise."""

    creepage: Float[Array, ""]

    id: ClassVar[str] = "creep"
    words: ClassVar[str] = "creep between wheel and sphere"
    places: ClassVar[tuple[str, ...]] = ("wheel",)
    formula: ClassVar[str] = "R Ω̂·Ω = (1 − s) r_w ω, the drive-force rows likewise"
    parameters: ClassVar[dict[str, Parameter]] = {
        "creepage": Parameter("1", low=-1, high=1, linear=True)
    }

    def __call__(self, signal, state=None):
        return -self.creepage
