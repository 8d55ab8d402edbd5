"""Mean squares of the periodic motion: integrals of products of exponentials from their ends.

With z = y exp(lam t) and its value y' at the piece's end, the integral of z_m z_n over the piece is
(y_m y_n - y_m' y_n')/(-(lam_m + lam_n)), in the algebra of both pairs' units.  A sinusoid is such a
pair too (u = 0, D = -rate^2); what has no free part is smooth, and a Gauss rule is exact for it.
"""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from .contact import Poles
from .materialise import stage
from .periodic import Motion, Pairing
from .pole_pair import Pair, inverse, sincos, stored_sincos, times
from .product import Product, form, product_inverse

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(20)
LEAST_DECAY = 1e-9  # of the pole's size, where the mean square of an undamped mode would diverge


def _kernel(u, D, G) -> Product:
    """1/(-(lam + mu)) for lam = u + j over D and mu = j' over G (the real parts are in u)."""
    one = jnp.ones_like(u)
    return product_inverse(Pair(-u, -one), Pair(-one, 0 * one), D, G)


def _pick(x, *index):
    return jax.tree.map(lambda v: v[index], x)


def _free_part(lam: Poles, free: Pair, last: Pair):
    """Integral of the free part's square over each piece, (k, p, c)."""
    total = 0.0
    count = lam.u.shape[0]
    for m in range(count):
        for n in range(m, count):
            kernel = _kernel(lam.u[m] + lam.u[n], lam.D[m], lam.D[n])
            for sign, z in ((1.0, free), (-1.0, last)):
                a, b = (Pair(z.u[:, i], z.v[:, i]) for i in (m, n))
                total = total + sign * (1.0 if m == n else 2.0) * form(a, b, kernel)
    return total


def _cross_part(lam: Poles, free: Pair, last: Pair, still, across, along, rate, phase):
    """Twice the integral of the free part times the rest over one piece, (p, c)."""
    root = Pair(lam.u, jnp.ones_like(lam.u))
    gone = Pair(last.u - free.u, last.v - free.v)
    total = still * jnp.sum(times(gone, inverse(root, lam.D), lam.D).v, axis=0)
    for a, b, nu, s, c in zip(across, along, rate, *phase, strict=True):
        begin, end = Pair(nu * b, a), Pair(nu * (b * c - a * s), a * c + b * s)
        for m in range(lam.u.shape[0]):
            kernel = _kernel(lam.u[m], lam.D[m], -(nu**2))
            total = total + form(_pick(free, m), begin, kernel) - form(_pick(last, m), end, kernel)
    return 2 * total


def _smooth_part(still, across, along, rate, duration):
    """Integral of the square of all but the free part over one piece."""
    v = jnp.asarray((1 + _NODES) / 2)[:, None, None]
    x = jnp.broadcast_to(still, (len(_NODES), *still.shape))
    for a, b, nu in zip(across, along, rate, strict=True):
        s, c = sincos(nu * duration * v)
        x = x + a * c + b * s
    return duration * jnp.sum(jnp.asarray(_WEIGHTS / 2)[:, None, None] * x * x, axis=0)


def mean_square(m: Motion, layout: Pairing) -> Array:
    """Mean of x^2 of every pair over its period, (p, c)."""
    least = -LEAST_DECAY * jnp.sqrt(jnp.abs(m.lam.D))
    lam = Poles(jnp.minimum(m.lam.u, least), m.lam.D)
    phase = [[stored_sincos(nu * m.duration[k]) for nu in rates] for k, rates in enumerate(m.rate)]

    def integral(m: Motion, lam: Poles, phase):
        total = jnp.sum(_free_part(lam, m.free, m.last), axis=0)
        for k in range(len(layout.waves)):
            waves = (m.across[k], m.along[k], m.rate[k])
            s, c = [x[0] for x in phase[k]], [x[1] for x in phase[k]]
            ends = _pick(m.free, k), _pick(m.last, k)
            total = total + _cross_part(lam, *ends, m.still[k], *waves, (s, c))
            total = total + _smooth_part(m.still[k], *waves, m.duration[k])
        return total / jnp.sum(m.duration, axis=0)

    return stage(integral)(m, lam, phase)
