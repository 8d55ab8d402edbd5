"""Wheel speeds over time from a table: the drive of a run-up."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from .._errors import InputError
from ..rig import converted
from ._formats import read_table

_HEAD = re.compile(r"(.*?)\s*(?:[\[(](.*)[\])])?")  # speed_1, speed_w1 (rpm), t [ms]


class SpeedTable(NamedTuple):
    """Prescribed wheel speeds at times; linear between them."""

    time: np.ndarray  # (k,) s, from 0
    speed: np.ndarray  # (k, n) rad/s
    force: np.ndarray | None  # (k, 3) N


def speed_table(path: Path, names: Sequence[str]) -> SpeedTable | None:
    """The table of speeds in a file with columns t, speed_1, ... or speed_NAME; else None.

    A header may carry its unit: `speed_1 (rpm)`.  Raises `InputError` for a table that has speeds
    but not those of every wheel, gaps, or times that do not increase.
    """
    if not path.is_file():
        return None  # the reader of recordings says so, with the nearest name
    table = read_table(path)
    units = {"t": "s", "force": "N", "speed": "rad/s"}
    columns: dict[str, np.ndarray] = {}
    for head, values in table.columns.items():
        match = _HEAD.fullmatch(head.strip())
        name, unit = (match[1], match[2] or table.units.get(head)) if match else (head, None)
        wanted = units.get(name.partition("_")[0])
        if wanted is not None:
            columns[name] = values * _factor(path, head, unit or wanted, wanted)
    if not any(name.startswith("speed_") for name in columns):
        return None
    torque = next((head for head in table.columns if head.strip().startswith("torque")), None)
    if torque is not None:
        raise InputError(
            f"has speeds and `{torque}`: leave out which of them does not drive.", path
        )
    wheels = [
        next((c for c in (f"speed_{name}", f"speed_{i}") if c in columns), None)
        for i, name in enumerate(names, 1)
    ]
    more = [c for c in columns if c.startswith("speed_") and c not in wheels]
    if more and None not in wheels:
        raise InputError(
            f"has the column `{more[0]}`, but the rig has the wheels {', '.join(names)}.", path
        )
    missing = [f"`speed_{i}`" for i, c in enumerate(wheels, 1) if c is None]
    if missing or "t" not in columns:
        lacks = ", ".join([*missing, *([] if "t" in columns else ["`t`"])])
        raise InputError(
            f"lacks the column {lacks} of a table of speeds; columns: {', '.join(table.columns)}.",
            path,
        )
    return _checked(path, columns, [str(c) for c in wheels])


def _factor(path: Path, head: str, unit: str, wanted: str) -> float:
    try:
        return converted(1.0, unit, wanted)
    except ValueError as error:
        raise InputError(
            f"column `{head}`: {unit!r} is no unit of {wanted}. {error}", path
        ) from None


def _checked(path: Path, columns: dict[str, np.ndarray], wheels: list[str]) -> SpeedTable:
    time = columns["t"]
    push = [f"force_{axis}" for axis in "xyz"]
    force = np.stack([columns[c] for c in push], axis=1) if set(push) <= set(columns) else None
    speed = np.stack([columns[c] for c in wheels], axis=1)
    for name in ("t", *wheels):
        good = np.isfinite(columns[name])
        if not good.all():
            row = int(np.argmin(good)) + 1
            raise InputError(
                f"column `{name}`, row {row} has no number: a drive needs every time and speed.",
                path,
            )
    back = np.flatnonzero(np.diff(time) < 0)
    if len(back):
        row, (before, after) = int(back[0]) + 2, time[back[0] : back[0] + 2]
        raise InputError(
            f"`t` must not decrease, but row {row} has {after:g} after {before:g}.", path
        )
    if len(time) < 2 or time[-1] == time[0]:
        raise InputError(f"`t` must reach beyond its first value, {time[0]:g}.", path)
    return SpeedTable(time - time[0], speed, force)
