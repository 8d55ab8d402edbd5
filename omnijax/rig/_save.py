"""Rig files out: `Rig` -> TOML, so that reading it back gives the same rig to the last bit."""

import hashlib
import math
import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from .._errors import InputError
from .._files import write_bytes, write_text
from .._toml import toml_value
from ..laws import EFFECTS, AbstractLaw, DualRow, TableShape, of_library
from ._batch import check_one_rig
from ._check import problems
from ._machine import Rig
from ._parameters import law_quantity
from ._placed import stands_twice
from ._schema import (
    ClosureTable,
    ContactTable,
    MountTable,
    PlatformTable,
    SphereTable,
    WheelTable,
    quantities,
)
from ._user_laws import AS_BYTES, file_of, texts_of_laws


def save_rig(rig: Rig, path: str | Path) -> Path:
    """Write `rig` to the TOML file `path`; measured profiles and users' laws go beside it.

    Returns the path.  Raises `InputError` for a measured profile that fits no pitch of its wheel,
    for a law that stands twice at a place and where another text lies beside, `OSError` where
    nothing can be written.

    Numbers are SI.
    """
    path = Path(path)
    files: dict[str, bytes] = {}
    text = _text(rig, files, path.stem)
    for name, content in files.items():
        _write_beside(path.parent / name, content, "rig")
    return write_text(path, text)


def save_laws(laws: Iterable[AbstractLaw], folder: str | Path, what: str) -> None:
    """Write the files of users' laws into the `folder` where `what` that names them is saved.

    Raises `InputError` for a law that came from no file and where another text lies there.
    """
    for name, text in texts_of_laws(laws).items():
        _write_beside(Path(folder) / name, text.encode("utf-8", AS_BYTES), what)


def _write_beside(path: Path, content: bytes, what: str) -> None:
    """Write a file beside what is saved; a law's own file stays, and no other one gives way."""
    kept = path.suffix == ".py" and path.exists()
    if kept and path.read_bytes() != content:
        raise InputError(f"{path} exists with another text: save the {what} to another folder.")
    if not kept:
        write_bytes(path, content)


def files_of_rig(rig: Rig, path: str | Path) -> list[Path]:
    """What `save_rig` writes: the rig file and its measured profiles; laws' files are left out."""
    path, files = Path(path), {}
    _text(rig, files, path.stem)
    return [path, *(path.parent / name for name in files if not name.endswith(".py"))]


def rig_text(rig: Rig) -> str:
    """The rig as TOML text, measured profiles included; laws of a user's file by its name alone.

    Numbers are SI.  Raises `InputError` for a measured profile that fits no pitch of its wheel and
    for a law that stands twice at a place.
    """
    return _text(rig, None, "")


def rig_problems(rig: Rig) -> list[str]:
    """What a rig file of `rig` would be refused for, a sentence each; laws of users are left out.

    Numbers are SI.  Raises `InputError` for a measured profile that fits no pitch of its wheel.
    """
    known = [placed for placed in rig.effects if of_library(placed.law, EFFECTS)]
    once = {(placed.law.id, placed.place): placed for placed in known}
    tables = tomllib.loads(rig_text(rig.with_effects(tuple(once.values()))))
    tables.pop("uncertainty", None)
    return problems(tables, Path("."))


def law_texts(rig: Rig) -> dict[str, str]:
    """Texts of the law files that the rig's effects come from, by file name.

    They belong to `rig_text` where the laws' formulas decide a number.  Raises `InputError` for two
    files of one name with different texts, and for a law that came from no file.
    """
    return texts_of_laws(placed.law for placed in rig.effects)


def rig_identity(rig: Rig) -> dict[str, Any]:
    """All of a rig that decides its numbers, as JSON has it: its tables, digests of its laws."""
    digests = {
        name: hashlib.sha256(text.encode("utf-8", AS_BYTES)).hexdigest()
        for name, text in law_texts(rig).items()
    }
    return tomllib.loads(rig_text(rig)) | ({"laws": digests} if digests else {})


