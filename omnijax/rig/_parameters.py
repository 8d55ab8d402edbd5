"""Parameter paths: `sphere.mass`, `wheel.w1.radius`, `effect.wheel-runout.w2.amplitude`."""

from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._errors import InputError, did_you_mean
from ..laws import ANY_LENGTH, Parameter, TableShape
from ._machine import Rig
from ._placed import stands_twice
from ._quantities import InertiaTensor, Quantity, Vector
from ._schema import (
    ClosureTable,
    ContactTable,
    MountTable,
    PlatformTable,
    SphereTable,
    WheelTable,
    quantities,
    unit_at,
)

_BODIES = {
    f"{body}.{key}": quantity
    for body, table in (("sphere", SphereTable), ("platform", PlatformTable))
    for key, quantity in quantities(table).items()
}
_PARTS = {
    f"{part}.{key}": quantity
    for part, table in (("contact", ContactTable), ("mount", MountTable), ("closure", ClosureTable))
    for key, quantity in quantities(table).items()
}
_WHEEL = {**quantities(WheelTable), **_PARTS}
_SPACING = "row_spacing"  # a field of the wheel's profile, not of the wheel
_ROLLERS = "rollers"


class UnknownParameter(InputError):
    """The rig has no parameter of this path."""


class ParameterInfo(NamedTuple):
    """What is known of one parameter besides its value; `shape` is () for one number.

    `above`: `low` itself is excluded.
    """

    path: str
    unit: str
    low: float
    high: float
    shape: tuple[int, ...]
    whole: bool = False
    above: bool = False

    @property
    def quantity(self) -> Quantity:
        """Unit and range of each of its numbers."""
        excluded = self.low if self.above else None
        return Quantity(self.unit, self.low, self.high, excluded, self.whole)

    @property
    def range(self) -> str:
        """The allowed range as text."""
        return self.quantity.range


class _Place(NamedTuple):
    """Where a parameter stands in the rig: a leaf, or an entry of it."""

    leaf: Callable[[Rig], Any]
    index: int | None
    quantity: Quantity | Vector | InertiaTensor


def value_at(rig: Rig, path: str) -> Float[Array, "..."]:
    """Value at `path` in SI; a path that speaks of all wheels gives one entry a wheel.

    Raises `InputError` with the nearest path for one that the rig does not have.
    """
    place = _locate(rig, path)
    leaf = jnp.asarray(place.leaf(rig))
    return leaf if place.index is None else leaf[place.index]


def put_parameter(rig: Rig, path: str, value: Any) -> Rig:
    """`set_parameter` for numbers in SI whose range is known to hold: nothing is looked at.

    Differentiable in `value`.  Raises `InputError` for an unknown path and for another shape.
    """
    place = changeable(rig, path)
    old, new = jnp.asarray(place.leaf(rig)), jnp.asarray(value, float)
    shape = old.shape if place.index is None else old.shape[1:]
    if isinstance(place.quantity, InertiaTensor):
        shape = (3, 3) if new.shape == (3, 3) else ()  # a number is isotropic, whatever stood there
    try:
        new = jnp.broadcast_to(new, shape)
    except ValueError:
        raise InputError(f"`{path}` has shape {shape}, but the value has {new.shape}.") from None
    new = new if place.index is None else old.at[place.index].set(new)
    return eqx.tree_at(place.leaf, rig, new, is_leaf=lambda x: x is None)


def read_parameter(rig: Rig, path: str, value: Any) -> Any:
    """A user's `value` for `path` in SI, from a number or text with a unit; checks its range.

    Raises `InputError` for an unknown path, and for a value of another kind, unit or range.
    """
    quantity = changeable(rig, path).quantity
    try:
        return quantity.read(value)
    except ValueError as error:
        raise InputError(f"`{path}` {error}") from None


def parameter_info(rig: Rig, path: str) -> ParameterInfo:
    """Unit, range and shape of the parameter at `path`; `InputError` for an unknown one.

    Bounds are in the SI `unit`.  Raises `InputError` with the nearest path, and for one that cannot
    change: the number of rollers of a wheel whose measured profile is one pitch long.
    """
    leaf, index, quantity = changeable(rig, path)
    whole = isinstance(quantity, Quantity) and quantity.whole
    above = quantity.above is not None
    low = quantity.low if quantity.above is None else quantity.above
    shape = jnp.shape(leaf(rig))[0 if index is None else 1 :]
    return ParameterInfo(path, quantity.unit, low, quantity.high, shape, whole, above)


def parameter_paths(rig: Rig) -> list[ParameterInfo]:
    """Every numeric parameter that may change: bodies, all wheels at once, each wheel, effects.

    One `ParameterInfo` each: `path`, SI `unit`, `low` and `high`, `shape`.  Raises `InputError`
    where an effect stands twice at a place: one path would name two numbers.
    """
    paths = [*_BODIES, *_all_wheels(), *_each_wheel(rig.names)]
    paths = [path for path in paths if not _of_one_pitch(rig, path)]
    paths += [
        f"wheel.{name}.{_SPACING}"
        for name, profile in zip(rig.names, rig.profiles, strict=True)
        if hasattr(profile, _SPACING)
    ]
    paths += [
        f"effect.{placed.law.id}.{placed.place}.{key}"
        for placed in rig.effects
        for key in placed.law.parameters
        if getattr(placed.law, key) is not None
    ]
    return [parameter_info(rig, path) for path in paths]


