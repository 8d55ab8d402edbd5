"""The axis: one degree of freedom, a motor, and a second inertia behind its drive where stated."""

from collections.abc import Collection, Mapping
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._compiling import quick_jit
from ..laws import BearingCoulomb, MountBacklash, MountSignal, ShaftSignal
from ._base import AbstractMachine
from ._ports import Ports

OWN = {  # field -> the effect that it is
    "damping": "bearing-viscous", "coulomb": "bearing-coulomb", "offset": "torque-offset",
}  # fmt: skip
SCALED = (  # fields that all together are a torque constant: the motion tells their ratios alone
    "inertia", "damping", "stiffness", "gravity", "coulomb", "second_inertia", "second_stiffness",
    "second_damping",
)  # fmt: skip
FORGOTTEN = 7.0  # time constants after which a start has died away to a thousandth
INPUTS = {  # input -> unit for a rotation, for a translation
    "torque": ("N m", "N"), "current": ("A", "A"), "voltage": ("V", "V"), "command": ("1", "1"),
    "goal": ("rad", "m"),
}  # fmt: skip


def _as_number(x: Any) -> Any:
    return None if x is None else jnp.asarray(x, float)


def _number(*default: Any) -> Any:
    """A field that becomes a float64 array; None stays None."""
    if not default:
        return eqx.field(converter=_as_number)
    return eqx.field(converter=_as_number, default=default[0])


