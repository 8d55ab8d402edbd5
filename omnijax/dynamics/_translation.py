"""Translation of sphere, wheels and platform: a linear system with port inputs (eqs. 32-42).

State: approach x (coupled: the vector dR; paper: r_i . dR contact by contact), mount deflections,
and shifted momenta relative to the uniform motion of the centre of mass,

    p  = M_s (V_s - U) - sum C_i rho_i r_i          pi_i = m_i (u_i - r_i . U) + C_i rho_i

so that only rho enters, neither its rate nor its acceleration (spec section 2).
U is the centre of mass's velocity: M_T dU/dt = P + M_p a_floor with every other force internal.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._errors import InputError, did_you_mean
from ..rig import Rig
from ._small import solve


class PortInputs(NamedTuple):
    """What acts on the elastic model at its ports."""

    shape: Float[Array, " n"]  # m, rho
    contact: Float[Array, " n"]  # N, contact tension beside K delta + C d(delta)/dt
    mount: Float[Array, " n"]  # N, mount tension beside k Delta + c d(Delta)/dt
    drive: Float[Array, " n"]  # N, f on the sphere along `drive`
    force: Float[Array, "3"]  # N, P on the platform
    floor: Float[Array, "3"]  # m/s^2, acceleration added to the platform

    @classmethod
    def zeros(cls, n: int) -> "PortInputs":
        """No input, for `n` wheels."""
        one, vector = jnp.zeros(n), jnp.zeros(3)
        return cls(one, one, one, one, vector, vector)


class ElasticState(NamedTuple):
    """State of the elastic model; see the module's text."""

    approach: Float[Array, " d"]  # m, dR (coupled, d = 3) or r_i . dR (paper, d = n)
    mount: Float[Array, " n"]  # m, Delta
    momentum: Float[Array, " d"]  # N s, p
    wheel_momentum: Float[Array, " n"]  # N s, pi


class Motion(NamedTuple):
    """Deflections and rates that follow from state and shape, none with the shape's rate."""

    displacement: Float[Array, "3"]  # m, dR
    velocity: Float[Array, "3"]  # m/s, d(dR)/dt
    approach: Float[Array, " n"]  # m, r_i . dR
    approach_rate: Float[Array, " n"]  # m/s
    mount: Float[Array, " n"]  # m, Delta
    mount_rate: Float[Array, " n"]  # m/s
    deflection: Float[Array, " n"]  # m, delta = r.dR - Delta - rho
    platform: Float[Array, "3"]  # m/s, platform velocity relative to the centre of mass


class AbstractTranslation(eqx.Module):
    """Elastic model of one rig, linear in (state, inputs)."""

    rig: eqx.AbstractVar[Rig]

    def rest(self) -> ElasticState:
        """The state of a machine at its preloaded rest, on a roller."""
        raise NotImplementedError

    def still(self, approach, mount, shape: Float[Array, " n"]) -> ElasticState:
        """The state with these deflections in which nothing moves."""
        raise NotImplementedError

    def motion(self, state: ElasticState, shape: Float[Array, " n"]) -> Motion:
        """Deflections and rates."""
        raise NotImplementedError

    def rate(self, state: ElasticState, inputs: PortInputs) -> ElasticState:
        """Time derivative of the state."""
        raise NotImplementedError

    def platform_acceleration(self, state: ElasticState, inputs: PortInputs):
        """Acceleration of the platform in m/s^2, inertial frame."""
        raise NotImplementedError

    def drift_acceleration(self, inputs: PortInputs) -> Float[Array, "3"]:
        """Acceleration of the centre of mass, dU/dt, m/s^2."""
        raise NotImplementedError

    def tension(self, motion: Motion) -> Float[Array, " n"]:
        """Linear contact tension without the shape's rate: K delta + C (x' - Delta'), N."""
        contact = self.rig.wheels.contact
        rate = motion.approach_rate - motion.mount_rate
        return contact.stiffness * motion.deflection + contact.damping * rate

    def mount_tension(self, motion: Motion) -> Float[Array, " n"]:
        """Linear mount tension k Delta + c Delta', N."""
        mount = self.rig.wheels.mount
        return mount.stiffness * motion.mount + mount.damping * motion.mount_rate


