"""Least normal force and slip margin over all phases, for statuses: two motions, one sum a contact.

From the sphere's equation along a normal, with the platform's motion y = -(M_s x + m Delta)/M_T,

    N - N0 = K' x + M_s ((1 - M_s/M_T) x'' - (m/M_T) Delta'') - F        F = coupling drho/dt

and the drive force at contact i is f_i = sum_j gain_ij drho_j/dt.  Every term is a motion of pairs
again; the phases of the wheels are independent, so minima over phases add up.
"""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .contact import deflection
from .periodic import Motion, Pairing, Shaken, motion
from .periodic_peak import heights
from .pole_pair import Pair, plus, scaled, times


class Grip(NamedTuple):
    """What holds the contacts beside their motion."""

    gain: Float[Array, "p c"]  # N s/m, drive force at the pair's contact per drho/dt of its wheel
    preload: Float[Array, "a c"]  # N
    friction: Float[Array, "a c"]


def _curved(m: Motion) -> Motion:
    """The second derivative in time."""
    root = Pair(m.lam.u, jnp.ones_like(m.lam.u))
    square = times(root, root, m.lam.D)
    across, along = (
        tuple(
            tuple(-(nu**2) * x for x, nu in zip(xs, rates, strict=True))
            for xs, rates in zip(part, m.rate, strict=True)
        )
        for part in (m.across, m.along)
    )
    free = times(m.free, square, m.lam.D)
    return m._replace(free=free, still=0 * m.still, across=across, along=along)


def _sum(*terms: tuple[Array, Motion]) -> Motion:
    """The weighted sum of motions of the same pairs."""
    weight, total = terms[0]

    def waves(name):
        parts = [(w, getattr(m, name)) for w, m in terms]
        return tuple(
            tuple(sum(w * part[k][i] for w, part in parts) for i in range(len(xs)))
            for k, xs in enumerate(getattr(total, name))
        )

    free = scaled(weight, total.free)
    for w, m in terms[1:]:
        free = plus(free, scaled(w, m.free))
    still = sum(w * m.still for w, m in terms)
    return total._replace(free=free, still=still, across=waves("across"), along=waves("along"))


def _shape_rate(m: Motion, design: Shaken, layout: Pairing) -> Motion:
    """drho/dt of every pair's wheel."""
    wheel, shape = np.array(layout.wheel), design.shape
    nothing = Pair(0 * m.free.u, 0 * m.free.v)

    def waves(values, sign):
        return tuple(
            tuple(sign * values[k, w][wheel] * m.rate[k][w] for w in range(count))
            for k, count in enumerate(layout.waves)
        )

    across, along = waves(shape.sine, 1.0), waves(shape.cosine, -1.0)
    return m._replace(free=nothing, still=0 * m.still, across=across, along=along)


def _least(m: Motion, layout: Pairing, blocks: int):
    """Smallest value of every pair, by parabolas inside pieces, and at the pieces' starts."""
    pairs = tuple(range(len(layout.wheel)))
    alone = layout._replace(wheel=pairs, wheels=len(pairs))
    inside = -jnp.max(heights(m, alone, blocks)[1], axis=0)
    starts = [
        jnp.sum(m.free.v[k], axis=0) + m.still[k] + sum(m.across[k]) for k in range(len(m.across))
    ]
    filled = [jnp.where(d > 0, x, jnp.inf) for x, d in zip(starts, m.duration, strict=True)]
    return jnp.minimum(inside, jnp.min(jnp.stack(filled), axis=0))


def margins(design: Shaken, grip: Grip, layout: Pairing, blocks: int):
    """Least normal force and least mu N - |f| of all contacts, N, (c,) each."""
    axis = np.array(layout.axis)
    contact = type(design.contact)(*(x[np.array(layout.sets)[axis]] for x in design.contact))
    x, mount = motion(design, layout), motion(design, layout, deflection)
    a, b, g = contact.sphere, contact.wheel, contact.platform
    share = b * g / (a * b + a * g + b * g)  # M_s/M_T
    rate = _shape_rate(x, design, layout)
    load = _sum(
        (contact.closure, x),
        ((1 - share) / a, _curved(x)),
        (-share / b, _curved(mount)),
        (-design.coupling, rate),
    )
    friction = grip.friction[axis]

    def least(m: Motion):
        low = _least(m, layout, blocks)
        rows = [np.flatnonzero(axis == i) for i in range(layout.directions)]
        return jnp.stack([sum(low[p] for p in row) for row in rows])

    slips = [least(_sum((friction, load), (sign * grip.gain, rate))) for sign in (1.0, -1.0)]
    slip = grip.friction * grip.preload + jnp.minimum(*slips)
    return jnp.min(grip.preload + least(load), axis=0), jnp.min(slip, axis=0)
