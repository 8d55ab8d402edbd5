"""What `[uncertainty]` may speak of, in which unit, and what of it a rig leaves open.

A number or a tensor is uncertain by a share of itself.  A direction is by an angle (`normal`,
`drive` and gravity are tilted, `zenith`, `azimuth` and `skew` are the angles themselves), the
sphere's centre of mass by a length along each axis, a sensor by its gain and its delay.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from ._directions import ANGLES
from ._machine import Rig
from ._parameters import parameter_info, value_at
from ._quantities import Quantity
from ._schema import GROUPS

DIRECTIONS = ("normal", "drive")
CENTRE, GRAVITY, SENSOR = "sphere.centre_of_mass", "platform.gravity", "sensor"
PARTS = ("contact", "mount", "closure")
_WORDS = {"rad": 'an angle such as "0.2 deg"', "s": 'a time such as "0.2 ms"',
          "m": 'a length such as "1 mm"', "1": "a share such as 0.1"}  # fmt: skip


def open_paths(names: Sequence[str]) -> dict[str, str]:
    """Unit of what may be uncertain otherwise than by a share of itself, by path."""
    units = {CENTRE: "m", GRAVITY: "rad"}
    for group in GROUPS:
        units |= {f"{SENSOR}.{group}.gain": "1", f"{SENSOR}.{group}.delay": "s"}
    for key in (*DIRECTIONS, *ANGLES):
        units |= {f"wheel.{key}": "rad", **{f"wheel.{name}.{key}": "rad" for name in names}}
    return units


def wrong_unit(path: str, given: Any, units: Mapping[str, str]) -> str | None:
    """Why text is no 1-sigma of `path`, in words; None where it is one, and for numbers."""
    if not isinstance(given, str):
        return None
    unit = units.get(path, "1")
    try:
        Quantity(unit, above=0).read(given)
        strange = unit == "1" and re.search(r"[^\W\d_]|°", re.sub(r"\d[eE][-+]?\d", "", given))
    except ValueError:
        strange = True
    return f"`uncertainty.{path}` must be {_WORDS[unit]}, but is {given!r}." if strange else None


def uncertain_numbers(rig: Rig) -> dict[str, float]:
    """1-sigma of everything that `rig` leaves open, by path; what all wheels have, one a wheel."""
    sigmas: dict[str, float] = {}
    for path, sigma in rig.uncertainty:
        parts = path.split(".")
        rest = path if parts[0] in PARTS else ".".join(parts[1:])
        of_all = parts[0] in PARTS or (parts[0] == "wheel" and parts[1] not in rig.names)
        if not of_all:
            sigmas[path] = sigma
            continue
        for name in rig.names:  # what is said of one wheel holds
            sigmas.setdefault(f"wheel.{name}.{rest}", sigma)
    return sigmas


def closed_numbers(rig: Rig) -> list[str]:
    """What `[uncertainty]` lists and nothing can be left open of, a sentence each."""
    return list(dict.fromkeys(_closed(rig)))


def _closed(rig: Rig) -> Iterator[str]:
    units, zeros = open_paths(rig.names), []
    for path in uncertain_numbers(rig):
        if path == GRAVITY and not np.any(np.asarray(rig.platform.gravity)):
            yield f"`uncertainty.{path}` tilts gravity, but the rig has none: leave it out."
        if path in units:
            continue
        value = np.asarray(value_at(rig, path))
        if value.ndim == 1 and parameter_info(rig, path).unit == "1":
            yield f"`uncertainty.{path}` is the direction of an effect: a share leaves it as it is."
        elif not np.any(value):
            zeros.append(path)
    if zeros:
        one = len(zeros) == 1
        yield (
            f"{' and '.join(f'`{path}`' for path in zeros)} {'is' if one else 'are'} 0 in the rig "
            f"and uncertain by a share, and a share of 0 is nothing: put the size that "
            f"{'it' if one else 'each'} may have into the rig, or leave it out of [uncertainty]."
        )
