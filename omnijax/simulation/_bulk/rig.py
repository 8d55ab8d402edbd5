"""Rigs whose contacts decouple, as arrays: contacts, couplings, and designs in groups."""

from collections.abc import Callable
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...rig import Rig
from .._exact import drive_gain, exact_obstacle
from .contact import Contact

Make = Callable[[Any], tuple[Rig, Float[Array, " n"], Float[Array, " n"]]]


def contact_obstacle(rig: Rig, model: str) -> str | None:
    """Why the rig's contacts have no closed form one by one, in words; None where they do."""
    reason = exact_obstacle(rig, model)
    if reason is not None:
        return reason
    if any(placed.law.port in {"shape", "contact", "platform"} for placed in rig.effects):
        return "steady states in bulk take no further laws at shapes, contacts and the platform"
    if model == "coupled" and not (rig.size == 3 and orthonormal(rig)):
        return "the contacts couple: their normals are not three orthogonal directions"
    return None


def orthonormal(rig: Rig) -> bool:
    normal = np.asarray(rig.wheels.normal)
    return bool(np.allclose(normal @ normal.T, np.eye(rig.size), atol=1e-12))


def contacts_of(rig: Rig, model: str) -> Contact:
    wheels, n = rig.wheels, rig.size
    behind = rig.platform.mass + jnp.sum(wheels.mass) - wheels.mass
    return Contact(
        jnp.full(n, 1 / rig.sphere.mass),
        1 / wheels.mass,
        jnp.zeros(n) if model == "paper" else 1 / behind,
        wheels.contact.stiffness,
        wheels.contact.damping,
        wheels.mount.stiffness,
        wheels.mount.damping,
        wheels.closure.stiffness,
    )


def links_of(rig: Rig, speeds, model: str, layout) -> tuple[Contact, Array, Array]:
    """Contacts by sets of parameters, and what each pair of `layout` is: own, and coupling."""
    axis, wheel = np.array(layout.axis), np.array(layout.wheel)
    coupling = jnp.zeros((rig.size, rig.size))
    if model == "coupled":
        coupling = rig.wheels.normal @ rig.wheels.drive.T @ drive_gain(rig, speeds)
    rows = [layout.sets.index(s) for s in range(max(layout.sets) + 1)]
    contact = Contact(*(x[np.array(rows)] for x in contacts_of(rig, model)))
    return contact, jnp.asarray(np.where(axis == wheel, 1.0, 0.0)), coupling[axis, wheel]


def all_pairs(n: int, model: str) -> tuple[tuple[int, ...], tuple[int, ...]]:
    if model == "paper":
        return tuple(range(n)), tuple(range(n))
    return tuple(a for a in range(n) for _ in range(n)), tuple(range(n)) * n


def lanes(values, width: int):
    """Rows in groups of `width`, the last one filled up with the last row; (groups, width, d)."""
    groups = -(-len(values) // width)
    filled = jnp.concatenate([values, jnp.repeat(values[-1:], groups * width - len(values), 0)])
    return filled.reshape(groups, width, values.shape[1])


def half_root(x):
    """d sqrt(x)/dx, zero where nothing moves."""
    return jnp.where(x > 0, 0.5 / jnp.sqrt(jnp.where(x > 0, x, 1.0)), 0.0)
