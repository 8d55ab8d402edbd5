"""A wheel's directions from angles, and vectors near unit length made exact.

    e = (sin z cos a, sin z sin a, cos z)        sphere centre -> wheel, zenith z from +z (up)
    normal = -e                                  wheel -> sphere centre
    drive = cos s (-sin a, cos a, 0) + sin s (cos z cos a, cos z sin a, -sin z)

with the azimuth a from +x towards +y and the skew s, zero where the rim runs along the sphere's
circle of latitude and positive where it turns towards the lower pole.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from ._quantities import ROUND_OFF, UNIT_TOLERANCE, Quantity, Vector

ANGLES = {name: Quantity("rad") for name in ("zenith", "azimuth", "skew")}
LARGEST = {"zenith": math.pi}  # rad without a unit; of the others a turn: more is meant in degrees
_VECTORS = {name: Vector("1", unit_length=True) for name in ("normal", "drive")}


class Directions(NamedTuple):
    """The tables with exact vectors, what was changed, and what cannot be used."""

    data: Mapping[str, Any]
    notes: list[str]
    problems: list[str]


def directed(data: Mapping[str, Any]) -> Directions:
    """Tables of a rig in which every wheel has an exact `normal` and `drive`, where it can."""
    blocks = data.get("wheel")
    if not isinstance(blocks, list) or not all(isinstance(block, Mapping) for block in blocks):
        return Directions(data, [], [])
    notes: list[str] = []
    problems: list[str] = []
    wheels = []
    for number, block in enumerate(blocks, 1):
        name = f"wheel.{block.get('name') or number}"
        if set(ANGLES) & set(block):
            wheels.append(_from_angles(name, block, problems))
        else:
            wheels.append(_exact(name, block, notes))
    return Directions({**data, "wheel": wheels}, notes, problems)


def unit_vectors(zenith: float, azimuth: float, skew: float = 0.0) -> tuple[list, list]:
    """`normal` and `drive` of a wheel at these angles in rad."""
    sz, cz, sa, ca = math.sin(zenith), math.cos(zenith), math.sin(azimuth), math.cos(azimuth)
    along, down = (-sa, ca, 0.0), (cz * ca, cz * sa, -sz)
    drive = [math.cos(skew) * a + math.sin(skew) * d for a, d in zip(along, down, strict=True)]
    normal = [-sz * ca, -sz * sa, -cz]
    return _clean(normal), _clean(drive)


def exact_vectors(
    normal: Sequence[float], drive: Sequence[float]
) -> tuple[Sequence[float], Sequence[float]]:
    """A wheel's two directions with length 1 at right angles; as they are where they nearly are.

    `normal` keeps its direction.
    """
    length = math.hypot(*normal), math.hypot(*drive)
    off = max(abs(length[0] - 1), abs(length[1] - 1), abs(_dot(normal, drive)))
    if off <= ROUND_OFF:
        return normal, drive
    unit = [x / length[0] for x in normal]
    dot = _dot(unit, drive)
    across = [b - dot * a for a, b in zip(unit, drive, strict=True)]
    size = math.hypot(*across)
    return unit, [x / size for x in across]


def not_perpendicular(normal: Sequence[float], drive: Sequence[float]) -> str:
    """What is wrong with the angle between them, behind `drive`; empty where it is a right one."""
    dot = _dot(normal, drive)
    if abs(dot) <= UNIT_TOLERANCE:
        return ""
    return (
        f"must be perpendicular to `normal` (dot product 0 within {UNIT_TOLERANCE:g}), but their "
        f"dot product is {dot:.7g}."
    )


def _dot(one: Sequence[float], other: Sequence[float]) -> float:
    return sum(a * b for a, b in zip(one, other, strict=True))


def _clean(vector: list[float]) -> list[float]:
    """The vector without the rounding of cosines of a right angle."""
    return [0.0 if abs(x) < 1e-15 else x for x in vector]


def _from_angles(name: str, block: Mapping, problems: list[str]) -> dict[str, Any]:
    """The wheel with vectors in the place of its angles; without both where they are wrong."""
    rest = {key: value for key, value in block.items() if key not in ANGLES}
    both = [key for key in _VECTORS if key in block]
    missing = [key for key in ("zenith", "azimuth") if key not in block]
    wrong = [f"`{name}` has angles and `{key}`: give one of the two." for key in both]
    wrong += [f'`{name}.{key}` is missing. Give an angle such as "45 deg".' for key in missing]
    angles = {}
    for key, quantity in ANGLES.items():
        try:
            angles[key] = _angle(key, quantity, block.get(key, 0.0))
        except ValueError as error:
            wrong.append(f"`{name}.{key}` {error}")
    problems += wrong
    normal, drive = ([1, 0, 0], [0, 0, 1]) if wrong else unit_vectors(**angles)
    return rest | {"normal": normal, "drive": drive}


def _angle(key: str, quantity: Quantity, given: Any) -> float:
    """An angle in rad; `ValueError` where it has no unit and can only be meant in degrees."""
    value = quantity.read(given)
    plain = not isinstance(given, str) or given.strip()[-1] in ".0123456789"
    if plain and abs(value) > LARGEST.get(key, 2 * math.pi):
        raise ValueError(f'= {given} without a unit is in rad; did you mean "{given} deg"?')
    return value


def _exact(name: str, block: Mapping, notes: list[str]) -> dict[str, Any]:
    """The wheel with vectors of length 1 at right angles, where they nearly are; notes say so."""
    try:
        normal, drive = (vector.read(block[key]) for key, vector in _VECTORS.items())
    except (KeyError, ValueError):
        return dict(block)  # the schema tells of it
    if not_perpendicular(normal, drive):
        return dict(block)  # `problems` tells of it
    exact = exact_vectors(normal, drive)
    if exact == (normal, drive):
        return dict(block)
    length = math.hypot(*normal), math.hypot(*drive)
    between = math.degrees(math.asin(_dot(normal, drive) / (length[0] * length[1])))
    notes.append(
        f"`{name}`: `normal` has length {length[0]:.6g} and `drive` {length[1]:.6g}, with "
        f"{90 - between:.4g}° between them; they are taken as directions at right angles."
    )
    return {**block, **dict(zip(_VECTORS, exact, strict=True))}
