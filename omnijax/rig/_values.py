"""Values of a rig's parameters, out and in, as a person gives them: names, units, ranges."""

from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Float

from .._errors import InputError
from ._check import inertia_problems
from ._directions import exact_vectors, not_perpendicular
from ._machine import Rig
from ._open import as_rig
from ._parameters import changeable, put_parameter, value_at
from ._placed import without_preload
from ._quantities import InertiaTensor, Quantity, Vector

_PRELOAD = "closure.preload"


def get_parameter(rig: Rig | str | Path, path: str) -> Float[Array, "..."]:
    """Value at `path` in SI; a path that speaks of all wheels gives one entry a wheel.

    `rig` may be a rig file or the name of a bundled rig.

    Raises `InputError` with the nearest path for one that the rig does not have, and for a batch
    of rigs.
    """
    return value_at(as_rig(rig), path)


def set_parameter(rig: Rig | str | Path, path: str, value: Any) -> Rig:
    """A rig with `value` at `path`; `rig`, which may be a file or a bundled name, stays as it is.

    `value` is a number or an array in SI, text with a unit as in a rig file (`"200 kN/m"`), or a
    list of such, of the shape that `parameter_info` says; one value is given to every wheel.
    Raises `InputError` for an unknown path, an unknown unit, another shape, a value outside of the
    range of `parameter_info`, and a batch of rigs.  A wheel's `normal` and `drive` must be at right
    angles to each other, and both become exact, as those of a rig file do; both at once change in
    the tables that `parse_rig` takes.  Traced values pass as they are: their range is not known.
    """
    rig = as_rig(rig)
    place = changeable(rig, path)
    changed = put_parameter(rig, path, _checked(place.quantity, path, value))
    if isinstance(place.quantity, Vector) and place.quantity.unit_length:
        return _with_exact_directions(changed, path, place.index)
    if path.endswith(_PRELOAD):
        _check_preloads(changed)
    if isinstance(place.quantity, InertiaTensor):
        _check_inertia(changed)
    return changed


def _with_exact_directions(rig: Rig, path: str, index: int | None) -> Rig:
    """The rig with exact directions of wheel `index`, or of all for None; as it is where traced."""
    wheels = rig.wheels
    if any(isinstance(x, Tracer) for x in (wheels.normal, wheels.drive)):
        return rig
    normal, drive = np.array(wheels.normal), np.array(wheels.drive)
    for i in range(rig.size) if index is None else [index]:
        if wrong := not_perpendicular(normal[i], drive[i]):
            raise InputError(f"`{path}`: `drive` of {rig.names[i]} {wrong}")
        normal[i], drive[i] = exact_vectors(normal[i], drive[i])
    exact = jnp.asarray(normal), jnp.asarray(drive)
    return eqx.tree_at(lambda r: (r.wheels.normal, r.wheels.drive), rig, exact)


def _check_preloads(rig: Rig) -> None:
    """`InputError` where a known preload is 0 at a law that needs one."""
    preload = rig.wheels.closure.preload
    if isinstance(preload, Tracer):
        return
    preloads = dict(zip(rig.names, np.asarray(preload).tolist(), strict=True))
    problems = [
        problem
        for placed in rig.effects
        for problem in without_preload(placed.law.id, placed.place, preloads)
    ]
    if problems:
        raise InputError(problems)


def _check_inertia(rig: Rig) -> None:
    """`InputError` where no body has the sphere's inertia, as far as it is known."""
    if isinstance(rig.sphere.inertia, Tracer):
        return
    if wrong := list(inertia_problems(np.asarray(rig.sphere.inertia_matrix))):
        raise InputError(wrong)


def _checked(quantity: Quantity | Vector | InertiaTensor, path: str, value: Any) -> Any:
    """`value` in SI where it is known and lies in its range; as it is where it is traced."""
    leaves = jax.tree.leaves(value)
    if any(isinstance(x, Tracer) for x in leaves):
        return value
    plain = jax.tree.map(lambda x: x.tolist() if hasattr(x, "tolist") else x, value)
    try:
        read = _read(quantity, plain)
    except ValueError as error:
        raise InputError(f"`{path}` {error}") from None
    return read if any(isinstance(x, str) for x in leaves) else value


def _read(quantity: Quantity | Vector | InertiaTensor, given: Any) -> Any:
    """One value of `quantity`, or a list of them with one a wheel, in SI."""
    listed = isinstance(given, list | tuple)
    if isinstance(quantity, Quantity) and listed:
        return [quantity.read(entry) for entry in given]
    if isinstance(quantity, Vector) and not listed:
        return quantity.read([given] * (quantity.size or 1))[0]
    if isinstance(quantity, Vector) and all(isinstance(row, list | tuple) for row in given):
        return [quantity.read(row) for row in given]
    return quantity.read(given)