def _text(rig: Rig, files: dict[str, bytes] | None, stem: str) -> str:
    """TOML of the rig; `files` collects what goes beside it, or everything stays in the text."""
    check_one_rig(rig)
    _check_effects(rig)
    lines = ["[sphere]", *_keys(rig.sphere, SphereTable), ""]
    lines += ["[platform]", *_keys(rig.platform, PlatformTable)]
    for i, name in enumerate(rig.names):
        lines += ["", "[[wheel]]", f"name = {_toml(name)}", *_keys(rig.wheels, WheelTable, i)]
        lines += _profile(rig, i, files, stem)
        for part, table in (("contact", ContactTable), ("mount", MountTable)):
            lines.append(_inline(part, getattr(rig.wheels, part), table, i))
        lines.append(_inline("closure", rig.wheels.closure, ClosureTable, i))
    for placed in rig.effects:
        lines += [
            "",
            "[[effect]]",
            f"id = {_toml(placed.law.id)}",
            f"place = {_toml(placed.place)}",
        ]
        lines += _effect(placed.law, placed.place, rig.size, files)
    if rig.uncertainty:
        lines += ["", "[uncertainty]  # 1-sigma: shares, rad, s, m"]
        lines += [f"{_toml(key)} = {_toml(value)}" for key, value in rig.uncertainty]
    return "\n".join(lines) + "\n"


def _check_effects(rig: Rig) -> None:
    """`InputError` for laws that stand twice at a place: such a file could not be read back."""
    places = [(placed.law.id, placed.place) for placed in rig.effects]
    twice = [place for place in dict.fromkeys(places) if places.count(place) > 1]
    if twice:
        raise InputError([stands_twice(*place) for place in twice])


def _keys(part: Any, table: type, index: int | None = None) -> list[str]:
    """`key = value  # unit` of the numbers of a table; the zero vectors are the defaults."""
    lines = []
    for key, quantity in quantities(table).items():
        if key == "row_spacing":  # stands with the profile
            continue
        value = np.asarray(getattr(part, key))
        value = value if index is None else value[index]
        if key in {"gravity", "centre_of_mass"} and not value.any():
            continue
        unit = "" if quantity.unit == "1" else f"  # {quantity.unit}"
        lines.append(f"{key} = {_toml(value, whole=key == 'rollers')}{unit}")
    return lines


def _inline(name: str, part: Any, table: type, index: int) -> str:
    units = [q.unit.replace("1", "-") for q in quantities(table).values()]
    pairs = (f"{key} = {_toml(np.asarray(getattr(part, key))[index])}" for key in quantities(table))
    return f"{name} = {{ {', '.join(pairs)} }}  # {', '.join(units)}"


def _profile(rig: Rig, i: int, files: dict[str, bytes] | None, stem: str) -> list[str]:
    profile = rig.profiles[i]
    lines = [f"profile = {_toml(profile.id)}"]
    if isinstance(profile, DualRow):
        lines.append(f"row_spacing = {_toml(profile.row_spacing)}  # m")
    if isinstance(profile, TableShape):
        theta, rho = np.asarray(profile.knots), np.asarray(profile.coefficients)[:, 0]
        rho = np.append(rho, rho[0])  # closed: a row just before it would be taken for this one
        _check_period(float(profile.knots[-1]), float(rig.wheels.rollers[i]), rig.names[i])
        if files is None:
            columns = f"theta = {_toml(theta)}, rho = {_toml(rho)}"
            return [*lines, f"table = {{ {columns} }}  # rad, m"]
        name = f"{stem}-wheel-{i + 1}.csv"
        rows = [f"{float(x)!r},{float(y)!r}" for x, y in zip(theta, rho, strict=True)]
        files[name] = ("\n".join(["theta,rho", *rows]) + "\n").encode()
        lines.append(f"table = {_toml(name)}")
    return lines


def _check_period(period: float, rollers: float, name: str) -> None:
    if not any(math.isclose(period, x) for x in (2 * math.pi / rollers, 2 * math.pi)):
        raise InputError(
            f"`wheel.{name}.rollers` is {rollers:g}, but the wheel's table repeats after "
            f"{period:.6g} rad, which is neither its pitch nor a turn."
        )


def _effect(law: AbstractLaw, place: str, wheels: int, files) -> list[str]:
    lines, pairs, units = [], [], []
    if not of_library(law, EFFECTS):
        name, text = file_of(type(law))
        lines.append(f"law = {_toml(name)}")
        if files is not None:
            files[name] = text
    for key, parameter in law.parameters.items():
        value = getattr(law, key)
        default = getattr(type(law), key, None) if parameter.optional else None
        if value is None or (default is not None and np.array_equal(value, default)):
            continue
        pairs.append(f"{key} = {_toml(value)}")
        units.append(law_quantity(parameter, place, wheels).unit)
    if pairs:
        lines.append(f"parameters = {{ {', '.join(pairs)} }}  # {', '.join(units)}")
    return lines


def _toml(value: Any, whole: bool = False) -> str:
    """A TOML value: text, a number that reads back to the last bit, or a list of them."""
    if isinstance(value, str):
        return toml_value(value)
    number = np.asarray(value, float).tolist()
    whole = whole and isinstance(number, float) and number.is_integer()
    return str(int(number)) if whole else toml_value(number)
