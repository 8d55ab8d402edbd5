"""Units as data sheets write them: `Nm`, `mNm`, `Ns/m`, `kgm²`, `kgm^2`, `1/min`."""

import functools
import math
import re
from typing import Any, NamedTuple

from .._strange import strange_unit

_GLUED = re.compile(  # N or kg with what is written against it: "mNm" is mN m, "Ns/m" is N s/m
    r"(?<![^\W\d_])([kMmµμuc]?N|k?g)(mm|cm|m)?(s)?(?=[\^²³/*·⋅\s\d)]|$)"
)
_WORDS = {"U/min": "rpm", "rev/min": "rpm", "r/min": "rpm", "°": "deg", "°/s": "deg/s"}

SPELLINGS = {  # SI unit -> spellings of it that are understood, for a refusal
    "m": "m, mm, µm",
    "kg": "kg, g",
    "s": "s, ms, min",
    "N": "N, mN, kN",
    "N m": "N m (or Nm), mN m, kN m",
    "N/m": "N/m, N/mm, kN/m",
    "N s/m": "N s/m (or Ns/m), kN s/m, kg/s",
    "kg m^2": "kg m^2 (or kgm²), kg cm², g cm²",
    "rad": "rad, deg, mrad",
    "rad/s": "rad/s, rpm, deg/s",
    "Hz": "Hz, kHz, rpm",
    "m/s": "m/s, mm/s, km/h",
    "m/s^2": "m/s^2 (or m/s²), mm/s²",
}


def spelled(unit: str) -> str:
    """` Spellings that work: ...` for an SI unit; empty where none are listed."""
    known = SPELLINGS.get(unit)
    return f" Units that work here: {known}." if known else ""


def converted(number: float, given: str, unit: str) -> float:
    """`number` of the unit `given` in the SI unit `unit`; `ValueError` says what does not fit.

    A turn is 2 pi rad: what has radians and what has none differ by it between rad/s and Hz.
    """
    apart = _apart(given)
    source, target = _plain(apart), _plain(unit)
    if source is None or target is None:
        factor, turns = _by_pint(apart, unit)
    elif source.dimension != target.dimension:
        raise ValueError(spelled(unit).strip())
    else:
        factor, turns = source.factor / target.factor, source.turns
    if unit == "rad/s" and not turns:
        factor *= 2 * math.pi
    if unit == "Hz" and turns:
        factor /= 2 * math.pi
    return number * factor


class _Unit(NamedTuple):
    """A unit as a factor to SI, powers of m, kg, s, and whether it counts an angle."""

    factor: float
    dimension: tuple[int, int, int] = (0, 0, 0)
    turns: bool = False


_PREFIX = {"": 1.0, "n": 1e-9, "µ": 1e-6, "μ": 1e-6, "u": 1e-6, "m": 1e-3, "c": 1e-2, "k": 1e3}
_PREFIX |= {"M": 1e6, "G": 1e9}
_BASE = {
    "m": _Unit(1.0, (1, 0, 0)),
    "g": _Unit(1e-3, (0, 1, 0)),
    "s": _Unit(1.0, (0, 0, 1)),
    "N": _Unit(1.0, (1, 1, -2)),
    "Pa": _Unit(1.0, (-1, 1, -2)),
    "Hz": _Unit(1.0, (0, 0, -1)),
    "rad": _Unit(1.0, turns=True),
}
_WHOLE = {
    "1": _Unit(1.0),
    "%": _Unit(1e-2),
    "deg": _Unit(math.pi / 180, turns=True),
    "rpm": _Unit(2 * math.pi / 60, (0, 0, -1), True),
    "min": _Unit(60.0, (0, 0, 1)),
    "h": _Unit(3600.0, (0, 0, 1)),
}
_POWERS = str.maketrans({"²": "^2", "³": "^3", "·": "*", "⋅": "*"})
_ATOM = re.compile(r"([A-Za-zµμ%]+|1)(?:(?:\^|\*\*)(-?\d))?")


def _plain(unit: str) -> _Unit | None:
    """The unit where it is made of those that machines are described by; None asks Pint.

    Pint takes most of a second to begin, as long as the rest of reading a rig file.
    """
    above, *below = unit.translate(_POWERS).split("/")
    if len(below) > 1:
        return None
    factor, dimension, turns = 1.0, (0, 0, 0), False
    for part, sign in ((above, 1), *((x, -1) for x in below)):
        for word in part.replace("**", "^").replace("*", " ").split():
            match = _ATOM.fullmatch(word)
            atom = _atom(match[1]) if match else None
            if match is None or atom is None:
                return None
            power = sign * int(match[2] or 1)
            factor *= atom.factor**power
            (m, kg, s), own = dimension, atom.dimension
            dimension = m + power * own[0], kg + power * own[1], s + power * own[2]
            turns = turns or atom.turns
    return _Unit(factor, dimension, turns)


def _atom(word: str) -> _Unit | None:
    if word in _WHOLE:
        return _WHOLE[word]
    for symbol, base in _BASE.items():
        prefix = word.removesuffix(symbol)
        if word.endswith(symbol) and prefix in _PREFIX:
            return base._replace(factor=base.factor * _PREFIX[prefix])
    return None


def _by_pint(given: str, unit: str) -> tuple[float, bool]:
    """The factor from `given` to `unit`, and whether `given` counts an angle."""
    import pint

    if strange_unit(given):
        raise ValueError(f"Its unit is not known.{spelled(unit)}")
    registry = _registry()
    try:
        source, target = registry.parse_units(given), registry.parse_units(unit)
        factor = registry.Quantity(1.0, source).to(target).magnitude
    except (pint.DimensionalityError, pint.OffsetUnitCalculusError):
        raise ValueError(spelled(unit).strip()) from None
    except Exception:  # pint's parser raises many kinds for what is not a unit
        raise ValueError(f"Its unit is not known.{spelled(unit)}") from None
    return float(factor), "radian" in str(registry.Quantity(1, source).to_root_units().units)


def _apart(unit: str) -> str:
    """The unit with a space between its parts, as Pint reads it."""
    unit = _WORDS.get(unit, unit)
    return _GLUED.sub(lambda match: " ".join(part for part in match.groups() if part), unit)


@functools.cache
def _registry() -> Any:
    import pint  # half a second, so only once a text with a unit is met

    return pint.UnitRegistry()
