"""The phi functions of exponential methods: phi_j(z) = int_0^1 exp((1 - u) z) u^(j-1)/(j-1)! du.

By a series of a small step and doublings, as `_exact/expm.py` squares an exponential.  The two stay
apart: here phi_1 ... phi_3 are doubled along with it and 14 doublings suit every step, there the
levels in between are kept, as a ladder to any time, and their number follows the rates.
"""

import math

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

TAYLOR = 18  # degree of the series for short steps, |h A| <= 2
PHIS = 5


def series_weights() -> np.ndarray:
    """1/(i + j)!: the power i of phi_j, j from 1."""
    rows = range(1, PHIS + 1)
    return np.array([[1 / math.factorial(i + j) for i in range(TAYLOR + 1)] for j in rows])


def powers(z: Float[Array, "m m"]) -> Float[Array, "p m m"]:
    """z^0 ... z^TAYLOR."""
    powers_of = [jnp.eye(z.shape[0]), z]
    for _ in range(TAYLOR - 1):
        powers_of.append(powers_of[-1] @ z)
    return jnp.stack(powers_of)


def doubled(carry: tuple[jax.Array, jax.Array], _):
    """exp(2z) - 1 and phi_j(2z) = 2^-j [exp(z) phi_j(z) + sum_i phi_i(z)/(j - i)!]."""
    less, phi = carry
    j = np.arange(1, len(phi) + 1)
    below = np.array([[1 / math.factorial(a - b) if a >= b else 0.0 for b in j] for a in j])
    total = less @ phi + phi + jnp.tensordot(below, phi, 1)
    return (2 * less + less @ less, total * (0.5**j)[:, None, None]), phi


def phi_functions(A: Float[Array, "m m"], step, halvings: int) -> list[Float[Array, "j m m"]]:
    """phi_1 ... phi_3 of step A and of the step halved up to `halvings` times, |step A| < 8000."""
    z = step * 2.0**-14 * A
    phi = jnp.tensordot(series_weights()[:3], powers(z), 1)
    pair = jax.lax.fori_loop(0, 14 - halvings, lambda _, x: doubled(x, None)[0], (z @ phi[0], phi))
    halves = [pair[1]]
    for _ in range(halvings):
        pair = doubled(pair, None)[0]
        halves.append(pair[1])
    return halves[::-1]
