"""Torques on the shaft: friction, offset, ripple."""

from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from ._base import ANY_LENGTH, Parameter
from ._ports import AbstractShaft

_WHEELS = ("wheel", "all")


class BearingCoulomb(AbstractShaft):
    """Shaft torque -tau tanh(omega/omega0)."""

    torque: Float[Array, ""]
    width: Float[Array, ""] = 0.05  # pyright: ignore[reportAssignmentType]

    id: ClassVar[str] = "bearing-coulomb"
    words: ClassVar[str] = "dry friction of the bearing"
    places: ClassVar[tuple[str, ...]] = _WHEELS
    formula: ClassVar[str] = "shaft torque −τ tanh(ω/ω₀)"
    parameters: ClassVar[dict[str, Parameter]] = {
        "torque": Parameter("N m", low=0, linear=True),
        "width": Parameter("rad/s", low=0, above=True, optional=True),
    }

    def __call__(self, signal, state=None):
        return -self.torque * jnp.tanh(signal.speed / self.width)


class BearingViscous(AbstractShaft):
    """Shaft torque -b omega."""

    b: Float[Array, ""]

    id: ClassVar[str] = "bearing-viscous"
    words: ClassVar[str] = "viscous drag of the bearing"
    places: ClassVar[tuple[str, ...]] = _WHEELS
    formula: ClassVar[str] = "shaft torque −b ω"
    parameters: ClassVar[dict[str, Parameter]] = {"b": Parameter("N m s/rad", low=0, linear=True)}

    def __call__(self, signal, state=None):
        return -self.b * signal.speed


class MotorRipple(AbstractShaft):
    """Shaft torque += A sin(N theta + phi)."""

    amplitude: Float[Array, ""]
    order: Float[Array, ""]
    phase: Float[Array, ""]

    id: ClassVar[str] = "motor-ripple"
    words: ClassVar[str] = "torque ripple of the motor"
    places: ClassVar[tuple[str, ...]] = ("wheel",)
    formula: ClassVar[str] = "shaft torque += A sin(Nθ + φ)"
    parameters: ClassVar[dict[str, Parameter]] = {
        "amplitude": Parameter("N m", linear=True),
        "order": Parameter("1", low=0),
        "phase": Parameter("rad"),
    }

    def __call__(self, signal, state=None):
        return self.amplitude * jnp.sin(self.order * signal.angle + self.phase)


class TorqueOffset(AbstractShaft):
    """Shaft torque += tau."""

    torque: Float[Array, ""]

    id: ClassVar[str] = "torque-offset"
    words: ClassVar[str] = "an offset of the torque"
    places: ClassVar[tuple[str, ...]] = ("wheel",)
    formula: ClassVar[str] = "shaft torque += τ"
    parameters: ClassVar[dict[str, Parameter]] = {"torque": Parameter("N m", linear=True)}

    def __call__(self, signal, state=None):
        return self.torque * jnp.ones_like(signal.angle)


class Cogging(AbstractShaft):
    """Shaft torque += sum_k A_k sin(N_k theta + phi_k), whole or broken orders."""

    amplitudes: Float[Array, " k"]
    orders: Float[Array, " k"]
    phases: Float[Array, " k"]

    id: ClassVar[str] = "cogging"
    words: ClassVar[str] = "cogging of the motor"
    places: ClassVar[tuple[str, ...]] = ("wheel",)
    formula: ClassVar[str] = "shaft torque += Σ_k A_k sin(N_k θ + φ_k)"
    parameters: ClassVar[dict[str, Parameter]] = {
        "amplitudes": Parameter("N m", linear=True, shape=ANY_LENGTH),
        "orders": Parameter("1", low=0, shape=ANY_LENGTH),
        "phases": Parameter("rad", shape=ANY_LENGTH),
    }

    def __call__(self, signal, state=None):
        return jnp.sum(self.amplitudes * jnp.sin(self.orders * signal.angle + self.phases))


class Stribeck(AbstractShaft):
    """Shaft torque -tau exp(-(omega/omega_s)^2) tanh(omega/omega0)."""

    torque: Float[Array, ""]
    speed: Float[Array, ""]
    width: Float[Array, ""] = 0.05  # pyright: ignore[reportAssignmentType]

    id: ClassVar[str] = "stribeck"
    words: ClassVar[str] = "friction that is larger at low speed"
    places: ClassVar[tuple[str, ...]] = _WHEELS
    formula: ClassVar[str] = "shaft torque −τ exp(−(ω/ω_s)²) tanh(ω/ω₀)"
    widens: ClassVar[tuple[str, ...]] = ("bearing-coulomb",)
    parameters: ClassVar[dict[str, Parameter]] = {
        "torque": Parameter("N m", low=0, linear=True),
        "speed": Parameter("rad/s", low=0, above=True),
        "width": Parameter("rad/s", low=0, above=True, optional=True),
    }

    def __call__(self, signal, state=None):
        fading = jnp.exp(-((signal.speed / self.speed) ** 2))
        return -self.torque * fading * jnp.tanh(signal.speed / self.width)


class LoadFriction(AbstractShaft):
    """Shaft torque -mu |tau_g| tanh(omega/omega0), tau_g the torque that the gear passes on."""

    mu: Float[Array, ""]
    width: Float[Array, ""] = 0.05  # pyright: ignore[reportAssignmentType]

    id: ClassVar[str] = "load-friction"
    words: ClassVar[str] = "friction that grows with the load on the gear"
    places: ClassVar[tuple[str, ...]] = _WHEELS
    formula: ClassVar[str] = "shaft torque −μ |τ_g| tanh(ω/ω₀)"
    parameters: ClassVar[dict[str, Parameter]] = {
        "mu": Parameter("1", low=0, linear=True),
        "width": Parameter("rad/s", low=0, above=True, optional=True),
    }

    def __call__(self, signal, state=None):
        return -self.mu * jnp.abs(signal.load) * jnp.tanh(signal.speed / self.width)


class FrictionAsymmetry(AbstractShaft):
    """Shaft torque -tau |tanh(omega/omega0)|: dry friction that differs by direction by 2 tau."""

    torque: Float[Array, ""]
    width: Float[Array, ""] = 0.05  # pyright: ignore[reportAssignmentType]

    id: ClassVar[str] = "friction-asymmetry"
    words: ClassVar[str] = "dry friction that differs by direction"
    places: ClassVar[tuple[str, ...]] = _WHEELS
    formula: ClassVar[str] = "shaft torque −τ |tanh(ω/ω₀)|"
    widens: ClassVar[tuple[str, ...]] = ("torque-offset",)
    parameters: ClassVar[dict[str, Parameter]] = {
        "torque": Parameter("N m", linear=True),
        "width": Parameter("rad/s", low=0, above=True, optional=True),
    }

    def __call__(self, signal, state=None):
        return -self.torque * jnp.abs(jnp.tanh(signal.speed / self.width))
