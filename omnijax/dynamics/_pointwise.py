"""Eqs. 41-42 as printed, with d2(r_w)/dt2 evaluated point by point: for comparison only.

    M_s (delta'' + Delta'' + r_w'') = -K delta - C delta' - s K' (delta + Delta) - M_s r.R_l''
    m Delta''                       =  K delta + C delta' - k Delta - c Delta'

r_w'' holds an impulse at every gap edge, which an evaluation at points never meets, so deflections
and dR that follow from it are wrong (spec section 6).  s = 1 holds the sphere, s = -1 is the
printed sign of eq. 41, which pushes it away.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..rig import Rig
from ._kinematics import wheel_shape


class Pointwise(eqx.Module):
    """The printed form of one rig, contact by contact; state (delta, Delta, delta', Delta')."""

    rig: Rig
    closure_sign: int = eqx.field(static=True, default=1)

    def rate(self, state: Float[Array, "4 n"], shape_acceleration: Float[Array, " n"]):
        """Time derivative of the state, one column a contact, under r_w'' (m/s^2), no force P."""
        wheels = self.rig.wheels
        contact, mount, mass = wheels.contact, wheels.mount, self.rig.sphere.mass
        deflection, wheel, deflection_rate, wheel_rate = state
        tension = contact.stiffness * deflection + contact.damping * deflection_rate
        closure = self.closure_sign * wheels.closure.stiffness * (deflection + wheel)
        wheel_acceleration = (
            tension - mount.stiffness * wheel - mount.damping * wheel_rate
        ) / wheels.mass
        acceleration = -(tension + closure) / mass - wheel_acceleration - shape_acceleration
        return jnp.stack([deflection_rate, wheel_rate, acceleration, wheel_acceleration])

    def matrices(self) -> tuple[Float[Array, "n 4 4"], Float[Array, "n 4"]]:
        """A and b of each contact: dy/dt = A y + b r_w''."""
        n = self.rig.size
        A, b = jax.jacfwd(self.rate, argnums=(0, 1))(jnp.zeros((4, n)), jnp.zeros(n))
        own = jnp.arange(n)
        return A[:, own, :, own], b[:, own, own].T


def pointwise_shape_acceleration(
    rig: Rig, angle: Float[Array, " n"], speed: Float[Array, " n"]
) -> Float[Array, " n"]:
    """omega^2 d2(rho)/d(theta)^2 in m/s^2 as an evaluation at points gives it: no impulses."""

    def slope(a):
        return jax.jvp(lambda x: wheel_shape(rig, x), (a,), (jnp.ones_like(a),))[1]

    return jax.jvp(slope, (angle,), (jnp.ones_like(angle),))[1] * speed**2
