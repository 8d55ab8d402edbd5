"""Every problem of a rig's tables at once, one sentence each."""

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from .._errors import did_you_mean
from .._problems import sentence
from ._check_effects import effect_problems
from ._directions import directed, not_perpendicular
from ._kinds import kind_of
from ._parameters import scalar_paths
from ._schema import (
    GROUPS,
    MOST_WHEELS,
    TABLES,
    RigTable,
    SphereTable,
    WheelTable,
    channels,
    number_in,
    quantities,
)
from ._table_profile import read_profile
from ._uncertain import open_paths, wrong_unit

RESERVED = {"all", "sphere", "platform", "scale", *WheelTable.model_fields, *GROUPS}
_OTHERS = {
    "study": "is a study file, not a rig file: its machine stands under `rig`.",
    "machine": "is a machine file (of an axis), not a rig file.",
}


def problems(data: Mapping[str, Any], folder: Path) -> list[str]:
    """What is wrong with the tables of a rig file; relative files are looked for in `folder`."""
    if (kind := kind_of(data)) in _OTHERS:
        return [_OTHERS[kind]]
    data, _, sentences = directed(data)
    try:
        RigTable.model_validate(data)
    except ValidationError as error:
        sentences += [_sentence(entry, data) for entry in error.errors() if not _nested(entry)]
    wheels = [wheel for wheel in _blocks(data, "wheel") if isinstance(wheel, Mapping)]
    names = [wheel["name"] for wheel in wheels if isinstance(wheel.get("name"), str)]
    sentences += _name_problems(names)
    for i, wheel in enumerate(wheels):
        key = f"wheel.{_label(wheels, i)}"
        sentences += [f"`{key}.{text}" for text in _wheel_problems(wheel, data, folder)]
    sentences += _sphere_problems(data.get("sphere"))
    sentences += effect_problems(_blocks(data, "effect"), wheels, folder)
    sentences += _uncertainty_problems(data, names)
    return _once_for_all(sentences, [_label(wheels, i) for i in range(len(wheels))])


def _once_for_all(sentences: list[str], labels: list[str]) -> list[str]:
    """The sentences, each once; one that holds of several wheels names the others behind it."""
    wheels: dict[tuple[str, str], list[str]] = {}
    for text in dict.fromkeys(sentences):
        own = [x for x in labels if text.startswith((f"`wheel.{x}.", f"`wheel.{x}`"))][:1]
        said = text.removeprefix(f"`wheel.{own[0]}") if own else text
        wheels.setdefault(("wheel" if own else "", said), []).extend(own)
    return [
        f"{f'`wheel.{own[0]}' if own else ''}{said}"
        + (f" The same holds of {', '.join(own[1:])}." if own[1:] else "")
        for (_, said), own in wheels.items()
    ]


def _blocks(data: Mapping, key: str) -> list:
    blocks = data.get(key, [])
    return blocks if isinstance(blocks, list) else []


def _label(blocks: Any, index: int, key: str = "name") -> str:
    """A block's name where that tells it from the others, else its number in the file, from 1."""
    names = [block.get(key) if isinstance(block, Mapping) else None for block in blocks]
    name = names[index]
    return name if name and isinstance(name, str) and names.count(name) == 1 else str(index + 1)


def _nested(entry: Any) -> bool:
    """An uncertainty whose key is not in quotes; `_uncertainty_problems` says so."""
    return entry["loc"][0] == "uncertainty" and isinstance(entry["input"], Mapping)


def _sentence(entry: Any, data: Mapping) -> str:
    """One pydantic error as a sentence that begins with the key's path."""
    loc, kind = entry["loc"], entry["type"]
    if kind == "too_short" and loc == ("wheel",):
        return "`wheel`: a rig needs at least one [[wheel]] block, but has none."
    if kind == "too_long" and loc == ("wheel",):
        count = len(entry["input"])
        return f"`wheel`: a rig has at most {MOST_WHEELS} [[wheel]] blocks, but there are {count}."
    table = tuple(part for part in loc[:-1] if isinstance(part, str))
    keys = TABLES.get(table, RigTable).model_fields
    told = sentence(entry, _path(loc, data), "a rig file", keys)
    return told + _purpose(loc) if kind == "missing" else told


def _path(loc: tuple, data: Any) -> str:
    """Key path with a wheel's name (an effect's id) in the place of its number."""
    parts, here = [], data
    for step in loc:
        if isinstance(step, int):
            parts.append(_label(here, step, "id" if parts == ["effect"] else "name"))
        else:
            parts.append(step)
        try:
            here = here[step]
        except (KeyError, IndexError, TypeError):
            here = []
    return ".".join(parts)


def _purpose(loc: tuple) -> str:
    """Unit and range of a missing number."""
    table = TABLES.get(tuple(part for part in loc[:-1] if isinstance(part, str)))
    quantity = quantities(table).get(str(loc[-1])) if table else None
    return f" Give a value in {quantity.unit}." if quantity and quantity.unit != "1" else ""