class Coupled(AbstractTranslation):
    """One Lagrangian system: every internal force acts on both bodies (the default)."""

    rig: Rig

    def rest(self):
        n = self.rig.size
        return ElasticState(jnp.zeros(3), jnp.zeros(n), jnp.zeros(3), jnp.zeros(n))

    def still(self, approach, mount, shape):
        shift = self.rig.wheels.contact.damping * shape
        return ElasticState(approach, mount, -self.rig.wheels.normal.T @ shift, shift)

    def _platform_mass(self) -> Float[Array, "3 3"]:
        """M_l 1 + sum m_i (1 - r_i r_i^T): what moves with the platform, kg."""
        wheels = self.rig.wheels
        across = jnp.eye(3) - wheels.normal[:, :, None] * wheels.normal[:, None, :]
        return self.rig.platform.mass * jnp.eye(3) + jnp.sum(
            wheels.mass[:, None, None] * across, axis=0
        )

    def motion(self, state, shape):
        wheels, normal = self.rig.wheels, self.rig.wheels.normal
        shift = wheels.contact.damping * shape
        sphere = (state.momentum + normal.T @ shift) / self.rig.sphere.mass
        wheel = (state.wheel_momentum - shift) / wheels.mass
        momentum = -state.momentum - normal.T @ state.wheel_momentum
        platform = solve(self._platform_mass(), momentum)
        velocity = sphere - platform
        approach = normal @ state.approach
        return Motion(
            displacement=state.approach,
            velocity=velocity,
            approach=approach,
            approach_rate=normal @ velocity,
            mount=state.mount,
            mount_rate=wheel - normal @ platform,
            deflection=approach - state.mount - shape,
            platform=platform,
        )

    def rate(self, state, inputs):
        wheels, normal = self.rig.wheels, self.rig.wheels.normal
        motion = self.motion(state, inputs.shape)
        drift = self.drift_acceleration(inputs)
        tension = self.tension(motion) + inputs.contact
        mount = self.mount_tension(motion) + inputs.mount
        closure = wheels.closure.stiffness * motion.approach
        sphere = wheels.drive.T @ inputs.drive - normal.T @ (tension + closure)
        return ElasticState(
            approach=motion.velocity,
            mount=motion.mount_rate,
            momentum=sphere - self.rig.sphere.mass * drift,
            wheel_momentum=tension - mount - wheels.mass * (normal @ drift),
        )

    def drift_acceleration(self, inputs):
        external = inputs.force + self._platform_mass() @ inputs.floor
        return external / self.rig.total_mass

    def platform_acceleration(self, state, inputs):
        wheels, normal = self.rig.wheels, self.rig.wheels.normal
        motion = self.motion(state, inputs.shape)
        mount = self.mount_tension(motion) + inputs.mount
        closure = wheels.closure.stiffness * motion.approach
        force = inputs.force + normal.T @ (mount + closure) - wheels.drive.T @ inputs.drive
        return solve(self._platform_mass(), force) + inputs.floor


class Paper(AbstractTranslation):
    """Eqs. 41-42 contact by contact, dR = sum (Delta_i + rho_i + delta_i) r_i (eq. 34).

    No reaction on the platform, whose acceleration is P/M_T plus the floor's, and no wheel inertia
    in its frame.  Equals `Coupled` only for orthonormal normals with a heavy platform.
    """

    rig: Rig

    def rest(self):
        zero = jnp.zeros(self.rig.size)
        return ElasticState(zero, zero, zero, zero)

    def still(self, approach, mount, shape):
        shift = self.rig.wheels.contact.damping * shape
        return ElasticState(approach, mount, -shift, shift)

    def motion(self, state, shape):
        wheels, normal = self.rig.wheels, self.rig.wheels.normal
        shift = wheels.contact.damping * shape
        rate = (state.momentum + shift) / self.rig.sphere.mass
        return Motion(
            displacement=normal.T @ state.approach,
            velocity=normal.T @ rate,
            approach=state.approach,
            approach_rate=rate,
            mount=state.mount,
            mount_rate=(state.wheel_momentum - shift) / wheels.mass,
            deflection=state.approach - state.mount - shape,
            platform=jnp.zeros(3),
        )

    def rate(self, state, inputs):
        wheels = self.rig.wheels
        motion = self.motion(state, inputs.shape)
        tension = self.tension(motion) + inputs.contact
        closure = wheels.closure.stiffness * motion.approach
        inertial = self.rig.sphere.mass * wheels.normal @ self.drift_acceleration(inputs)
        return ElasticState(
            approach=motion.approach_rate,
            mount=motion.mount_rate,
            momentum=-tension - closure - inertial,
            wheel_momentum=tension - self.mount_tension(motion) - inputs.mount,
        )

    def drift_acceleration(self, inputs):
        return inputs.force / self.rig.total_mass + inputs.floor

    def platform_acceleration(self, state, inputs):
        return self.drift_acceleration(inputs)


