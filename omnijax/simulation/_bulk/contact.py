"""One contact as two pole pairs: closed forms of the four-state system, for many designs at once.

In the direction of one normal, with a = 1/M_s, b = 1/m, g = 1/M_p (M_p the platform's mass there;
g = 0 in the `paper` variant), kappa = K + C s, sigma = k + c s and h = ab + ag + bg,

    x/rho     = kappa (a s^2 + h sigma)/q        x/force     = ((a + g) s^2 + h (kappa + sigma))/q
    Delta/rho = -kappa (b s^2 + h K')/q          Delta/force = (g s^2 + h kappa)/q
    q(s)    = s^4 + a3 s^3 + a2 s^2 + a1 s + a0 = (s^2 + b1 s + c1)(s^2 + b2 s + c2)

Batch last everywhere.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .pole_pair import Pair, inverse, polynomial, times


class Contact(NamedTuple):
    """Parameters of the contacts (leading axis: the direction), SI units."""

    sphere: Float[Array, "a c"]  # 1/kg, a
    wheel: Float[Array, "a c"]  # 1/kg, b
    platform: Float[Array, "a c"]  # 1/kg, g
    stiffness: Float[Array, "a c"]  # K
    damping: Float[Array, "a c"]  # C
    mount: Float[Array, "a c"]  # k
    mount_damping: Float[Array, "a c"]  # c
    closure: Float[Array, "a c"]  # K'


class Poles(NamedTuple):
    """The two pole pairs (leading axis 2): poles are u +- sqrt(D)."""

    u: Float[Array, "2 a c"]
    D: Float[Array, "2 a c"]


def _quartic(p: Contact):
    """Coefficients a0 .. a3 and h."""
    a, b, g = p.sphere, p.wheel, p.platform
    h = a * b + a * g + b * g
    K, C, k, c, Kc = p.stiffness, p.damping, p.mount, p.mount_damping, p.closure
    a3 = a * C + b * C + (b + g) * c
    a2 = a * K + (a + g) * Kc + b * K + (b + g) * k + h * c * C
    a1 = h * (k * C + c * K + Kc * (C + c))
    return h * (K * k + Kc * (K + k)), a1, a2, a3, h


def _resolvent(a0, a1, a2, a3):
    """Largest root y = c1 + c2 of the resolvent cubic, by Newton's method from above.

    Where two complex roots lie above the only real one Newton's method may never come down to it;
    there the root is Cardano's.  The last step alone is differentiated: at the root it has the
    root's derivative.
    """
    B1, B2, B3 = -a2, a1 * a3 - 4 * a0, -(a1 * a1 + a0 * a3 * a3 - 4 * a0 * a2)

    def newton(y, B1, B2, B3):
        return y - (((y + B1) * y + B2) * y + B3) / ((3 * y + 2 * B1) * y + B2)

    fixed = jax.lax.stop_gradient((B1, B2, B3))
    bound = jnp.maximum(jnp.sqrt(jnp.abs(fixed[1])), jnp.cbrt(jnp.abs(fixed[2])))
    y = 2 * jnp.maximum(jnp.abs(fixed[0]), bound)
    y = jax.lax.fori_loop(0, 40, lambda _, y: newton(y, *fixed), y)
    arrived = jnp.abs(newton(y, *fixed) - y) <= 1e-6 * jnp.abs(y)
    y = jnp.where(arrived, y, newton(_only_root(*fixed), *fixed))
    return newton(jax.lax.stop_gradient(y), B1, B2, B3)


def _only_root(B1, B2, B3):
    """The real root of y^3 + B1 y^2 + B2 y + B3 that has only one (Cardano)."""
    p, q = B2 / 3 - B1**2 / 9, B1**3 / 27 - B1 * B2 / 6 + B3 / 2
    A = jnp.cbrt(-q - jnp.where(q > 0, 1.0, -1.0) * jnp.sqrt(jnp.maximum(q * q + p**3, 0.0)))
    return A - p / jnp.where(A == 0, 1.0, A) - B1 / 3


def _root(x):
    return jnp.sqrt(jnp.maximum(x, 1e-300))


def poles(p: Contact) -> Poles:
    """The two real quadratic factors of the quartic, as pole pairs."""
    a0, a1, a2, a3, _ = _quartic(p)
    y = _resolvent(a0, a1, a2, a3)
    c1 = y / 2 + _root(y * y / 4 - a0)
    c2 = a0 / c1
    b1 = a3 / 2 + _root(a3 * a3 / 4 - a2 + y)
    b2 = (a2 - y) / b1
    swap = jnp.abs(b1 * c2 + b2 * c1 - a1) > jnp.abs(b1 * c1 + b2 * c2 - a1)
    b = jnp.stack([jnp.where(swap, b2, b1), jnp.where(swap, b1, b2)])
    c = jnp.stack([c1, c2])
    return Poles(-b / 2, b * b / 4 - c)


def approach(p: Contact, own, coupling) -> list:
    """Numerator of x: `own` is 1 where the shape is the contact's own, `coupling` the drive force
    along the direction per drho/dt."""
    _, _, _, _, h = _quartic(p)
    a, g = p.sphere, p.platform
    K, C, k, c = p.stiffness, p.damping, p.mount, p.mount_damping
    n0 = own * h * K * k
    n1 = own * h * (K * c + C * k) + coupling * h * (K + k)
    n2 = own * (a * K + h * C * c) + coupling * h * (C + c)
    return [n0, n1, n2, own * a * C + coupling * (a + g)]


def deflection(p: Contact, own, coupling) -> list:
    """Numerator of the mount's deflection, from the shape and from the drive force."""
    _, _, _, _, h = _quartic(p)
    b, g, K, C, rest = p.wheel, p.platform, p.stiffness, p.damping, p.closure
    n1 = coupling * h * K - own * h * C * rest
    return [-own * h * K * rest, n1, coupling * h * C - own * b * K, coupling * g - own * b * C]


def residues(roots: Poles, numerator: list) -> Pair:
    """N(lambda)/q_other(lambda): weights of the shape in each pair, (2, pairs, c)."""
    lam = Pair(roots.u, jnp.ones_like(roots.u))
    other = Poles(roots.u[::-1], roots.D[::-1])
    below = polynomial([other.u**2 - other.D, -2 * other.u, 1.0], lam, roots.D)
    return times(polynomial(numerator, lam, roots.D), inverse(below, roots.D), roots.D)
