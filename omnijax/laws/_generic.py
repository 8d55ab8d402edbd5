"""Laws for other machines than a sphere on wheels: further candidates at the same ports."""

from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from ._base import Parameter
from ._ports import AbstractMount, AbstractShaft


class MountQuadratic(AbstractMount):
    """Mount tension += k2 Delta^2: a spring that is softer one way than the other."""

    k2: Float[Array, ""]

    id: ClassVar[str] = "mount-quadratic"
    words: ClassVar[str] = "a mount that is stiffer one way"
    places: ClassVar[tuple[str, ...]] = ("wheel", "all")
    formula: ClassVar[str] = "mount tension += k₂ Δ²"
    parameters: ClassVar[dict[str, Parameter]] = {"k2": Parameter("N/m^2", linear=True)}

    def __call__(self, signal, state=None):
        return self.k2 * signal.deflection**2


class ViscousAsymmetry(AbstractShaft):
    """Shaft torque -b |omega|: viscous friction that differs by direction by 2 b."""

    b: Float[Array, ""]

    id: ClassVar[str] = "viscous-asymmetry"
    words: ClassVar[str] = "viscous friction that differs by direction"
    places: ClassVar[tuple[str, ...]] = ("wheel", "all")
    formula: ClassVar[str] = "shaft torque −b |ω|"
    parameters: ClassVar[dict[str, Parameter]] = {"b": Parameter("N m s/rad", linear=True)}

    def __call__(self, signal, state=None):
        return -self.b * jnp.abs(signal.speed)


class DragTorque(AbstractShaft):
    """Shaft torque -D |omega| omega."""

    D: Float[Array, ""]

    id: ClassVar[str] = "shaft-drag"
    words: ClassVar[str] = "drag on the shaft"
    places: ClassVar[tuple[str, ...]] = ("wheel", "all")
    formula: ClassVar[str] = "shaft torque −D |ω| ω"
    parameters: ClassVar[dict[str, Parameter]] = {
        "D": Parameter("N m s^2/rad^2", low=0, linear=True)
    }

    def __call__(self, signal, state=None):
        return -self.D * jnp.abs(signal.speed) * signal.speed


class StiffShaft(AbstractShaft):
    """Shaft torque -k angle: a spring that pulls the shaft back."""

    k: Float[Array, ""]

    id: ClassVar[str] = "shaft-spring"
    words: ClassVar[str] = "a spring on the shaft"
    places: ClassVar[tuple[str, ...]] = ("wheel", "all")
    formula: ClassVar[str] = "shaft torque −k θ"
    parameters: ClassVar[dict[str, Parameter]] = {"k": Parameter("N m/rad", linear=True)}

    def __call__(self, signal, state=None):
        return -self.k * signal.angle


class LoadFrictionQuadratic(AbstractShaft):
    """Shaft torque -kappa tau_g^2 tanh(omega/omega0), tau_g the torque that the gear passes on.

    Source: M. Duclusaud et al., "Extended Friction Models for the Physics Simulation of Servo
    Actuators", ICRA 2025 (the quadratic term of its last model).
    """

    kappa: Float[Array, ""]
    width: Float[Array, ""] = 0.05  # pyright: ignore[reportAssignmentType]

    id: ClassVar[str] = "load-friction-quadratic"
    words: ClassVar[str] = "friction that grows with the square of the load on the gear"
    places: ClassVar[tuple[str, ...]] = ("wheel", "all")
    formula: ClassVar[str] = "shaft torque −κ τ_g² tanh(ω/ω₀)"
    parameters: ClassVar[dict[str, Parameter]] = {
        "kappa": Parameter("1/(N m)", low=0, linear=True),
        "width": Parameter("rad/s", low=0, above=True, optional=True),
    }

    def __call__(self, signal, state=None):
        return -self.kappa * signal.load**2 * jnp.tanh(signal.speed / self.width)


GENERIC: dict[str, type[AbstractMount | AbstractShaft]] = {
    law.id: law
    for law in (MountQuadratic, ViscousAsymmetry, DragTorque, StiffShaft, LoadFrictionQuadratic)
}