TRANSLATIONS: dict[str, type[AbstractTranslation]] = {"coupled": Coupled, "paper": Paper}


def check_model(model: str) -> None:
    """`InputError` for a name that is no variant of the equations."""
    if model not in TRANSLATIONS:
        hint = did_you_mean(model, TRANSLATIONS)
        names = ", ".join(TRANSLATIONS)
        raise InputError(f"`model` must be one of {names}, but is {model!r}.{hint}")


class LinearSystem(NamedTuple):
    """dy/dt = A y + B u, out = C y + D u over the flattened state and `PortInputs`.

    Rows of `C` and `D` are the fields of `Motion` in order; `inputs` and `outputs` give the
    slice of each named field.
    """

    A: Float[Array, "m m"]
    B: Float[Array, "m u"]
    C: Float[Array, "o m"]
    D: Float[Array, "o u"]
    inputs: dict[str, slice]
    outputs: dict[str, slice]

    def into(self, port: str) -> Float[Array, "m k"]:
        """Columns of B that belong to one port."""
        return self.B[:, self.inputs[port]]

    def row(self, output: str) -> tuple[Float[Array, "k m"], Float[Array, "k u"]]:
        """Rows of (C, D) of one output."""
        return self.C[self.outputs[output]], self.D[self.outputs[output]]


def flatten(parts: tuple) -> Float[Array, " m"]:
    """The fields of a state or input one after the other."""
    return jnp.concatenate([jnp.atleast_1d(part) for part in parts])


def unflatten(like, vector):
    """`vector` as the named tuple `like`."""
    out, start = [], 0
    for part in like:
        size = jnp.size(part)
        out.append(vector[start : start + size].reshape(jnp.shape(part)))
        start += size
    return type(like)(*out)


def _slices(parts) -> dict[str, slice]:
    out, start = {}, 0
    for name, part in zip(parts._fields, parts, strict=True):
        out[name] = slice(start, start + jnp.size(part))
        start += jnp.size(part)
    return out


def linear_system(translation: AbstractTranslation) -> LinearSystem:
    """Matrices of the elastic model, read off its own formulas by differentiation (exact: linear).

    Outputs are those of `Motion`, then `acceleration` of the platform (3).
    """
    state, inputs = translation.rest(), PortInputs.zeros(translation.rig.size)
    y0, u0 = flatten(state), flatten(inputs)

    def rate(y, u):
        return flatten(translation.rate(unflatten(state, y), unflatten(inputs, u)))

    def output(y, u):
        y, u = unflatten(state, y), unflatten(inputs, u)
        return jnp.concatenate(
            [flatten(translation.motion(y, u.shape)), translation.platform_acceleration(y, u)]
        )

    A, B = jax.jacfwd(rate, argnums=(0, 1))(y0, u0)
    C, D = jax.jacfwd(output, argnums=(0, 1))(y0, u0)
    motion = translation.motion(state, inputs.shape)
    outputs = _slices(motion)
    end = outputs["platform"].stop
    return LinearSystem(
        A, B, C, D, _slices(inputs), outputs | {"acceleration": slice(end, end + 3)}
    )


def free_system(
    translation: AbstractTranslation,
) -> tuple[Float[Array, "m m"], Float[Array, "3 m"]]:
    """A of `linear_system` and its row of the displacement: a third of that program to compile."""
    state, inputs = translation.rest(), PortInputs.zeros(translation.rig.size)

    def both(y):
        y = unflatten(state, y)
        moved = translation.motion(y, inputs.shape).displacement
        return flatten(translation.rate(y, inputs)), moved

    return jax.jacfwd(both)(flatten(state))