def scalar_paths(names: Iterable[str], effects: Iterable[Mapping]) -> set[str]:
    """Paths of one number (or one a wheel), every spelling; for the checks before a rig exists."""
    paths = {path for path, q in _BODIES.items() if not isinstance(q, Vector)}
    numbers = {key for key, q in _WHEEL.items() if isinstance(q, Quantity) and not q.whole}
    paths |= {f"wheel.{key}" for key in numbers if key != _SPACING}
    paths |= {key for key in _PARTS if key in numbers}
    paths |= {f"wheel.{name}.{key}" for name in names for key in numbers}
    for block in effects:
        parameters = block.get("parameters", {})
        keys = parameters if isinstance(parameters, Mapping) else ()
        paths |= {f"effect.{block.get('id')}.{block.get('place')}.{key}" for key in keys}
    return paths


def law_quantity(parameter: Parameter, place: str = "", wheels: int = 0) -> Quantity | Vector:
    """Unit and range of a law's parameter; a sensor's takes the unit of its channel."""
    unit = parameter.unit
    if unit.startswith("unit of the channel"):
        unit = unit_at(place, wheels) + unit.removeprefix("unit of the channel")
        unit = unit.removeprefix("1/") if unit == "1/" else unit
    bounds: dict[str, Any] = {"low": parameter.low, "high": parameter.high}
    if parameter.above:
        bounds = {"above": parameter.low, "high": parameter.high}
    if parameter.shape == ANY_LENGTH:
        return Vector(unit, size=None, **bounds)
    if parameter.shape:
        return Vector(unit, nonzero=unit == "1", size=parameter.shape, **bounds)
    return Quantity(unit, **bounds, whole=parameter.whole)


def _all_wheels() -> list[str]:
    return [key if key in _PARTS else f"wheel.{key}" for key in _WHEEL if key != _SPACING]


def _each_wheel(names: Iterable[str]) -> list[str]:
    return [f"wheel.{name}.{key}" for name in names for key in _WHEEL if key != _SPACING]


def _locate(rig: Rig, path: str) -> _Place:
    """The leaf that `path` names; `InputError` with the nearest known path where there is none."""
    head, _, key = path.partition(".")
    if path in _BODIES:
        return _Place(lambda r: getattr(getattr(r, head), key), None, _BODIES[path])
    if path in _PARTS:
        return _wheel_place(path, None)
    if head == "wheel" and key in _WHEEL and key != _SPACING:
        return _wheel_place(key, None)
    name, _, key = key.partition(".")
    if head == "wheel" and name in rig.names and key in _WHEEL:
        i = rig.names.index(name)
        if key != _SPACING:
            return _wheel_place(key, i)
        if hasattr(rig.profiles[i], _SPACING):
            return _Place(lambda r: r.profiles[i].row_spacing, None, _WHEEL[key])
    if head == "effect":
        leaf = _effect_place(rig, path)
        if leaf:
            return leaf
    known = [info.path for info in parameter_paths(rig)]
    raise UnknownParameter(f"the rig has no parameter `{path}`.{did_you_mean(path, known)}")


def changeable(rig: Rig, path: str) -> _Place:
    """The leaf that `path` names; `InputError` where there is none, or where it cannot change."""
    place = _locate(rig, path)
    if names := _of_one_pitch(rig, path):
        raise InputError(
            f"`{path}` cannot change: the measured profile of {' and '.join(names)} is one pitch "
            "long, which is that of its number of rollers."
        )
    return place


def _of_one_pitch(rig: Rig, path: str) -> list[str]:
    """The wheels with a measured profile of one pitch whose number of rollers `path` names."""
    head, _, key = path.partition(".")
    if head != "wheel" or path.rpartition(".")[2] != _ROLLERS:
        return []
    return [
        name
        for name, profile in zip(rig.names, rig.profiles, strict=True)
        if key in (_ROLLERS, f"{name}.{_ROLLERS}")
        and isinstance(profile, TableShape)
        and not profile.whole_turn
    ]


def _wheel_place(key: str, index: int | None) -> _Place:
    def leaf(rig: Rig) -> Any:
        here: Any = rig.wheels
        for part in key.split("."):
            here = getattr(here, part)
        return here

    return _Place(leaf, index, _WHEEL[key])


def _effect_place(rig: Rig, path: str) -> _Place | None:
    """Where an effect's parameter is; `InputError` for one that stands twice at the place."""
    for k, placed in enumerate(rig.effects):
        for key, parameter in placed.law.parameters.items():
            if path == f"effect.{placed.law.id}.{placed.place}.{key}":
                quantity = law_quantity(parameter, placed.place, rig.size)
                if getattr(placed.law, key) is None:
                    return None
                here = (placed.law.id, placed.place)
                if here in [(x.law.id, x.place) for x in rig.effects[k + 1 :]]:
                    raise InputError(f"`{path}` names two numbers: {stands_twice(*here)}")
                return _Place(lambda r, k=k, a=key: getattr(r.effects[k].law, a), None, quantity)
    return None
