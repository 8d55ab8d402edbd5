"""Effects on shapes: another radius, runout, a damaged roller, a sphere out of round."""

import math
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from ._base import FILLED_IN, Parameter
from ._ports import AbstractRadius, AbstractShape, AbstractSurface
from ._shapes import Gap


class WheelRadius(AbstractRadius):
    """r_b becomes r_b (1 + s) everywhere: in the rolling radius, the gaps and the contact."""

    s: Float[Array, ""]

    id: ClassVar[str] = "wheel-radius"
    words: ClassVar[str] = "a wheel of another radius"
    places: ClassVar[tuple[str, ...]] = ("wheel", "all")
    formula: ClassVar[str] = "r_b becomes r_b (1 + s), everywhere"
    widens: ClassVar[tuple[str, ...]] = ("creep",)
    parameters: ClassVar[dict[str, Parameter]] = {
        "s": Parameter("1", low=-1, linear=True, above=True)
    }

    def __call__(self, signal, state=None):
        return self.s * signal


class WheelRunout(AbstractShape):
    """rho += A cos(theta - phi), in the rolling radius too."""

    amplitude: Float[Array, ""]
    phase: Float[Array, ""]

    id: ClassVar[str] = "wheel-runout"
    words: ClassVar[str] = "runout of the wheel"
    places: ClassVar[tuple[str, ...]] = ("wheel",)
    formula: ClassVar[str] = "ρ += A cos(θ − φ), in r_w too"
    parameters: ClassVar[dict[str, Parameter]] = {
        "amplitude": Parameter("m", linear=True),
        "phase": Parameter("rad"),
    }

    def __call__(self, angle, gap):
        return self.amplitude * jnp.cos(angle - self.phase)


class DamagedRoller(AbstractShape):
    """rho times (1 + s) in gap j, theta in [2 pi j/n, 2 pi j/n + width) modulo a turn.

    `profile` is the wheel's own profile; the rig fills it in when it places the law.
    """

    roller: Float[Array, ""]
    severity: Float[Array, ""]
    profile: AbstractShape | None = eqx.field(default=None, metadata=FILLED_IN)

    id: ClassVar[str] = "damaged-roller"
    words: ClassVar[str] = "a damaged roller"
    places: ClassVar[tuple[str, ...]] = ("wheel",)
    formula: ClassVar[str] = "in gap j ρ times (1 + s)"
    parameters: ClassVar[dict[str, Parameter]] = {
        "roller": Parameter("1", low=0, whole=True),
        "severity": Parameter("1", linear=True),
    }

    def __call__(self, angle, gap: Gap):
        if self.profile is None:
            raise ValueError("`damaged-roller` needs the profile of the wheel it is placed at.")
        turn = jnp.mod(angle, 2 * math.pi)
        number = jnp.floor(turn / gap.pitch)
        here = (number == jnp.round(self.roller)) & (turn - number * gap.pitch < gap.width)
        return jnp.where(here, self.severity * self.profile(angle, gap), 0.0)


class SphereOutOfRound(AbstractSurface):
    """rho_i += A P2(e . R_i), e turning with the sphere, R_i the direction to contact i."""

    amplitude: Float[Array, ""]
    axis: Float[Array, "3"]

    id: ClassVar[str] = "sphere-out-of-round"
    words: ClassVar[str] = "a sphere out of round"
    places: ClassVar[tuple[str, ...]] = ("sphere",)
    formula: ClassVar[str] = "ρ_i += A P₂(e·R̂_i), position input only"
    parameters: ClassVar[dict[str, Parameter]] = {
        "amplitude": Parameter("m", linear=True),
        "axis": Parameter("1", shape=3),
    }

    def __call__(self, direction, state=None):
        along = self.axis @ direction / jnp.sqrt(self.axis @ self.axis)
        return self.amplitude * (1.5 * along**2 - 0.5)
