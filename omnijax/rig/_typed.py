"""Numbers as a person types them: `"30 rpm, 0, 10 rpm"`, `["30 rpm", 0, 10]`, `"2 s"`."""

import operator
import re
from contextlib import suppress
from typing import Any

import numpy as np

from .._errors import InputError, not_above_zero
from ._quantities import as_number

_SEVERAL = re.compile(r"\s*[-+\d.eE]+(\s+[-+]?[\d.][-+\d.eE]*)+\s*\Z")


def typed_number(name: str, text: str, unit: str) -> float:
    """A number in SI from text with or without a unit; `InputError` says `name`."""
    number: str | float = text
    with suppress(ValueError):  # text with a unit, or nothing that makes sense
        number = float(text)
    try:
        return as_number(number, unit)
    except ValueError as error:
        raise InputError(f"`{name}` {error}") from None


def typed_above_zero(name: str, given: Any, unit: str) -> float:
    """A finite number above 0 in SI, from text as `typed_number` or as it is.

    Raises `InputError`, in which the value is called `name`.
    """
    plain = given.item() if hasattr(given, "item") and np.ndim(given) == 0 else given
    try:
        value = typed_number(name, plain, unit) if isinstance(plain, str) else float(plain)
    except TypeError:
        value = None
    if value is None or isinstance(plain, bool):
        raise InputError(f"`{name}` must be one number{_of(unit)}, but is {given!r}.")
    if wrong := not_above_zero("" if unit == "1" else unit, **{name: value}):
        raise InputError(wrong)
    return value


def whole_number(name: str, given: Any, low: int = 1) -> int:
    """`given` as a plain int, from Python's or NumPy's, from `low` on.

    Raises `InputError`, in which the value is called `name`, for what is no whole number.
    """
    try:
        value = None if isinstance(given, bool) else operator.index(given)
    except TypeError:
        value = None
    if value is None or value < low:
        raise InputError(f"`{name}` must be a whole number in [{low}, inf), but is {given!r}.")
    return value


def _of(unit: str) -> str:
    return "" if unit == "1" else f" ({unit})"


def typed_numbers(name: str, given: Any, unit: str) -> Any:
    """Numbers in SI from text with commas between, or from a list in which texts may stand.

    An array or a pandas Series of texts is such a list.  What holds no text (other arrays, traced
    values, plain lists) comes back as it is.  `InputError` names every entry that is no number, as
    truth values and complex ones are none.
    """
    if getattr(getattr(given, "dtype", None), "kind", "") in ("U", "O"):
        given = given.tolist()
    check_real(name, given, unit)
    if isinstance(given, str):
        if "," not in given and _SEVERAL.match(given):
            raise InputError(f"`{name}` is {given!r}: write commas between the values, not spaces.")
        given = [part.strip() for part in given.split(",")]
    if not isinstance(given, list | tuple) or not any(isinstance(x, str) for x in given):
        return given
    values, problems = [], []
    for entry in given:
        try:
            values.append(typed_number(name, entry, unit) if isinstance(entry, str) else entry)
        except InputError as error:
            problems += error.problems
    if problems:
        raise InputError(problems)
    return values


def check_real(name: str, given: Any, unit: str) -> None:
    """`InputError` where `given`, or an entry of a list, is complex, or true or false."""
    for entry in given if isinstance(given, list | tuple) else [given]:
        if isinstance(entry, list | tuple):
            check_real(name, entry, unit)
            continue
        kind = entry.dtype.kind if hasattr(entry, "dtype") else np.array(entry).dtype.kind
        if kind in "bc":
            what = str(entry) if np.ndim(entry) == 0 else f"an array of {entry.dtype}"
            raise InputError(f"`{name}` must be real numbers ({unit}), but holds {what}.")