class Axis(AbstractMachine):
    """J q'' = motor - damping q' - stiffness q - gravity sin(q + gravity_angle) + offset + laws.

    Motor at the axis, gear n, constant k: torque n u; current or command n k u; voltage
    n k (u - e n q')/R.  A servo makes the voltage from its goal g: U clip(p (g - q) - d q', -L, L).
    With a second inertia (state q2, q2') the drive passes on
    stiffness_2 (q - q2) + damping_2 (q' - q2'), and gravity, stiffness act on the second.
    A translation reads N for N m, kg for kg m^2, m for rad.  Units: SI.
    """

    inertia: Float[Array, ""] = _number()
    damping: Float[Array, ""] = _number(0.0)
    stiffness: Float[Array, ""] = _number(0.0)
    offset: Float[Array, ""] = _number(0.0)
    gravity: Float[Array, ""] = _number(0.0)
    gravity_angle: Float[Array, ""] = _number(0.0)
    coulomb: Float[Array, ""] = _number(0.0)
    coulomb_width: Float[Array, ""] = _number(0.05)
    motor_inertia: Float[Array, ""] = _number(0.0)  # the part of `inertia` before the gear
    torque_constant: Float[Array, ""] = _number(1.0)
    gear: Float[Array, ""] = _number(1.0)
    resistance: Float[Array, ""] = _number(1.0)
    back_emf: Float[Array, ""] | None = _number(None)  # None: the torque constant
    gain: Float[Array, ""] = _number(1.0)
    rate_gain: Float[Array, ""] = _number(0.0)
    supply: Float[Array, ""] = _number(1.0)
    limit: Float[Array, ""] = _number(1.0)
    second_inertia: Float[Array, ""] | None = _number(None)
    second_stiffness: Float[Array, ""] = _number(0.0)
    second_damping: Float[Array, ""] = _number(0.0)
    second_play: Float[Array, ""] = _number(0.0)
    drives: str = eqx.field(static=True, default="torque")
    motion: str = eqx.field(static=True, default="rotation")

    places: ClassVar[Mapping[str, tuple[str, ...]]] = {
        p: ("axis",) for p in ("shaft", "mount", "actuator", "command")
    }

    @property
    def inputs(self) -> dict[str, str]:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Inputs with units; a servo may have its gain and whether it is on as inputs too."""
        unit = INPUTS[self.drives][self.motion == "translation"]
        return {"input": unit} | ({"gain": "1", "enable": "1"} if self.drives == "goal" else {})

    @property
    def outputs(self) -> dict[str, str]:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Outputs with units."""
        unit = "m" if self.motion == "translation" else "rad"
        return {"position": unit, "velocity": f"{unit}/s"}

    def motor(self, q, v, u) -> Array:
        """Motor torque at the axis, N m."""
        n, k, given = self.gear, self.torque_constant, u["input"]
        if self.drives == "torque":
            return n * given
        if self.drives in ("current", "command"):
            return n * k * given
        on = 1.0
        if self.drives == "goal":
            duty = self.gain * u["gain"] * (given - q) - self.rate_gain * v
            given, on = self.supply * jnp.clip(duty, -self.limit, self.limit), u["enable"]
        e = k if self.back_emf is None else self.back_emf
        return on * n * k * (given - e * n * v) / self.resistance

    def friction(self, v) -> Array:
        """Friction that the model knows of, N m."""
        return -self.damping * v + BearingCoulomb(self.coulomb, self.coulomb_width)(
            ShaftSignal(v, v, v, v)
        )

    def rate(self, x, u, ports: Ports):
        """Single: q, q'; with a second inertia q, q', q2, q2'."""
        q, v = x[0], x[1]
        motor = ports.delivered("axis", self.motor(q, v, u), q, v)
        if self.second_inertia is None:
            held = self.held(q, v, ports) + self.offset
            passed = motor - self.motor_inertia / self.inertia * (motor + held)
            torque = motor + held + self.friction(v)
            return v, (
                torque + ports("shaft", "axis", ShaftSignal(q, v, motor, passed))
            ) / self.inertia
        q2, v2 = x[2], x[3]
        k, c = self.second_stiffness, self.second_damping
        twist = MountSignal(q - q2, v - v2, k, c)
        drive = k * twist.deflection + c * twist.rate + MountBacklash(self.second_play)(twist)
        drive = drive + ports("mount", "axis", twist)
        torque = motor + self.offset - drive + self.friction(v)
        first = (torque + ports("shaft", "axis", ShaftSignal(q, v, motor, drive))) / self.inertia
        held = -self.gravity * jnp.sin(q2 + self.gravity_angle) - self.stiffness * q2
        return v, first, v2, (drive + held) / self.second_inertia

    def held(self, q, v, ports: Ports) -> Array:
        """Gravity and the spring that holds the axis, with the laws on it, N m."""
        mount = MountSignal(q, v, self.stiffness, self.damping)
        spring = self.stiffness * q + ports("mount", "axis", mount)
        return -self.gravity * jnp.sin(q + self.gravity_angle) - spring

    def read(self, x, u):
        """Position and velocity of the axis."""
        return {"position": x[0], "velocity": x[1]}

    def start(self, first):
        """At rest relative to each other where there are two inertias."""
        q, v = first["position"]
        return (q, v) if self.second_inertia is None else (q, v, q, v)

    def memory(self):
        """From the slowest mode at rest; infinity for an axis that nothing pulls back."""
        return _forgotten(self._poles())

    def speed_memory(self):
        """As `memory`, of the speed: without a restoring force the position does not count."""
        poles = self._poles()
        if not float(self.stiffness) and not float(self.gravity) and self.drives != "goal":
            poles = np.delete(poles, np.argmin(np.abs(poles)))
        return _forgotten(poles)

    def _poles(self) -> np.ndarray:
        """Modes (n,) at rest, 1/s."""
        rest = jnp.zeros(2 if self.second_inertia is None else 4)
        u = {"input": jnp.zeros(()), "gain": jnp.ones(()), "enable": jnp.ones(())}

        def slopes(axis, x):
            return jax.jacfwd(lambda x: jnp.stack(jax.tree.leaves(axis.rate(x, u, Ports((), ())))))(
                x
            )

        return np.linalg.eigvals(np.asarray(quick_jit(slopes)(self, rest)))

    def stated_laws(self, uncertain: Collection[str] = ()) -> set[str]:
        """Effects that the axis has among its own numbers, stated or `uncertain`."""
        own = {i for k, i in OWN.items() if k in uncertain or float(getattr(self, k)) != 0}
        used = {k for k in SCALED if getattr(self, k) is not None and float(getattr(self, k)) != 0}
        free = used <= set(uncertain) or "torque_constant" in uncertain
        return own | {"motor-gain"} if free else own


def _forgotten(poles: np.ndarray) -> float:
    """Seconds after which all modes have died away; infinity if one of them does not decay."""
    slowest, size = float(np.max(np.real(poles))), float(np.max(np.abs(poles)))
    return FORGOTTEN / -slowest if slowest < -1e-6 * size else float("inf")
