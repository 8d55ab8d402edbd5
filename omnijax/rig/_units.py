"""Units as data sheets write them: `Nm`, `mNm`, `Ns/m`, `kgm²`, `kgm^2`, `1/min`."""

import functools
import math
import re
from typing import Any, NamedTuple

from .._strange import strange_unit

_GLUED = re.compile(  # N or kg with what is written against it: "mNm" is mN m, "Ns/m" is N s/m
    r"(?<![^\W\d_])([kMmµμuc]?N|k?g)(mm|cm|m)?(s)?(?=[\^²³/*·⋅\s\d)]|$)"
)
_WORDS = {"U/min": "rpm", "turn/min": "rpm", "r/min": "rpm", "°": "deg", "°/s": "deg/s"}
_WORDS |= {"dps": "deg/s", "cps": "Hz"}
_OTHERS = {"rev": "turn", "revs": "turn"}  # names that Pint has under another one
_ANY_CASE = {"rpm", "rps", "deg", "degree", "degrees", "rad", "radian", "radians", "rev", "revs"}
_ANY_CASE |= {"turn", "turns", "revolution", "revolutions", "sec", "second", "seconds"}
_NAME = re.compile(r"[A-Za-z]{3,}")
_JOINED = re.compile(r"(?<=[A-Za-zµμ])[-.](?=[A-Za-zµμ])")  # N-m, rad.s-1
_NO_ANGLE = re.compile(
    r"\b[MG]rad\b"
)  # a German degree and mrad in the wrong case: 1e9 and 1e6 rad
_RAISED = re.compile(r"(?<=[A-Za-zµμ])(-[1-4]|[2-4])(?!\w)")  # m s-2, m/s2
_COUNTS = {"count", "bit", "byte"}
_CYCLES = {"hertz", "minute", "hour"}
_GRAVITY = 9.80665  # m/s^2, CGPM 1901
GRAVITIES = {"g": _GRAVITY, "G": _GRAVITY, "mg": 1e-3 * _GRAVITY, "mG": 1e-3 * _GRAVITY}
GRAVITIES |= {unit: 1e-6 * _GRAVITY for unit in ("µg", "μg", "ug")}  # of a measured acceleration

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
    "m/s^2": "m/s^2 (or m/s²), mm/s², g_n",
}


def spelled(unit: str) -> str:
    """` Spellings that work: ...` for an SI unit; empty where none are listed."""
    known = SPELLINGS.get(unit)
    return f" Units that work here: {known}." if known else ""


def converted(number: float, given: str, unit: str) -> float:
    """`number` of the unit `given` in the SI unit `unit`; `ValueError` says what does not fit.

    A turn is 2 pi rad, and so is a cycle: Hz and 1/min differ by it from rad/s.  1/s is a rad/s.
    """
    if not_an_angle := _NO_ANGLE.search(given):
        raise ValueError(f"`{not_an_angle[0]}` is no unit of an angle.{spelled('rad')}")
    apart = _apart(given)
    source, target = _plain(apart), _plain(unit)
    if source is None or target is None:
        factor, turns, cycles = _by_pint(apart, unit)
    elif source.dimension != target.dimension:
        raise ValueError(spelled(unit).strip())
    else:
        factor, turns, cycles = source.factor / target.factor, source.turns, source.cycles
    if unit == "rad/s" and cycles and not turns:
        factor *= 2 * math.pi
    if unit == "Hz" and turns:
        factor /= 2 * math.pi
    return number * factor


class _Unit(NamedTuple):
    """A unit as a factor to SI, powers of m, kg, s, and whether it counts an angle or cycles."""

    factor: float
    dimension: tuple[int, int, int] = (0, 0, 0)
    turns: bool = False
    cycles: bool = False


_PREFIX = {"": 1.0, "n": 1e-9, "µ": 1e-6, "μ": 1e-6, "u": 1e-6, "m": 1e-3, "c": 1e-2, "k": 1e3}
_PREFIX |= {"M": 1e6, "G": 1e9}
_BASE = {
    "m": _Unit(1.0, (1, 0, 0)),
    "g": _Unit(1e-3, (0, 1, 0)),
    "s": _Unit(1.0, (0, 0, 1)),
    "N": _Unit(1.0, (1, 1, -2)),
    "Pa": _Unit(1.0, (-1, 1, -2)),
    "Hz": _Unit(1.0, (0, 0, -1), cycles=True),
    "rad": _Unit(1.0, turns=True),
}
_WHOLE = {
    "1": _Unit(1.0),
    "%": _Unit(1e-2),
    "deg": _Unit(math.pi / 180, turns=True),
    "rpm": _Unit(2 * math.pi / 60, (0, 0, -1), True),
    "min": _Unit(60.0, (0, 0, 1), cycles=True),
    "h": _Unit(3600.0, (0, 0, 1), cycles=True),
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
    factor, dimension, turns, cycles = 1.0, (0, 0, 0), False, False
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
            turns, cycles = turns or atom.turns, cycles or atom.cycles
    return _Unit(factor, dimension, turns, cycles)


def _atom(word: str) -> _Unit | None:
    if word in _WHOLE:
        return _WHOLE[word]
    for symbol, base in _BASE.items():
        prefix = word.removesuffix(symbol)
        if word.endswith(symbol) and prefix in _PREFIX:
            return base._replace(factor=base.factor * _PREFIX[prefix])
    return None


def _by_pint(given: str, unit: str) -> tuple[float, bool, bool]:
    """The factor from `given` to `unit`, and whether `given` counts an angle, and cycles."""
    import pint

    if strange_unit(given):
        raise ValueError(f"Its unit is not known.{spelled(unit)}")
    registry = _registry()
    try:
        source, target = registry.parse_units(given), registry.parse_units(unit)
        names = {name for name, _ in registry.Quantity(1, source).unit_items()}
        factor = registry.Quantity(1.0, source).to(target).magnitude
    except (pint.DimensionalityError, pint.OffsetUnitCalculusError):
        raise ValueError(spelled(unit).strip()) from None
    except Exception:  # pint's parser raises many kinds for what is not a unit
        raise ValueError(f"Its unit is not known.{spelled(unit)}") from None
    if names & _COUNTS and unit in ("rad", "rad/s"):
        raise ValueError(f"How many make a turn is not known: convert them.{spelled(unit)}")
    turns = "radian" in str(registry.Quantity(1, source).to_root_units().units)
    return float(factor), turns, bool(names & _CYCLES)


def _apart(unit: str) -> str:
    """The unit with a space between its parts and powers by `^`, as Pint reads it."""
    unit = _NAME.sub(_named, _JOINED.sub(" ", unit))
    unit = _RAISED.sub(r"^\1", _WORDS.get(unit, unit))
    return _GLUED.sub(lambda match: " ".join(part for part in match.groups() if part), unit)


def _named(match: re.Match[str]) -> str:
    """A name in small letters where those alone are known, and as Pint calls it."""
    lower = match[0].lower()
    name = lower if lower in _ANY_CASE else match[0]
    return _OTHERS.get(name, name)


@functools.cache
def _registry() -> Any:
    import pint  # half a second, so only once a text with a unit is met

    return pint.UnitRegistry()
