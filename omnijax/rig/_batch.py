"""A batch of rigs, as `jax.vmap` makes it, where one is needed."""

from typing import TYPE_CHECKING

from .._errors import InputError

if TYPE_CHECKING:
    from ._machine import Rig


def check_one_rig(rig: "Rig") -> None:
    """`InputError` for a batch of rigs, as `jax.vmap` makes it."""
    if shape := getattr(rig.sphere.radius, "shape", ()):
        raise InputError(
            f"this is a batch of {'x'.join(map(str, shape))} rigs where one is needed: ask inside "
            "`jax.vmap`, or take one by `jax.tree.map(lambda x: x[0], rigs)`."
        )
