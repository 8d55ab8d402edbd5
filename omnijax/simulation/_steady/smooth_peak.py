"""A peak that is smooth in the design: a norm of a sum of signals of independent phases.

    S: <exp(p (d.x/S - 1))> = 1 over all phases, along the direction d that makes S largest

as the p-norm N of a run is <(|x|/N)^p> = 1.  The signals' parts of x add, so that logarithms of
their means add:

    F(u) = sum_g ln <exp(u.x_g)> = p    at u = p d/S.

dF/du is the mean of x, and its derivative the covariance, with phases weighed by exp(u.x).
"""

from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax.scipy.special import logsumexp
from jaxtyping import Array, Float

from ..._root import root

STEPS = 6  # of Newton from the direction and size of the supremum: 3 to 4 reach rounding


class PhasePlaces(NamedTuple):
    """Places over the periods of signals: what each adds to x, and its share of the phases."""

    x: Float[Array, "g k 3"]
    share: Float[Array, "g k"]


class _Tilted(NamedTuple):
    """F, and mean and covariance of x with phases weighed by exp(u.x)."""

    F: Float[Array, ""]
    mean: Float[Array, "3"]
    covariance: Float[Array, "3 3"]


def smooth_peak(
    phases: Sequence[PhasePlaces], total: Float[Array, "3"], sharpness: float
) -> Float[Array, ""]:
    """S of all signals, in the unit of x; `total` is x where it is longest, p = `sharpness`.

    Its derivatives are those of F with u held: S is largest along d.
    """
    total = jax.lax.stop_gradient(total)
    size = root(total @ total)
    moves = size != 0  # also where it is not finite, and S is not either
    scale = jnp.where(moves, size, 1.0)
    phases = [PhasePlaces(part.x / scale, part.share) for part in phases]
    still = jax.lax.stop_gradient(phases)
    u = jax.lax.fori_loop(
        0, STEPS, lambda _, u: _newton(still, u, sharpness), sharpness * total / scale
    )
    held = _tilted(still, u)
    slope = jnp.where(moves, held.mean @ u, 1.0)
    length = jnp.where(moves, root(u @ u), 1.0)
    peak = scale * sharpness / length * (1 + (_sum_of_logs(phases, u) - sharpness) / slope)
    return jnp.where(moves, peak, 0.0)


def _newton(phases: Sequence[PhasePlaces], u: Float[Array, "3"], p: float) -> Float[Array, "3"]:
    """The next u: its length for F = p, its direction for the largest F of that length.

    Where a step of Newton leads to less than the mean's own direction does, that is taken.
    """
    now, length = _tilted(phases, u), root(u @ u)
    d = _unit(u)
    along = now.mean @ d
    across = jnp.eye(3) - jnp.outer(d, d)
    curvature = length * across @ now.covariance @ across - along * jnp.eye(3)
    ways = [now.mean, d - jnp.linalg.solve(curvature, across @ now.mean)]
    length += (p - now.F) / jnp.where(along > 0, along, 1.0)
    ends = jnp.stack([length * _unit(way) for way in ways])
    values = jnp.stack([_sum_of_logs(phases, end) for end in ends])
    return ends[jnp.argmax(jnp.where(jnp.isfinite(values), values, -jnp.inf))]


def _unit(way: Float[Array, "3"]) -> Float[Array, "3"]:
    """Its direction; 0 of nothing."""
    length = root(way @ way)
    return way / jnp.where(length > 0, length, 1.0)


def _tilted(phases: Sequence[PhasePlaces], u: Float[Array, "3"]) -> _Tilted:
    parts = [_of_part(part, u) for part in phases]
    return jax.tree.map(lambda *xs: sum(xs), *parts)


def _of_part(part: PhasePlaces, u: Float[Array, "3"]) -> _Tilted:
    logs = logsumexp(part.x @ u, axis=1, b=part.share)
    weight = part.share * jnp.exp(part.x @ u - logs[:, None])
    mean = jnp.einsum("gk,gko->go", weight, part.x)
    apart = part.x - mean[:, None]
    covariance = jnp.einsum("gk,gko,gkq->oq", weight, apart, apart)
    return _Tilted(jnp.sum(logs), jnp.sum(mean, axis=0), covariance)


def _sum_of_logs(phases: Sequence[PhasePlaces], u: Float[Array, "3"]) -> Float[Array, ""]:
    """F(u)."""
    logs = (logsumexp(part.x @ u, axis=1, b=part.share) for part in phases)
    return sum((jnp.sum(x) for x in logs), jnp.zeros(()))
