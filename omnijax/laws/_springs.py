"""Contact and mount laws: cubic and Hertz springs, relaxation, lift-off, backlash, dry friction."""

from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from ._base import Parameter
from ._ports import AbstractContact, AbstractMount, AbstractSeparation

_WHEELS = ("wheel", "all")


class ContactCubic(AbstractContact):
    """Contact tension += K3 delta^3."""

    K3: Float[Array, ""]

    id: ClassVar[str] = "contact-cubic"
    words: ClassVar[str] = "a contact that stiffens or softens"
    places: ClassVar[tuple[str, ...]] = _WHEELS
    formula: ClassVar[str] = "contact tension += K₃ δ³"
    parameters: ClassVar[dict[str, Parameter]] = {"K3": Parameter("N/m^3", linear=True)}

    def __call__(self, signal, state=None):
        return self.K3 * signal.deflection**3


class ContactHertz(AbstractContact):
    """K delta becomes N0 - c (d0 - delta)+^p, d0 = p N0/K, c = N0/d0^p (eq. 15, p = 1.5).

    The tangent at the preload is K, so there is no free size; `modulus` E' = 0.75 c/sqrt(R') is
    a report of it and does not enter the force.
    """

    exponent: Float[Array, ""] = 1.5  # pyright: ignore[reportAssignmentType]
    modulus: Float[Array, ""] | None = None

    id: ClassVar[str] = "contact-hertz"
    words: ClassVar[str] = "a Hertzian contact"
    places: ClassVar[tuple[str, ...]] = _WHEELS
    formula: ClassVar[str] = "K δ becomes N0 − c (d0 − δ)₊^1.5, d0 = 1.5 N0/K, c = N0/d0^1.5"
    source: ClassVar[str] = "eq. 15"
    parameters: ClassVar[dict[str, Parameter]] = {
        "exponent": Parameter("1", low=1, optional=True),
        "modulus": Parameter("Pa", low=0, optional=True),
    }

    def __call__(self, signal, state=None):
        reach = self.exponent * signal.preload / signal.stiffness
        left = 1 - signal.deflection / reach
        touching = left > 0
        # exp and log are vectorised where a power calls libm once per number
        power = jnp.exp(self.exponent * jnp.log(jnp.where(touching, left, 1.0)))
        force = signal.preload * power
        nonlinear = signal.preload - jnp.where(touching, force, 0.0)
        return nonlinear - signal.stiffness * signal.deflection

    def effective_modulus(self, signal) -> Float[Array, ""]:
        """E' = 0.75 c / sqrt(R') in Pa."""
        reach = self.exponent * signal.preload / signal.stiffness
        return 0.75 * signal.preload / reach**1.5 / jnp.sqrt(signal.curvature_radius)


class ContactRelaxation(AbstractContact):
    """Contact tension += K1 (delta - z), dz/dt = (delta - z)/tau: a Maxwell branch."""

    K1: Float[Array, ""]
    tau: Float[Array, ""]

    id: ClassVar[str] = "contact-relaxation"
    words: ClassVar[str] = "a contact that relaxes (viscoelastic)"
    linear: ClassVar[bool] = True
    places: ClassVar[tuple[str, ...]] = _WHEELS
    formula: ClassVar[str] = "contact tension += K₁(δ − z), ż = (δ − z)/τ"
    parameters: ClassVar[dict[str, Parameter]] = {
        "K1": Parameter("N/m", low=0, linear=True),
        "tau": Parameter("s", low=0, above=True),
    }

    def __call__(self, signal, state=None):
        return self.K1 * (signal.deflection - (0.0 if state is None else state))

    def initial(self):
        return jnp.zeros(())

    def rate(self, signal, state):
        return (signal.deflection - state) / self.tau


class LiftOff(AbstractSeparation):
    """N becomes max(0, N) on both bodies."""

    id: ClassVar[str] = "lift-off"
    words: ClassVar[str] = "lift-off of the sphere from the wheel"
    places: ClassVar[tuple[str, ...]] = _WHEELS
    formula: ClassVar[str] = "N = max(0, N) on both bodies"

    def __call__(self, signal, state=None):
        return jnp.maximum(-signal, 0.0)


class MountCubic(AbstractMount):
    """Mount tension += k3 Delta^3."""

    k3: Float[Array, ""]

    id: ClassVar[str] = "mount-cubic"
    words: ClassVar[str] = "a mount that stiffens or softens"
    places: ClassVar[tuple[str, ...]] = _WHEELS
    formula: ClassVar[str] = "mount tension += k₃ Δ³"
    parameters: ClassVar[dict[str, Parameter]] = {"k3": Parameter("N/m^3", linear=True)}

    def __call__(self, signal, state=None):
        return self.k3 * signal.deflection**3


class MountBacklash(AbstractMount):
    """k Delta becomes k sign(Delta) max(|Delta| - b, 0): tension += -k clip(Delta, -b, b)."""

    gap: Float[Array, ""]

    id: ClassVar[str] = "mount-backlash"
    words: ClassVar[str] = "play in the mount"
    places: ClassVar[tuple[str, ...]] = _WHEELS
    formula: ClassVar[str] = "k Δ becomes k sign(Δ) max(|Δ| − b, 0)"
    parameters: ClassVar[dict[str, Parameter]] = {"gap": Parameter("m", low=0)}

    def __call__(self, signal, state=None):
        return -signal.stiffness * jnp.clip(signal.deflection, -self.gap, self.gap)


class MountFriction(AbstractMount):
    """Mount tension += F tanh(d(Delta)/dt / v0)."""

    force: Float[Array, ""]
    width: Float[Array, ""] = 1e-3  # pyright: ignore[reportAssignmentType]

    id: ClassVar[str] = "mount-friction"
    words: ClassVar[str] = "dry friction in the mount"
    places: ClassVar[tuple[str, ...]] = _WHEELS
    formula: ClassVar[str] = "mount tension += F tanh(Δ̇/v₀)"
    parameters: ClassVar[dict[str, Parameter]] = {
        "force": Parameter("N", low=0, linear=True),
        "width": Parameter("m/s", low=0, above=True, optional=True),
    }

    def __call__(self, signal, state=None):
        return self.force * jnp.tanh(signal.rate / self.width)
