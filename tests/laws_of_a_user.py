"""A law file as a user writes it: a law at each port at which laws turn a machine or read it.

None is linear in what its port hands to it, some have memory, vectors, or parameters called as the
numbers of a machine are.  Tests load it with `load_laws`; it imports what a user's file may.
"""

from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from omnijax import laws
from omnijax.laws import Parameter

WHEEL = ("wheel", "all")


class SwollenTyre(laws.AbstractRadius):
    """Wheel radius += speed (r/size)^2: larger wheels swell more."""

    speed: Float[Array, ""]
    width: Float[Array, ""]

    id: ClassVar[str] = "swollen-tyre"
    places: ClassVar[tuple[str, ...]] = WHEEL
    formula: ClassVar[str] = "r_w += speed (r_w/width)²"
    parameters: ClassVar[dict[str, Parameter]] = {
        "speed": Parameter("m", linear=True),
        "width": Parameter("m", low=0, above=True),
    }

    def __call__(self, signal, state=None):
        return self.speed * (signal / self.width) ** 2


class SlowClock(laws.AbstractCommand):
    """The command of a time that runs slow and swings."""

    share: Float[Array, ""]
    swing: Float[Array, ""]

    id: ClassVar[str] = "slow-clock"
    places: ClassVar[tuple[str, ...]] = WHEEL
    formula: ClassVar[str] = "t -= share t + swing (1 - cos 40 t)"
    parameters: ClassVar[dict[str, Parameter]] = {
        "share": Parameter("1", low=0, linear=True),
        "swing": Parameter("s", low=0),
    }

    def __call__(self, signal, state=None):
        return -self.share * signal - self.swing * (1 - jnp.cos(40 * signal))


class WarmMotor(laws.AbstractActuator):
    """A motor that loses torque as it warms: state h, dh/dt = (torque^2 - h)/tau."""

    loss: Float[Array, ""]
    tau: Float[Array, ""]

    id: ClassVar[str] = "warm-motor"
    places: ClassVar[tuple[str, ...]] = WHEEL
    formula: ClassVar[str] = "torque -= loss torque (h + 0.1 sin 3θ), τ dh/dt = torque² - h"
    parameters: ClassVar[dict[str, Parameter]] = {
        "loss": Parameter("1/(N m)^2", linear=True),
        "tau": Parameter("s", low=0, above=True),
    }

    def __call__(self, signal, state=None):
        return -self.loss * signal.torque * (state + 0.1 * jnp.sin(3 * signal.angle))

    def initial(self):
        return jnp.asarray(0.0)

    def rate(self, signal, state):
        return (signal.torque**2 - state) / self.tau


class LoadedSeal(laws.AbstractShaft):
    """A seal that drags with the square of the speed, and more under load."""

    drag: Float[Array, ""]
    load: Float[Array, ""]

    id: ClassVar[str] = "loaded-seal"
    places: ClassVar[tuple[str, ...]] = WHEEL
    formula: ClassVar[str] = "shaft torque -= (drag + load L²) ω |ω|, L the delivered torque"
    parameters: ClassVar[dict[str, Parameter]] = {
        "drag": Parameter("N m s^2", low=0, linear=True),
        "load": Parameter("s^2/(N m)", low=0),
    }

    def __call__(self, signal, state=None):
        size = self.drag + self.load * signal.load**2
        return -size * signal.speed * jnp.abs(signal.speed)


class BentScale(laws.AbstractSensor):
    """Readings grow with their square and with the time."""

    bend: Float[Array, ""]

    id: ClassVar[str] = "bent-scale"
    places: ClassVar[tuple[str, ...]] = ("group", "channel")
    formula: ClassVar[str] = "y += bend (y² + t)"
    parameters: ClassVar[dict[str, Parameter]] = {"bend": Parameter("1", linear=True)}

    def __call__(self, signal, state=None):
        return self.bend * (signal.values**2 + signal.time[:, None])


class SpeedSlip(laws.AbstractKinematics):
    """A wheel that slips back the more the faster it turns."""

    slip: Float[Array, ""]
    knee: Float[Array, ""]

    id: ClassVar[str] = "speed-slip"
    places: ClassVar[tuple[str, ...]] = WHEEL
    formula: ClassVar[str] = "R Ω/(r_w ω) -= slip ω²/(ω² + knee²)"
    parameters: ClassVar[dict[str, Parameter]] = {
        "slip": Parameter("1", linear=True),
        "knee": Parameter("rad/s", low=0, above=True),
    }

    def __call__(self, signal, state=None):
        return -self.slip * signal**2 / (signal**2 + self.knee**2)


class StiffCore(laws.AbstractContact):
    """A contact that stiffens the farther it is from where it has crept to."""

    core: Float[Array, ""]
    tau: Float[Array, ""]

    id: ClassVar[str] = "stiff-core"
    places: ClassVar[tuple[str, ...]] = WHEEL
    formula: ClassVar[str] = "tension += core K (δ - z)³, τ dz/dt = δ - z"
    parameters: ClassVar[dict[str, Parameter]] = {
        "core": Parameter("1/m^2", low=0, linear=True),
        "tau": Parameter("s", low=0, above=True),
    }

    def __call__(self, signal, state=None):
        return self.core * signal.stiffness * (signal.deflection - state) ** 3

    def initial(self):
        return jnp.asarray(0.0)

    def rate(self, signal, state):
        return (signal.deflection - state) / self.tau


