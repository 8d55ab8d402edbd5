"""Numbers with a unit and a range, as they stand in a rig file: `0.0758` or `"75.8 mm"`."""

import dataclasses
import math
import re
from typing import Any

from pydantic_core import core_schema

from ._units import converted

_NUMBER = re.compile(r"\s*([+-]?(?:\d[\d_]*\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(.*?)\s*\Z")
_COMMA = re.compile(r"\s*([+-]?\d+),(\d+)\s*(.*?)\s*\Z")


@dataclasses.dataclass(frozen=True)
class Quantity:
    """One number: its SI unit and the range it must lie in.

    A pydantic annotation (`Annotated[float, Quantity("kg", above=0)]`) and, by `read`, a check of
    its own.  The errors are the second half of the sentence "`path` must lie in ...".
    """

    unit: str
    low: float = -math.inf
    high: float = math.inf
    above: float | None = None  # an excluded lower end
    whole: bool = False

    @property
    def range(self) -> str:
        """The allowed range as text: `[0, 1]`, `(0, inf)`."""
        return _range_text(self.low, self.high, self.above)

    def read(self, given: Any) -> float:
        """`given` in SI units; raises `ValueError` where it is no number in the range."""
        value = as_number(given, self.unit)
        text = f"{given!r} ({value:g} {self.unit})" if isinstance(given, str) else f"{given!r}"
        if self.whole and value != math.floor(value):
            raise ValueError(f"must be a whole number in {self.range}, but is {text}.")
        too_low = value < self.low if self.above is None else value <= self.above
        if too_low or value > self.high:
            raise ValueError(f"must lie in {self.range}, but is {text}.")
        return value

    def __get_pydantic_core_schema__(self, source, handler):
        return core_schema.no_info_plain_validator_function(self.read)

    def __get_pydantic_json_schema__(self, schema, handler):
        return {**self.json_schema(), "description": f"unit {self.unit}, range {self.range}"}

    def json_schema(self) -> dict:
        """A number in the range, or text with a unit."""
        number: dict[str, Any] = {"type": "integer" if self.whole else "number"}
        if self.above is not None:
            number["exclusiveMinimum"] = self.above
        elif math.isfinite(self.low):
            number["minimum"] = self.low
        if math.isfinite(self.high):
            number["maximum"] = self.high
        return {"anyOf": [number, {"type": "string", "pattern": r"^\s*[+-]?[\d.]"}]}


class Spread:
    """A 1-sigma: a share, an angle ("0.2 deg"), a sensor's delay ("0.2 ms"), a length ("1 mm")."""

    unit, low, high = "1", 0.0, math.inf

    def read(self, given: Any) -> float:
        """`given` as a number above 0 (rad, s, m); raises `ValueError` where it is none."""
        try:
            return Quantity("1", above=0).read(given)
        except ValueError:
            if not isinstance(given, str) or (unit := given.strip()[-1:]) not in ("s", "m"):
                raise
            return Quantity(unit, above=0).read(given)

    def __get_pydantic_core_schema__(self, source, handler):
        return core_schema.no_info_plain_validator_function(self.read)

    def __get_pydantic_json_schema__(self, schema, handler):
        text = "1-sigma: a share, an angle of a direction, a time of a delay, a length"
        return {**Quantity("1", above=0).json_schema(), "description": text}


@dataclasses.dataclass(frozen=True)
class Vector:
    """Numbers of one unit; `unit_length`: of length 1 within 1 %; `nonzero`: not all 0.

    `size` of them, or any number from one on where it is None, each in the range of a `Quantity`.
    """

    unit: str
    unit_length: bool = False
    nonzero: bool = False
    size: int | None = 3
    low: float = -math.inf
    high: float = math.inf
    above: float | None = None  # an excluded lower end

    @property
    def range(self) -> str:
        """The allowed range of each number as text."""
        return _range_text(self.low, self.high, self.above)

    @property
    def _entry(self) -> Quantity:
        return Quantity(self.unit, self.low, self.high, self.above)

    def read(self, given: Any) -> tuple[float, ...]:
        """`given` in SI units; raises `ValueError` where it is no such vector."""
        fits = isinstance(given, list | tuple) and len(given) == (self.size or max(len(given), 1))
        if not fits:
            count = "" if self.size is None else f"{self.size} "
            raise ValueError(f"must be a list of {count}numbers, but is {given!r}.")
        value = tuple(self._entry.read(x) for x in given)
        length = math.hypot(*value)
        if self.unit_length and abs(length - 1) > UNIT_TOLERANCE:
            raise ValueError(
                f"must be a unit vector (length 1 within {100 * UNIT_TOLERANCE:g} %), but "
                f"{given!r} has length {length:.7g}.{_unit(value, length)}"
            )
        if self.nonzero and length == 0:
            raise ValueError("must not be the zero vector: it is a direction.")
        return value

    def __get_pydantic_core_schema__(self, source, handler):
        return core_schema.no_info_plain_validator_function(self.read)

    def __get_pydantic_json_schema__(self, schema, handler):
        return self.json_schema()

    def json_schema(self) -> dict:
        """A list of numbers."""
        item = self._entry.json_schema()
        length = f"unit vector, length 1 within {100 * UNIT_TOLERANCE:g} %"
        text = length if self.unit_length else f"unit {self.unit}"
        size = {"minItems": self.size or 1}
        if self.size is not None:
            size["maxItems"] = self.size
        return {"type": "array", "items": item, **size, "description": text}


