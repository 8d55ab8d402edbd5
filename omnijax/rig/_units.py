"""Units as data sheets write them: `Nm`, `mNm`, `Ns/m`, `kgm²`, `kgm^2`, `1/min`."""

import functools
import math
import re
from typing import Any

_GLUED = re.compile(  # N or kg with what is written against it: "mNm" is mN m, "Ns/m" is N s/m
    r"(?<![^\W\d_])([kMmµμuc]?N|k?g)(mm|cm|m)?(s)?(?=[\^²³/*·⋅\s\d)]|$)"
)
_WORDS = {"U/min": "rpm", "rev/min": "rpm", "r/min": "rpm", "°": "deg"}

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

    Pint counts radians as 1, so that 1 Hz would be 1 rad/s: a turn is 2 pi rad.
    """
    import pint

    registry = _registry()
    try:
        source, target = registry.parse_units(_apart(given)), registry.parse_units(unit)
        value = registry.Quantity(number, source).to(target).magnitude
    except (pint.DimensionalityError, pint.OffsetUnitCalculusError):
        raise ValueError(spelled(unit).strip()) from None
    except Exception:  # pint's parser raises many kinds for what is not a unit
        raise ValueError(f"Its unit is not known.{spelled(unit)}") from None
    turns = "radian" in str(registry.Quantity(1, source).to_root_units().units)
    if unit == "rad/s" and not turns:
        value *= 2 * math.pi
    if unit == "Hz" and turns:
        value /= 2 * math.pi
    return float(value)


def _apart(unit: str) -> str:
    """The unit with a space between its parts, as Pint reads it."""
    unit = _WORDS.get(unit, unit)
    return _GLUED.sub(lambda match: " ".join(part for part in match.groups() if part), unit)


@functools.cache
def _registry() -> Any:
    import pint  # half a second, so only once a text with a unit is met

    return pint.UnitRegistry()