class QuadraticMount(laws.AbstractMount):
    """A damper of the second power, softened."""

    d: Float[Array, ""]

    id: ClassVar[str] = "quadratic-mount"
    places: ClassVar[tuple[str, ...]] = WHEEL
    formula: ClassVar[str] = "mount tension += d Δ̇ sqrt(Δ̇² + 1e-6)"
    parameters: ClassVar[dict[str, Parameter]] = {"d": Parameter("N s^2/m^2", low=0, linear=True)}

    def __call__(self, signal, state=None):
        return self.d * signal.rate * jnp.sqrt(signal.rate**2 + 1e-6)


class SoftGrip(laws.AbstractSeparation):
    """A contact that gives way a little as it is unloaded."""

    grip: Float[Array, ""]

    id: ClassVar[str] = "soft-grip"
    places: ClassVar[tuple[str, ...]] = WHEEL
    formula: ClassVar[str] = "N += grip/(1 + (N/100)²)"
    parameters: ClassVar[dict[str, Parameter]] = {"grip": Parameter("N", linear=True)}

    def __call__(self, signal, state=None):
        return self.grip / (1 + (signal / 100) ** 2)


class SlickPatch(laws.AbstractRolling):
    """A patch that drags with the speeds and the root of the load."""

    oil: Float[Array, ""]

    id: ClassVar[str] = "slick-patch"
    places: ClassVar[tuple[str, ...]] = ("wheel", "all", "sphere")
    formula: ClassVar[str] = "torques: oil sqrt(N) (roll, spin / 2, roll / 10)"
    parameters: ClassVar[dict[str, Parameter]] = {"oil": Parameter("m s N^0.5", linear=True)}

    def __call__(self, signal, state=None):
        size = self.oil * jnp.sqrt(signal.normal_force)
        return laws.RollingTorque(
            size * signal.roll, size * signal.spin / 2, size * signal.roll / 10
        )


class SideWind(laws.AbstractBody):
    """A torque in the room, and one that is fixed to the sphere and grows with its speed."""

    push: Float[Array, ""]
    axis: Float[Array, "3"]

    id: ClassVar[str] = "side-wind"
    places: ClassVar[tuple[str, ...]] = ("sphere",)
    formula: ClassVar[str] = "torque += push (axis + |Ω| Q axis)"
    parameters: ClassVar[dict[str, Parameter]] = {
        "push": Parameter("N m", linear=True),
        "axis": Parameter("1", shape=3),
    }

    def __call__(self, signal, state=None):
        omega = signal.angular_velocity
        fixed = signal.rotation @ self.axis
        return self.push * (self.axis + jnp.sqrt(omega @ omega + 1e-12) * fixed)


class Chirp(laws.AbstractPlatform):
    """A floor whose vibration becomes faster."""

    size: Float[Array, ""]
    sweep: Float[Array, ""]

    id: ClassVar[str] = "chirp"
    places: ClassVar[tuple[str, ...]] = ("platform",)
    formula: ClassVar[str] = "platform acceleration += size sin(sweep t²) (1, 0.5, 2)"
    parameters: ClassVar[dict[str, Parameter]] = {
        "size": Parameter("m/s^2", linear=True),
        "sweep": Parameter("1/s^2"),
    }

    def __call__(self, signal, state=None):
        return self.size * jnp.sin(self.sweep * signal**2) * jnp.array([1.0, 0.5, 2.0])


class FlatSpot(laws.AbstractShape):
    """A smooth flat on a wheel."""

    depth: Float[Array, ""]
    place: Float[Array, ""]

    id: ClassVar[str] = "flat-spot"
    places: ClassVar[tuple[str, ...]] = WHEEL
    formula: ClassVar[str] = "rho -= depth exp(4 (cos(θ - place) - 1))"
    parameters: ClassVar[dict[str, Parameter]] = {
        "depth": Parameter("m", linear=True),
        "place": Parameter("rad"),
    }

    def __call__(self, signal, gap=None, state=None):
        return -self.depth * jnp.exp(4 * (jnp.cos(signal - self.place) - 1))


class Pear(laws.AbstractSurface):
    """A sphere that is a little of a pear."""

    pear: Float[Array, ""]

    id: ClassVar[str] = "pear"
    places: ClassVar[tuple[str, ...]] = ("sphere",)
    formula: ClassVar[str] = "R += pear (5 z³ - 3 z)/2"
    parameters: ClassVar[dict[str, Parameter]] = {"pear": Parameter("m", linear=True)}

    def __call__(self, signal, state=None):
        z = signal[2]
        return self.pear * (5 * z**3 - 3 * z) / 2
