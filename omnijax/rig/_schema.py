"""The schema of a rig file: one model a table, one field a key, with unit and range."""

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from ._quantities import InertiaTensor, Quantity, Spread, Vector

MOST_WHEELS, MOST_ROLLERS = 64, 1000
STIFFEST = 1e15  # N/m; above it rounding reaches the sixth digit of what a person-sized rig shows
Profile = Literal["gated-sine", "continuous-sine", "half-sine", "rollers", "dual-row", "table"]
Triple = tuple[float, float, float]


class TomlTable(BaseModel):
    """A table of the file; a key that is not a field is refused."""

    model_config = ConfigDict(extra="forbid")


class SphereTable(TomlTable):
    radius: Annotated[float, Quantity("m", above=0)]
    mass: Annotated[float, Quantity("kg", above=0)]
    inertia: Annotated[Any, InertiaTensor()]
    centre_of_mass: Annotated[Triple, Vector("m")] = (0.0, 0.0, 0.0)


class PlatformTable(TomlTable):
    mass: Annotated[float, Quantity("kg", above=0)]
    gravity: Annotated[Triple, Vector("m/s^2")] = (0.0, 0.0, 0.0)


class ContactTable(TomlTable):
    stiffness: Annotated[float, Quantity("N/m", above=0, high=STIFFEST)]
    damping: Annotated[float, Quantity("N s/m", low=0)]
    friction: Annotated[float, Quantity("1", above=0)]


class MountTable(TomlTable):
    stiffness: Annotated[float, Quantity("N/m", above=0, high=STIFFEST)]
    damping: Annotated[float, Quantity("N s/m", low=0)]


class ClosureTable(TomlTable):
    stiffness: Annotated[float, Quantity("N/m", low=0, high=STIFFEST)]
    preload: Annotated[float, Quantity("N", low=0)]


class WheelTable(TomlTable):
    name: Annotated[str, Field(min_length=1, max_length=64)]
    normal: Annotated[Triple, Vector("1", unit_length=True)]
    drive: Annotated[Triple, Vector("1", unit_length=True)]
    radius: Annotated[float, Quantity("m", above=0)]
    mass: Annotated[float, Quantity("kg", above=0)]
    inertia: Annotated[float, Quantity("kg m^2", above=0)]
    rollers: Annotated[float, Quantity("1", low=1, high=MOST_ROLLERS, whole=True)]
    roundness: Annotated[float, Quantity("1", low=0, high=1)]
    profile: Profile
    row_spacing: Annotated[float | None, Quantity("m", above=0)] = None
    table: str | dict[Literal["theta", "rho"], list[float]] | None = None
    contact: ContactTable
    mount: MountTable
    closure: ClosureTable


class EffectTable(TomlTable):
    id: str
    place: str
    law: str | None = None
    parameters: dict[str, Any] = {}


class RigTable(TomlTable):
    """A rig file."""

    sphere: SphereTable
    platform: PlatformTable
    wheel: Annotated[list[WheelTable], Field(min_length=1, max_length=MOST_WHEELS)]
    effect: list[EffectTable] = []
    uncertainty: dict[str, Annotated[float, Spread()]] = {}


TABLES: dict[tuple[str, ...], type[TomlTable]] = {
    (): RigTable,
    ("sphere",): SphereTable,
    ("platform",): PlatformTable,
    ("wheel",): WheelTable,
    ("wheel", "contact"): ContactTable,
    ("wheel", "mount"): MountTable,
    ("wheel", "closure"): ClosureTable,
    ("effect",): EffectTable,
}

GROUPS: dict[str, tuple[str, str]] = {  # output group -> (unit, axes or wheels)
    "theta": ("rad", "wheels"),
    "Omega": ("rad/s", "xyz"),
    "dR": ("m", "xyz"),
    "a": ("m/s^2", "xyz"),
}


def quantities(table: type[TomlTable]) -> dict[str, Quantity | Vector | InertiaTensor]:
    """The numeric keys of a table with their units and ranges."""
    return {
        name: mark
        for name, field in table.model_fields.items()
        for mark in field.metadata
        if isinstance(mark, Quantity | Vector | InertiaTensor)
    }


def number_in(table: type[TomlTable], key: str, given: Any) -> Any:
    """A number of a table in SI where it is well-formed, else None (the schema tells of it)."""
    try:
        return quantities(table)[key].read(given[key])
    except (KeyError, TypeError, ValueError):
        return None


def unit_at(place: str, wheels: int) -> str:
    """The unit of an output group or channel of a rig; 1 for a place that is neither."""
    return GROUPS[place][0] if place in GROUPS else channels(wheels).get(place, "1")


def channels(wheels: int) -> dict[str, str]:
    """The output channels of a rig with their units: `theta_1`, `Omega_x`, ..."""
    numbers = [str(i + 1) for i in range(wheels)]
    return {
        f"{group}_{end}": unit
        for group, (unit, ends) in GROUPS.items()
        for end in (numbers if ends == "wheels" else ends)
    }
