"""Sine and cosine at once, vectorised."""

import math

import jax
import jax.numpy as jnp

_SINE = [(-1) ** k / math.factorial(2 * k + 1) for k in range(8)]
_COSINE = [(-1) ** k / math.factorial(2 * k) for k in range(9)]


@jax.custom_jvp
def sincos(x):
    """Sine and cosine from one polynomial each: XLA's own call libm once per element on CPUs.

    Error 1e-16 (1 + |x|) for |x| < 3e9.
    """
    n = jnp.round(x * (2 / math.pi))
    quarter = n.astype(jnp.int32)
    r = (x - n * 1.5707963267341256) - n * 6.077100506506192e-11
    z = r * r
    sine, cosine = jnp.zeros_like(z), jnp.zeros_like(z)
    for a, b in zip(reversed([*_SINE, 0.0]), reversed(_COSINE), strict=True):
        sine, cosine = sine * z + a, cosine * z + b
    sine = r * sine
    odd = (quarter & 1) == 1
    s, c = jnp.where(odd, cosine, sine), jnp.where(odd, sine, cosine)
    return jnp.where(quarter & 2 == 2, -s, s), jnp.where((quarter + 1) & 2 == 2, -c, c)


@sincos.defjvp
def _(primals, tangents):
    s, c = sincos(*primals)
    return (s, c), (c * tangents[0], -s * tangents[0])
