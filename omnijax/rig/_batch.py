"""A batch of rigs, as `jax.vmap` makes it, where one is needed."""

from typing import TYPE_CHECKING

from .._errors import refuse_batch

if TYPE_CHECKING:
    from ._machine import Rig


def check_one_rig(rig: "Rig") -> None:
    """`InputError` for a batch of rigs, as `jax.vmap` makes it."""
    refuse_batch(getattr(rig.sphere.radius, "shape", ()), " rigs")
