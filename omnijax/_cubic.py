"""Peaks between samples, from values and rates at both ends."""

import jax
import jax.numpy as jnp

MOST = 2.0  # a squared vibration by its largest sample, where one oscillation has four of them


def cubic_peak(y0, y1, d0, d1):
    """Largest value of a cubic of ends y0, y1 and rates d0, d1 on [0, 1], at its inner maximum.

    y0 where it has none.  The derivative is that at the maximum's own place (envelope theorem).
    y is the square of a vibration; where samples are too far apart for it, the cubic knows no
    bounds, and the peak between them is `MOST` of the larger end.
    """
    c2, c3 = 3 * (y1 - y0) - 2 * d0 - d1, 2 * (y0 - y1) + d0 + d1
    u = crossing(d0, c2, c3)
    u = jax.lax.stop_gradient(jnp.where((u > 0) & (u < 1), u, 0.0))
    return jnp.minimum(y0 + u * (d0 + u * (c2 + u * c3)), MOST * jnp.maximum(y0, y1))


def crossing(c1, c2, c3):
    """Where c1 + 2 c2 u + 3 c3 u^2 crosses zero downwards (0 where it does not)."""
    root = jnp.sqrt(jnp.maximum(c2 * c2 - 3 * c3 * c1, 0.0))
    up = c2 > 0  # the place is c1/(root - c2) = -(c2 + root)/(3 c3): the one without cancellation
    above, below = jnp.where(up, -(c2 + root), c1), jnp.where(up, 3 * c3, root - c2)
    some = below != 0
    return jnp.where(some, above / jnp.where(some, below, 1.0), 0.0)
