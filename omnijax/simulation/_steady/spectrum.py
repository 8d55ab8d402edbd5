"""Order spectrum and transmissibility: Fourier coefficients times the transfer function."""

import math

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float

from ..._root import root
from ...laws import Pieces
from .._exact import ForcedSystem, Forcing


def _segment(a):
    """Integral of exp(i a v) over [0, 1]: exp(i a/2) sin(a/2)/(a/2), without a division by zero."""
    return jnp.exp(0.5j * a) * jnp.sinc(a / (2 * math.pi))


def fourier(pieces: Pieces, count: int) -> Complex[Array, " h"]:
    """c_h of rho = sum over all h of c_h exp(i h u), u = 2 pi angle/period, h = 0 .. count.

    Sinusoids in closed form (resonance h = a of the gated sine included), powers of x by a Gauss
    rule that is exact to rounding for the highest harmonic.
    """
    period = jnp.sum(pieces.width)
    start = jnp.cumsum(pieces.width) - pieces.width
    h = jnp.arange(count + 1)[:, None]
    turn = 2 * math.pi * h * pieces.width / period  # (h, k)
    f = pieces.frequency
    plus, minus = _segment(f - turn[..., None]), _segment(-f - turn[..., None])
    waves = 0.5 * pieces.cosine * (plus + minus) - 0.5j * pieces.sine * (plus - minus)
    total = jnp.sum(waves, axis=-1)
    if pieces.polynomial.shape[1] == 1:
        total = total + pieces.polynomial[:, 0] * _segment(-turn)
    else:
        x, w = np.polynomial.legendre.leggauss(24 + 2 * count)
        powers = pieces.polynomial @ jnp.asarray(
            x ** np.arange(pieces.polynomial.shape[1])[:, None]
        )
        v = jnp.asarray((1 + x) / 2)
        total = total + jnp.einsum("hkq,kq->hk", jnp.exp(-1j * turn[..., None] * v), powers * w / 2)
    place = jnp.exp(-2j * math.pi * h * start / period)
    return jnp.sum(total * place * pieces.width / period, axis=1)


def line_rates(signals: Forcing, count: int) -> Float[Array, "g h"]:
    """Angular frequencies h omega of every signal, rad/s."""
    cycle = signals.cycle
    first = 2 * math.pi * cycle.speed / cycle.period
    return first[:, None] * jnp.arange(count + 1)


def line_state(system: ForcedSystem, g: int, rate) -> Complex[Array, " N"]:
    """State per unit of rho_g at an angular frequency w (rad/s): (i w - A)^-1 b."""
    matrix = 1j * rate * jnp.eye(len(system.A)) - system.A
    return jnp.linalg.solve(matrix, system.column[g].astype(complex))


def line_output(
    system: ForcedSystem, g: int, rate, state: Complex[Array, " N"], name: str
) -> Complex[Array, " o"]:
    """An output per unit of rho_g, of its `line_state`: C state + D0 + i w D1."""
    return system.state[name] @ state + system.direct[name][g] + 1j * rate * system.rate[name][g]


def line_response(system: ForcedSystem, g: int, rate, name: str) -> Complex[Array, " o"]:
    """An output per unit of rho_g at an angular frequency w (rad/s)."""
    return line_output(system, g, rate, line_state(system, g, rate), name)


def harmonics(system: ForcedSystem, signals: Forcing, count: int) -> dict[str, Array]:
    """Amplitudes of dR at the harmonics of every signal (the mean, then twice the coefficient)."""
    rates, lines = line_rates(signals, count), []
    for g in range(len(signals.wheel)):
        pieces = jax.tree.map(lambda x, g=g: x[g], signals.cycle.pieces)
        shape = fourier(pieces, count)
        respond = jax.vmap(lambda w, g=g: line_response(system, g, w, "dR"))(rates[g])
        factor = jnp.where(jnp.arange(count + 1) == 0, 1.0, 2.0)
        lines.append((factor * shape)[:, None] * respond)
    return {"dR": jnp.stack(lines)}


def transfer(system: ForcedSystem, signals: Forcing, count: int) -> Float[Array, "g h"]:
    """|x_i/rho_i| of the signal's own contact at its harmonics (the floor's signal: zero)."""
    rates, gains = line_rates(signals, count), []
    for g, wheel in enumerate(signals.wheel):
        if wheel < 0:
            gains.append(jnp.zeros(count + 1))
            continue
        own = jax.vmap(lambda w, g=g: line_response(system, g, w, "approach"))(rates[g])
        gains.append(_modulus(own[:, wheel]))
    return jnp.stack(gains)


def _modulus(x):
    return root(jnp.real(x) ** 2 + jnp.imag(x) ** 2)
