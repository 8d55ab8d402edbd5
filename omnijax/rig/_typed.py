"""Numbers as a person types them: `"30 rpm, 0, 10 rpm"`, `["30 rpm", 0, 10]`, `"2 s"`."""

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


def typed_above_zero(name: str, given: str | float, unit: str) -> float:
    """A finite number above 0 in SI, from text as `typed_number` or as it is.

    Raises `InputError`, in which the value is called `name`.
    """
    value = typed_number(name, given, unit) if isinstance(given, str) else float(given)
    if wrong := not_above_zero(unit, **{name: value}):
        raise InputError(wrong)
    return value


def typed_numbers(name: str, given: Any, unit: str) -> Any:
    """Numbers in SI from text with commas between, or from a list in which texts may stand.

    What holds no text (arrays, traced values, plain lists) comes back as it is.  `InputError`
    names every entry that is no number, as truth values and complex ones are none.
    """
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
