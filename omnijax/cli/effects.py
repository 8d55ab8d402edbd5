"""`omnijax effects`: every law that can be added to a rig."""

import math
from typing import Any

from ._console import paragraph
from ._inputs import Json, emit


def effects(name: str | None = None, /, *, json: Json = False) -> None:
    """List the effects: id, formula, port, places, parameters with units.

    Example: omnijax effects contact

    Parameters
    ----------
    name
        Show only effects whose id contains this text; of a whole id, its block of a rig file too.
    """
    from .._errors import InputError, did_you_mean
    from ..laws import AXIS_EFFECTS, EFFECTS

    known = EFFECTS if name is None else AXIS_EFFECTS  # those of axes alone where asked for
    chosen = [law for key, law in known.items() if name is None or name in key]
    if not chosen:
        hint = did_you_mean(str(name), known) or " `omnijax effects` lists all."
        raise InputError(f"no effect's id contains {name!r}.{hint}")
    rows = [_describe(law) for law in chosen]
    emit(json, rows, lambda: _print(rows, name))


def _describe(law: Any) -> dict[str, Any]:
    from ..laws import ANY_LENGTH

    parameters = {
        key: {
            "unit": parameter.unit,
            "low": parameter.low if math.isfinite(parameter.low) else None,
            "high": parameter.high if math.isfinite(parameter.high) else None,
            "size": None if parameter.shape == ANY_LENGTH else parameter.shape or 1,
            "optional": parameter.optional,
        }
        for key, parameter in law.parameters.items()
    }
    return {
        "id": law.id,
        "words": law.words,
        "formula": law.formula,
        "port": law.port,
        "places": list(law.places),
        "parameters": parameters,
        "source": law.source,
        "block": _block(law),
    }


def _block(law: Any) -> str:
    """What a rig file holds of the law: numbers that do nothing, or as little as they may."""
    from ..rig import law_places, law_quantity

    needed = {key: known for key, known in law.parameters.items() if not known.optional}
    place = law_places(law, ["w1"])[0]
    values = ", ".join(f"{key} = {_smallest(known)}" for key, known in needed.items())
    units = ", ".join(f"{k} in {law_quantity(known, place, 1).unit}" for k, known in needed.items())
    kinds = ", ".join(law.places)
    lines = ["[[effect]]", f'id = "{law.id}"', f'place = "{place}"  # one of: {kinds}']
    if needed:
        lines.append(f"parameters = {{ {values} }}  # {units}")
    return "\n".join(lines)


def _smallest(known: Any) -> str:
    from ..laws import ANY_LENGTH

    if known.shape == ANY_LENGTH:
        return "[1.0]"
    if known.shape:  # a direction, which is not zero, or a vector
        first = 1.0 if known.unit == "1" else 0.0
        return str([first] + [0.0] * (known.shape - 1))
    nothing = known.low < 0 or (known.low == 0 and not known.above)
    return "0.0" if nothing and known.high >= 0 else str(min(max(1.0, known.low), known.high))


def _print(rows: list[dict[str, Any]], name: str | None = None) -> None:
    """A paragraph an effect, of 80 columns on a terminal and in a pipe."""
    for row in rows:
        print(paragraph(f"{row['words']}: {row['formula']}", "    ", f"{row['id']}  "))
        keys = (
            f"{key}{'' if known['unit'] == '1' else ' ' + known['unit']}"
            + (" (optional)" if known["optional"] else "")
            for key, known in row["parameters"].items()
        )
        told = f"at {', '.join(row['places'])}; {', '.join(keys) or 'no parameters'}"
        print(paragraph(f"{told}; port {row['port']}", "      ", "    "))
    for row in rows:  # below all, whatever other ids hold the text
        if row["id"] == name:
            print(f"\n{row['block']}")