def _range_text(low: float, high: float, above: float | None) -> str:
    """`[0, 1]`, `(0, inf)`: the range of a number; `above` is an excluded lower end."""
    left = f"[{low:g}" if above is None else f"({above:g}"
    left = "(-inf" if left == "[-inf" else left
    return f"{left}, {high:g}" + (")" if math.isinf(high) else "]")


def _unit(vector: tuple[float, ...], length: float) -> str:
    """The vector of length 1 along `vector`, to be pasted."""
    if length == 0:
        return ""
    return f" Its direction is [{', '.join(f'{x / length:.7g}' for x in vector)}]."


UNIT_TOLERANCE = 1e-2  # of a direction's length in a file; what reads it makes the length exact
ROUND_OFF = 1e-12  # of a direction's length and of right angles: nothing is to be made exact


@dataclasses.dataclass(frozen=True)
class InertiaTensor:
    """A number (isotropic) or a symmetric, positive definite 3x3 list, kg m^2."""

    unit: str = "kg m^2"

    low = above = 0.0
    high = math.inf
    range = "(0, inf)"

    def read(self, given: Any) -> float | tuple[tuple[float, ...], ...]:
        """`given` in SI units; raises `ValueError` where it is no inertia."""
        if not isinstance(given, list | tuple):
            return Quantity(self.unit, above=0).read(given)
        rows = [row for row in given if isinstance(row, list | tuple) and len(row) == 3]
        if len(given) != 3 or len(rows) != 3:
            raise ValueError(f"must be a number or 3 rows of 3 numbers, but is {given!r}.")
        a = tuple(tuple(as_number(x, self.unit) for x in row) for row in rows)
        size = max(abs(x) for row in a for x in row)
        if any(abs(a[i][j] - a[j][i]) > 1e-9 * size for i in range(3) for j in range(i)):
            raise ValueError(f"must be symmetric, but is {given!r}.")
        minors = (a[0][0], a[0][0] * a[1][1] - a[0][1] * a[1][0], _determinant(a))
        if min(minors) <= 0:
            raise ValueError(f"must be positive definite, but is {given!r}.")
        return a

    def __get_pydantic_core_schema__(self, source, handler):
        return core_schema.no_info_plain_validator_function(self.read)

    def __get_pydantic_json_schema__(self, schema, handler):
        number = Quantity(self.unit, above=0).json_schema()["anyOf"]
        size = {"minItems": 3, "maxItems": 3}
        row = {"type": "array", "items": Quantity(self.unit).json_schema(), **size}
        matrix = {"type": "array", "items": row, **size}
        return {"anyOf": [*number, matrix], "description": "kg m^2, a number or 3x3, body frame"}


def _determinant(a) -> float:
    return sum(a[0][i] * (a[1][i - 2] * a[2][i - 1] - a[1][i - 1] * a[2][i - 2]) for i in range(3))


def as_number(given: Any, unit: str) -> float:
    """A finite number in the SI `unit`, from a number or from text with a unit.

    Raises `ValueError` with what the value must be.
    """
    if isinstance(given, str):
        return _from_text(given, unit)
    if isinstance(given, bool) or not isinstance(given, int | float):
        kind = "a number" if unit == "1" else f"a number ({unit})"
        raise ValueError(f"must be {kind}, but is {given!r}.")
    try:
        value = float(given)
    except OverflowError:
        value = math.inf
    return _sized(value, given)


SMALLEST, LARGEST = 1e-30, 1e30  # of any number in SI; beyond them sums of squares overflow


def _sized(value: float, given: Any) -> float:
    """`value`, which is finite and of a size that arithmetic takes."""
    if not math.isfinite(value):
        raise ValueError(f"must be finite, but is {given!r}.")
    if value != 0 and not SMALLEST <= abs(value) <= LARGEST:
        raise ValueError(f"must be 0 or {SMALLEST:g} to {LARGEST:g} in size, but is {given!r}.")
    return value


def _from_text(text: str, unit: str) -> float:
    """`"188.2 kN/m"` in N/m; turns become radians (or hertz) as the target asks."""
    wanted = "a plain number" if unit == "1" else f"a number in {unit} or text with such a unit"
    refusal = f"must be {wanted}, but is {text!r}."
    match = _NUMBER.match(text)
    if not match or not (match[2] or unit in {"1", "rad"}):
        raise ValueError(f"{refusal}{_remedy(text, unit)}")
    value = float(match[1].replace("_", ""))
    if match[2] != unit:
        try:
            value = converted(value, match[2], unit)
        except ValueError as error:
            raise ValueError(f"{refusal} {_remedy(text, unit).strip() or error}".strip()) from None
    if not math.isfinite(value):
        raise ValueError(f"must be finite, but is {text!r}.")
    return float(value)


def _remedy(text: str, unit: str) -> str:
    """What the text was meant to be, where that can be told."""
    comma = _COMMA.match(text)
    if comma:
        return f" Write {f'{comma[1]}.{comma[2]} {comma[3]}'.strip()!r}, with a point."
    number = _NUMBER.match(text)
    if unit != "1" and number and not number[2]:
        return f" Write the number without quotes, or {f'{text.strip()} {unit}'!r}."
    return ""
