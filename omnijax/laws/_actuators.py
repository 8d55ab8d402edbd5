"""Between the commanded and the delivered torque: delay, lag, gain, ripple, saturation.

A delay acts on the command itself.  The others follow one after the other in the order of the rig,
each on the torque that the former left.
"""

from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from ._base import Parameter
from ._ports import AbstractActuator, AbstractCommand

_WHEELS = ("wheel", "all")


class ActuatorDelay(AbstractCommand):
    """The torque commanded d earlier acts; before the start the first one."""

    delay: Float[Array, ""]

    id: ClassVar[str] = "actuator-delay"
    words: ClassVar[str] = "a delay of the drive"
    places: ClassVar[tuple[str, ...]] = _WHEELS
    formula: ClassVar[str] = "the torque commanded d earlier acts, the first one before the start"
    parameters: ClassVar[dict[str, Parameter]] = {"delay": Parameter("s", low=0)}

    def __call__(self, signal, state=None):
        return -self.delay * jnp.ones_like(signal)


class ActuatorLag(AbstractActuator):
    """dx/dt = (u - x)/tau, x acts; at the start x = u."""

    tau: Float[Array, ""]

    id: ClassVar[str] = "actuator-lag"
    words: ClassVar[str] = "a slow drive"
    places: ClassVar[tuple[str, ...]] = _WHEELS
    formula: ClassVar[str] = "ẋ = (u − x)/τ, x acts"
    parameters: ClassVar[dict[str, Parameter]] = {"tau": Parameter("s", low=0, above=True)}

    def __call__(self, signal, state=None):
        return jnp.zeros_like(signal.torque) if state is None else state - signal.torque

    def initial(self):
        return jnp.zeros(())

    def rate(self, signal, state):
        return (signal.torque - state) / self.tau


class ActuatorSaturation(AbstractActuator):
    """Delivered torque limited to [-L, L]."""

    limit: Float[Array, ""]

    id: ClassVar[str] = "actuator-saturation"
    words: ClassVar[str] = "a drive at its limit"
    places: ClassVar[tuple[str, ...]] = _WHEELS
    formula: ClassVar[str] = "delivered torque limited to ±L"
    parameters: ClassVar[dict[str, Parameter]] = {"limit": Parameter("N m", low=0)}

    def __call__(self, signal, state=None):
        return jnp.clip(signal.torque, -self.limit, self.limit) - signal.torque


class MotorGain(AbstractActuator):
    """Delivered torque = (1 + g) commanded."""

    g: Float[Array, ""]

    id: ClassVar[str] = "motor-gain"
    words: ClassVar[str] = "a wrong torque constant of the motor"
    places: ClassVar[tuple[str, ...]] = ("wheel",)
    formula: ClassVar[str] = "delivered torque = (1 + g) × commanded"
    parameters: ClassVar[dict[str, Parameter]] = {"g": Parameter("1", linear=True)}

    def __call__(self, signal, state=None):
        return self.g * signal.torque


class CurrentRipple(AbstractActuator):
    """Delivered torque times (1 + g sin(N theta + phi))."""

    g: Float[Array, ""]
    order: Float[Array, ""]
    phase: Float[Array, ""]

    id: ClassVar[str] = "current-ripple"
    words: ClassVar[str] = "torque ripple that grows with the current"
    places: ClassVar[tuple[str, ...]] = ("wheel",)
    formula: ClassVar[str] = "delivered torque × (1 + g sin(Nθ + φ))"
    parameters: ClassVar[dict[str, Parameter]] = {
        "g": Parameter("1", linear=True),
        "order": Parameter("1", low=0),
        "phase": Parameter("rad"),
    }

    def __call__(self, signal, state=None):
        return self.g * jnp.sin(self.order * signal.angle + self.phase) * signal.torque
