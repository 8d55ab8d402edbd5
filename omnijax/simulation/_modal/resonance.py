"""How pairs of poles follow sinusoids.

The response of a pole to a unit of rho, dz/dt = lambda z + rho, has a part that moves with a
sinusoid of rate nu.  As d2rho/dt2 = -nu^2 rho, that part is made of rho and its slope alone:

    z = -(lambda rho + drho/dt)/(lambda^2 + nu^2)
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp

from ._poles import PolePairs
from .arithmetic import Pair, materialised, product, quotient


class Resonance(NamedTuple):
    """Lag of pairs of poles behind sinusoids, by level and slope; batch last."""

    level: Pair  # lambda/(lambda^2 + nu^2)
    slope: Pair  # 1/(lambda^2 + nu^2)

    def lag(self, level, slope) -> Pair:
        """-z of sinusoids with this level and slope."""
        first, second = (x * level + y * slope for x, y in zip(*self, strict=True))
        return first, second


def resonance(m: PolePairs, rate, b: Pair | None = None) -> Resonance:
    """Of pairs and sinusoids, for b units of rho or one; `rate` (rad/s) with an axis for pairs."""

    def both(kind, l0, l1, rate, *b):
        pole = l0, l1
        square, flat = product(kind, pole, pole), jnp.where(kind > 0, 0.0, 1.0)
        unit = b or (jnp.ones_like(l0), flat)
        slope = quotient(kind, unit, (square[0] + rate * rate, square[1] + flat * rate * rate))
        return [jax.lax.complex(*x) for x in (product(kind, slope, pole), slope)]

    level, slope = materialised(both, m.kind, m.l0, m.l1, rate, *(b or ()))
    return Resonance((level.real, level.imag), (slope.real, slope.imag))


def by_pole(kind, r: Resonance) -> Resonance:
    """Derivative of a unit's resonance by the pole."""
    square, across = product(kind, r.level, r.level), product(kind, r.level, r.slope)
    level = r.slope[0] - 2 * square[0], r.slope[1] - 2 * square[1]
    return Resonance(level, (-2 * across[0], -2 * across[1]))


def by_rate(kind, r: Resonance, rate) -> Resonance:
    """Derivative of a unit's resonance by the rate of the sinusoid."""
    level, slope = (product(kind, x, r.slope) for x in r)
    return Resonance(*((-2 * rate * x[0], -2 * rate * x[1]) for x in (level, slope)))
