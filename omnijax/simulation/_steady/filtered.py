"""Outputs of the long run behind linear filters, in closed form: the filters' states join it.

A filter dx/dt = F x + b u, y = c x + d u sees u = p (C s + D0 rho + D1 drho/dt), an output along a
direction p.  As in the system itself drho/dt is taken out, x = r + b p D1 rho:

    dr/dt = F r + b p C s + (b p D0 + F b p D1) rho
    y = c r + d p C s + (c b p D1 + d p D0) rho + d p D1 drho/dt
"""

from collections.abc import Sequence
from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from .._exact import ForcedSystem

OUTPUT = "filtered"


class LinearFilter(NamedTuple):
    """dx/dt = F x + b u, y = c x + d u, in s."""

    F: Float[Array, "f f"]
    b: Float[Array, " f"]
    c: Float[Array, " f"]
    d: float


def with_filters(
    system: ForcedSystem,
    name: str,
    directions: Float[Array, "o 3"],
    filters: Sequence[LinearFilter],
) -> ForcedSystem:
    """The system with a filter behind the output `name` along each direction.

    Its one output is `OUTPUT`, a component a direction.  A constant force does not enter: filters
    of vibrations let no constant pass.
    """
    m, size = len(system.A), sum(len(f.b) for f in filters)
    A = jnp.zeros((m + size, m + size)).at[:m, :m].set(system.A)
    column = jnp.pad(system.column, ((0, 0), (0, size)))
    state, direct, rate = jnp.zeros((len(filters), m + size)), [], []
    at = m
    for i, (f, p) in enumerate(zip(filters, directions, strict=True)):
        C, D0, D1 = p @ system.state[name], system.direct[name] @ p, system.rate[name] @ p
        own = slice(at, at + len(f.b))
        A = A.at[own, :m].set(jnp.outer(f.b, C)).at[own, own].set(f.F)
        column = column.at[:, own].set(jnp.outer(D0, f.b) + jnp.outer(D1, f.F @ f.b))
        state = state.at[i, :m].set(f.d * C).at[i, own].set(f.c)
        direct.append(f.d * D0 + (f.c @ f.b) * D1)
        rate.append(f.d * D1)
        at = own.stop
    return system._replace(
        A=A, column=column, shift=jnp.pad(system.shift, ((0, 0), (0, size))),
        state={OUTPUT: state}, direct={OUTPUT: jnp.stack(direct, axis=1)},
        rate={OUTPUT: jnp.stack(rate, axis=1)}, force=jnp.zeros((m + size, 3)),
    )  # fmt: skip
