"""NAME.toml beside a run: rig, role, declared noise, channel names and units."""

import dataclasses
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from .._errors import InputError, nearest
from .._reading import read_toml
from ..rig import GRAVITIES, converted
from ._columns import UNITS, columns, group_of, is_column, unit_of

ROLES = ("train", "held-out")
_MANY = 9  # wheels, whose columns a name that is none is compared with
KEYS = ("rig", "role", "noise", "channels", "units")


@dataclasses.dataclass
class Sidecar:
    """What NAME.toml says; `channels` maps our column names to the file's."""

    path: Path
    rig: Path | None = None
    role: str = "train"
    noise: dict[str, float] = dataclasses.field(default_factory=dict)
    channels: dict[str, str] = dataclasses.field(default_factory=dict)
    units: dict[str, str] = dataclasses.field(default_factory=dict)


def read_sidecar(path: Path) -> Sidecar:
    """Read NAME.toml; without the file, its defaults.  `InputError` lists everything wrong."""
    sidecar = Sidecar(path)
    if not path.exists():
        return sidecar
    document = read_toml(path)
    problems = [
        f"`{key}` is not a key of a run{hint(key, KEYS)}." for key in document if key not in KEYS
    ]
    sidecar.rig = _rig(path, document, problems)
    sidecar.role = document.get("role", "train")
    if sidecar.role not in ROLES:
        problems.append(f"`role` must be train or held-out, but is {sidecar.role!r}.")
    sidecar.noise = _table(document, "noise", problems, _noise)
    sidecar.channels = _table(document, "channels", problems, _text)
    sidecar.units = _table(document, "units", problems, _unit)
    if problems:
        raise InputError("\n".join(f"{path.name}: {problem}" for problem in problems))
    return sidecar


def hint(name: str, known: Iterable[str]) -> str:
    """` (did you mean `roundness`?)`, or nothing where no known name is near."""
    near = nearest(name, known)
    return f" (did you mean `{near}`?)" if near else ""


def check_wheels(file: str, sidecar: Sidecar, wheels: int) -> None:
    """`InputError` where NAME.toml speaks of a wheel that the run does not have."""
    known = {*UNITS, *columns(wheels)}
    tables = {"noise": sidecar.noise, "channels": sidecar.channels, "units": sidecar.units}
    problems = [
        f"{sidecar.path.name}: `{key}.{name}` is not a column of {file}, which has {wheels} wheels."
        for key, entries in tables.items()
        for name in entries
        if name not in known
    ]
    if problems:
        raise InputError("\n".join(problems))


def to_si(column: str, unit: str) -> float:
    """Factor from `unit` to the SI unit of a column; `ValueError` where it is another quantity.

    `g` of an acceleration is no gram: see `is_gravity`.
    """
    if is_gravity(column, unit):
        return GRAVITIES[unit]
    try:
        return converted(1.0, unit, unit_of(column))
    except ValueError as error:
        raise ValueError(f"{unit!r} is not a unit of {unit_of(column)}. {error}".strip()) from error


def is_gravity(column: str, unit: str) -> bool:
    """Whether `unit`, of a measured acceleration, is standard gravity or a part of it."""
    return group_of(column) == "a" and unit in GRAVITIES


def _rig(path: Path, document: dict, problems: list[str]) -> Path | None:
    rig = document.get("rig")
    if rig is not None and not isinstance(rig, str):
        problems.append(f"`rig` must be the path of a rig file, but is {rig!r}.")
        return None
    return None if rig is None else path.parent / rig


def _table(document: dict, key: str, problems: list[str], check) -> dict:
    entries = document.get(key, {})
    if not isinstance(entries, dict):
        problems.append(f"`{key}` must be a table, but is {entries!r}.")
        return {}
    result = {}
    for name, value in entries.items():
        if not is_column(name):
            known = (*UNITS, *columns(_MANY))
            problems.append(f"`{key}.{name}` is not a column or group{hint(name, known)}.")
        elif (wrong := check(name, value)) is not None:
            problems.append(f"`{key}.{name}` {wrong}.")
        else:
            result[name] = float(value) if key == "noise" else value
    return result


def _noise(name: str, value: Any) -> str | None:
    good = isinstance(value, (int, float)) and not isinstance(value, bool) and 0 <= value < 1e300
    return None if good else f"must be a 1-sigma in {unit_of(name)}, 0 or more, but is {value!r}"


def _text(name: str, value: Any) -> str | None:
    if isinstance(value, str):
        return None
    return f"must be the name of a column in the file, but is {value!r}"


def _unit(name: str, value: Any) -> str | None:
    try:
        to_si(name, str(value))
    except ValueError as error:
        remedy = str(error.__cause__).rstrip(".")
        return f"must be a unit of {unit_of(name)}, but is {value!r}. {remedy}".rstrip(". ")
    return None
