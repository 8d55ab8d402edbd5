"""Closed form of the response per mode and pair: poles, residues, forced sinusoid, start."""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from .._exact import rows_of
from .contact import Contact, Poles, approach, poles, residues
from .design import Design, Layout
from .pole_pair import Pair, inverse, scaled, sincos, times


class Modes(NamedTuple):
    """Closed form of the response, per mode and pair."""

    roots: Poles  # (2, a, c)
    J: Pair  # (2, p, c): free response that a gap's start takes away
    forced: tuple[Array, Array]  # (p, c): x = fa sin + fb cos in the gap
    rate: Array  # (j, c): nu, rad/s
    initial: Pair  # (2, a, c): free state at the start


def modes(design: Design, layout: Layout, numerator=approach) -> Modes:
    """Poles, residues and the forced response of x, or of what has another numerator.

    The run starts from static equilibrium or rest.
    """
    axis, wheel = np.array(layout.axis), np.array(layout.wheel)
    roots = poles(design.contact)
    row = np.array(layout.sets)[axis]
    contact = Contact(*(rows_of(x, row) for x in design.contact))
    lam = Poles(rows_of(roots.u, row), rows_of(roots.D, row))
    r = residues(lam, numerator(contact, design.own, design.coupling))
    wheels = design.wheel
    moving = wheels.passage > 0
    span = np.pi if layout.half_turn else 2 * np.pi
    rate = jnp.where(moving, span / jnp.where(moving, wheels.passage, 1.0), 1.0)
    nu, depth = rows_of(rate, wheel), rows_of(jnp.where(moving, wheels.depth, 0.0), wheel)
    root = Pair(lam.u, jnp.ones_like(lam.u))
    square = times(root, root, lam.D)
    q = scaled(depth, times(r, inverse(Pair(square.u + nu**2, square.v), lam.D), lam.D))
    fa, fb = jnp.sum(times(q, root, lam.D).v, axis=0), nu * jnp.sum(q.v, axis=0)
    inside = rows_of(wheels.since < wheels.passage, wheel)
    s, c = sincos(nu * rows_of(wheels.since, wheel))
    particular = times(q, Pair(root.u * s + nu * c, root.v * s), lam.D)
    rho = jnp.where(inside, -depth * s, 0.0)
    still = scaled(-rho, times(r, inverse(root, lam.D), lam.D))  # lambda z + r rho = 0
    begin = Pair(*(a - jnp.where(inside, b, 0.0) for a, b in zip(still, particular, strict=True)))
    return Modes(roots, scaled(nu, q), (fa, fb), rate, onto_directions(begin, layout))


def onto_directions(pairs: Pair, layout: Layout) -> Pair:
    """Sum of the pairs of each direction."""
    if layout.axis == tuple(range(layout.directions)):
        return pairs
    axis = np.array(layout.axis)
    picks = [np.flatnonzero(axis == a) for a in range(layout.directions)]
    return Pair(*(jnp.stack([x[:, i].sum(axis=1) for i in picks], axis=1) for x in pairs))
