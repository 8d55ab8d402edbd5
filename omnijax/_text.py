"""Values with units as people read them: 0.4 µm, 188 kN/m."""

import math
import re
from collections.abc import Iterable, Sequence

import numpy as np

_PREFIX = {-9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G"}
_PREFIXED = re.compile(r"(m|s|N|Pa|Hz|rad|A|V|W)([ /]|$)")  # a prefix stands before such a unit
DEGREES = 0.01  # rad; angles from here on are said in degrees, smaller ones in mrad


def scaled(value: float, unit: str) -> tuple[float, str]:
    """(factor, unit) in which `value` reads well: 4e-7 m is 0.4 µm, so (1e6, "µm")."""
    unit = "" if unit == "1" else unit
    if unit == "rad" and abs(value) >= DEGREES:
        return 180 / math.pi, "°"
    if value == 0 or not math.isfinite(value) or not _PREFIXED.match(unit):
        return 1.0, written(unit)
    digits = math.log10(abs(value)) + (1 if abs(value) < 1 else 0)  # 0.4 µm, but 188 kN/m
    power = int(np.clip(3 * math.floor(digits / 3), -9, 9))
    return 10.0**-power, _PREFIX[power] + written(unit)


def scaled_together(values: Sequence[float], unit: str) -> tuple[float, str]:
    """(factor, unit) in which several sizes of one quantity read well.

    The unit suits the least size above 0, unless the largest would then have five digits.
    """
    sizes = [value for value in values if value > 0] or [0.0]
    factor, name = scaled(min(sizes), unit)
    return (factor, name) if max(sizes) * factor < 1e4 else scaled(max(sizes), unit)


def written(unit: str) -> str:
    """A unit as people write it: m/s² for m/s^2."""
    return "" if unit == "1" else unit.replace("^2", "²").replace("^3", "³")


def quantity_text(value: float, unit: str) -> str:
    """A value with its unit, prefixed where that reads better."""
    factor, name = scaled(value, unit)
    return _with(f"{value * factor:.4g}", name)


def _with(number: str, unit: str) -> str:
    return f"{number}{'' if unit in ('', '°') else ' '}{unit}"


FIGURES = 4  # of a value, also where its 1-sigma is smaller than the last of them


def estimate(value: float, sigma: float | None, unit: str) -> str:
    """A value with its 1-sigma and unit, "5.660 ± 0.002 µm"; as many places as the sigma shows.

    Four figures at most; a smaller sigma is rounded up to one in the last place.
    """
    return _with(*estimated(value, sigma, unit))


def estimated(value: float, sigma: float | None, unit: str) -> tuple[str, str]:
    """`estimate` as number and unit."""
    if sigma is None or not 0 < sigma < math.inf or not math.isfinite(value):
        factor, name = scaled(value, unit)
        return f"{value * factor:.4g}", name
    factor, name = scaled(max(abs(value), sigma), unit)
    value, sigma = value * factor, sigma * factor
    if not 1e-4 < max(abs(value), sigma) < 1e6:
        return f"{value:.4g} ± {sigma:.2g}", name
    places = max(0, 1 - math.floor(math.log10(sigma)))
    if abs(value) > sigma:
        places = min(places, max(0, FIGURES - 1 - math.floor(math.log10(abs(value)))))
    sigma = max(sigma, 10.0**-places)
    return f"{value:.{places}f} ± {sigma:.{places}f}", name


def label(name: str, unit: str) -> str:
    """Text of an axis."""
    return f"{name} ({unit})" if unit else name


def listed(words: Sequence[str], joined: str = "and") -> str:
    """Words in a sentence: "a", "a and b", "a, b and c"."""
    *rest, last = words
    return f"{', '.join(rest)} {joined} {last}" if rest else last


_TABLES = ("contact", "mount", "closure")
_GIVEN = {"speed": "speed of ", "torque": "torque of ", "angle": "angle of ", "force": "force in "}


def split_names(given: str | Iterable[str]) -> list[str]:
    """Names in a list, or in text with commas between, without blanks about them."""
    return [name.strip() for name in (given.split(",") if isinstance(given, str) else given)]


def path_words(path: str) -> str:
    """A parameter's path as people say it: `wheel.w2.contact.stiffness`, "contact stiffness of w2".

    `contact.stiffness` is "contact stiffness", `speed.w1` "speed of w1".
    """
    head, *rest = path.split(".")
    last = [part.replace("_", " ") for part in rest]
    if head == "effect" and len(rest) == 3:
        said = f"{last[2]} of {rest[0]} at {rest[1]}"
    elif head == "wheel" and len(rest) > 1 and rest[0] not in _TABLES:
        said = f"{' '.join(last[1:])} of {rest[0]}"
    elif head in _GIVEN and rest:
        said = "scale of the speeds" if rest == ["scale"] else _GIVEN[head] + rest[-1]
    else:
        said = " ".join([head.replace("_", " "), *last])
    return said
