"""Whether the wheels hold the sphere in every direction; works inside transformations too."""

from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from ..rig import Rig

LOOSE = 1e-6  # least singular value of the normals: a mode there settles 1e12 times slower
SAME = 1e-6  # rad between two contacts, as files write them, which are one
PARALLEL = 1e-24  # L1 L2 + ... below it is rounding: all normals are parallel


def held(rig: Rig, model: str = "coupled") -> Bool[Array, ""]:
    """Whether contacts push the sphere back along every direction.

    Where their normals span less than space, the coupled model's sphere is free to drift off and no
    steady state exists.  The `paper` variant sums the wheels' deflections and needs no such hold.
    With the eigenvalues L of sum r_i r_i^T, the product over the sum of pairwise products lies
    between a third of the least one and the least one itself, and is held against LOOSE^2.  Both
    are sums of squares (Cauchy and Binet), so that rounding does not enter.
    """
    if model != "coupled":
        return jnp.asarray(True)
    return _span(rig.wheels.normal, jnp)


def _span(r: Any, xp: Any) -> Any:
    """Whether normals (n, 3) span space, computed by `xp`: numpy, or `jax.numpy`."""
    areas = xp.cross(r[:, None], r[None])
    pairs = xp.sum(areas**2) / 2  # L1 L2 + L2 L3 + L3 L1
    product = xp.sum(xp.einsum("ia,jka->ijk", r, areas) ** 2) / 6  # L1 L2 L3
    return (pairs > PARALLEL) & (product > LOOSE**2 * pairs)


def hold_obstacle(rig: Rig, model: str = "coupled") -> str | None:
    """Why a rig of known numbers has no steady state, in words; None where it has one."""
    return None if model != "coupled" or _span(np.asarray(rig.wheels.normal), np) else NOT_HELD


def free_projector(rig: Rig) -> Float[Array, "3 3"]:
    """The projector onto the directions in which no wheel holds the sphere; zero where `held`.

    With S = sum r_i r_i^T it is adj S over its trace where the normals span a plane, and else
    1 - S over its trace; adj S is the sum of (r_i x r_k) (r_i x r_k)^T over pairs (Cauchy, Binet).
    """
    r = rig.wheels.normal
    areas = jnp.cross(r[:, None], r[None])
    pairs = jnp.sum(areas**2)
    plane = pairs / 2 > PARALLEL
    across = jnp.einsum("ika,ikb->ab", areas, areas) / jnp.where(plane, pairs, 1.0)
    aside = jnp.eye(3) - r.T @ r / jnp.sum(r**2)
    return jnp.where(_span(r, jnp), 0.0, jnp.where(plane, across, aside))


def held_directions(rig: Rig) -> int:
    """In how many directions the contacts hold the sphere; 3 where `held`.  Known numbers alone."""
    normal = np.asarray(rig.wheels.normal)
    values = np.linalg.svd(normal, compute_uv=False)
    return 3 if _span(normal, np) else int(np.sum(values[:2] > LOOSE))


def same_contacts(rig: Rig) -> list[tuple[int, int]]:
    """Pairs of wheels that touch the sphere at one place, where no two wheels can be."""
    normal = np.asarray(rig.wheels.normal)
    apart = np.linalg.norm(normal[:, None] - normal[None], axis=2)
    return [(i, k) for i, k in np.argwhere(apart < SAME).tolist() if i < k]


NOT_HELD = "the wheels do not hold the sphere in every direction"