def _name_problems(names: list[str]) -> Iterator[str]:
    """Names that are not unique, mean something else, or would break a parameter's path."""
    reserved = RESERVED | set(channels(len(names)))
    for name in dict.fromkeys(names):
        if names.count(name) > 1:
            yield f"`wheel.{name}.name` must be unique, but {names.count(name)} wheels have it."
        if name in reserved:
            yield f"`wheel.{name}.name` must not be {name!r}: the word has a meaning of its own."
        if "." in name or not name.isprintable() or name != name.strip():
            yield f"`wheel.{name}.name` must be printable text without dots, but is {name!r}."


def _wheel_problems(wheel: Mapping, data: Mapping, folder: Path) -> Iterator[str]:
    """What the keys of one wheel together get wrong; begins inside the backticks."""
    normal, drive = (number_in(WheelTable, key, wheel) for key in ("normal", "drive"))
    if normal is not None and drive is not None and (wrong := not_perpendicular(normal, drive)):
        yield f"drive` {wrong}"
    profile = wheel.get("profile")
    for key, owner in (("row_spacing", "dual-row"), ("table", "table")):
        if profile == owner and key not in wheel:
            yield f"{key}` is missing: profile {owner!r} needs it."
        if profile != owner and key in wheel:
            yield f"{key}` belongs to profile {owner!r} only, but the profile is {profile!r}."
    roundness = number_in(WheelTable, "roundness", wheel)
    if profile == "dual-row" and roundness is not None and roundness > 0.5:
        yield (
            f"roundness` must lie in [0, 0.5] for profile 'dual-row', but is {roundness!r}: "
            "above it both rows show a gap at once."
        )
    rollers, radius = (
        number_in(WheelTable, "rollers", wheel),
        number_in(WheelTable, "radius", wheel),
    )
    sphere = number_in(SphereTable, "radius", data.get("sphere"))
    if roundness is not None and rollers and radius and sphere:
        reach = radius * math.sin(min(roundness * math.pi / rollers, math.pi / 2))
        if reach >= sphere:
            yield (
                f"radius` must lie below {radius * sphere / reach:.4g} m for these gaps, but is "
                f"{radius!r}: the sphere would fall through."
            )
    if profile == "table" and "table" in wheel and rollers is not None:
        try:
            read_profile(wheel["table"], rollers, folder)
        except ValueError as error:
            yield f"table` {error}"


def _sphere_problems(sphere: Any) -> Iterator[str]:
    """A body inside its own surface: centre of mass, and inertia that its mass allows."""
    if not isinstance(sphere, Mapping):
        return
    radius, mass = (number_in(SphereTable, key, sphere) for key in ("radius", "mass"))
    centre = number_in(SphereTable, "centre_of_mass", sphere)
    if centre is not None and radius is not None and math.hypot(*centre) >= radius:
        yield (
            f"`sphere.centre_of_mass` must lie inside the sphere (radius {radius:g} m), but is "
            f"{math.hypot(*centre):g} m from its centre."
        )
    inertia = number_in(SphereTable, "inertia", sphere)
    if inertia is None:
        return
    tensor = np.array(inertia) if isinstance(inertia, tuple) else inertia * np.eye(3)
    yield from inertia_problems(tensor)
    moments = float(np.trace(tensor))
    if mass is not None and radius is not None:
        most = 2 * mass * radius**2  # sum of the moments, all mass at the surface
        if moments > most * 1.01:  # rounded figures of a hollow sphere pass
            yield (
                f"`sphere.inertia` is more than its mass can have: its principal moments add up to "
                f"{moments:g} kg m^2, but 2 m R^2 is {most:g}."
            )


def inertia_problems(tensor: np.ndarray) -> Iterator[str]:
    """That no body has the principal moments of an inertia (3, 3), kg m^2."""
    low, middle, high = np.linalg.eigvalsh(tensor).tolist()
    if low + middle < high * (1 - 1e-6):
        yield (
            f"`sphere.inertia` must obey the triangle inequality, but of its principal moments "
            f"{low:g}, {middle:g} and {high:g} kg m^2 the largest is above the sum of the others."
        )


def _uncertainty_problems(data: Mapping, names: list[str]) -> Iterator[str]:
    """Keys that are no parameter of the rig, or not in quotes."""
    table = data.get("uncertainty", {})
    if not isinstance(table, Mapping):
        return
    effects = [block for block in _blocks(data, "effect") if isinstance(block, Mapping)]
    units = open_paths(names)
    known = scalar_paths(names, effects) | set(units)
    for path, value in table.items():
        if isinstance(value, Mapping):
            inner = next(iter(value), "...")
            yield f'`uncertainty.{path}` needs its key in quotes: "{path}.{inner}" = 0.1.'
        elif path not in known:
            hint = did_you_mean(path, known)
            yield f"`uncertainty.{path}` must be a parameter of the rig, but is none.{hint}"
        elif (reason := wrong_unit(path, value, units)) is not None:
            yield reason
