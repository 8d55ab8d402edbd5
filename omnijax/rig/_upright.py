"""Which way is up."""

import jax.numpy as jnp
from jaxtyping import Array, Float

from ._machine import Rig


def up(rig: Rig) -> Float[Array, "3"]:
    """Unit vector against gravity; +z where the rig has none."""
    size = jnp.sqrt(jnp.sum(rig.platform.gravity**2))
    safe = jnp.where(size > 0, size, 1.0)
    return jnp.where(size > 0, -rig.platform.gravity / safe, jnp.array([0.0, 0.0, 1.0]))


def upright(rig: Rig) -> Float[Array, "3 3"]:
    """Orthonormal directions: up, and two across."""
    vertical = up(rig)
    aside = jnp.cross(vertical, jnp.eye(3)[jnp.argmin(jnp.abs(vertical))])
    aside = aside / jnp.sqrt(aside @ aside)
    return jnp.stack([vertical, aside, jnp.cross(vertical, aside)])
