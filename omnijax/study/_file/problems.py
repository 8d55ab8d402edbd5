"""What pydantic finds wrong with a study file, in the words of its keys."""

import copy
from collections.abc import Mapping
from typing import Any, NamedTuple

from pydantic import BaseModel, ValidationError

from ..._problems import sentence
from ...vibration import metric_problem
from .schema import StudyTable

Place = tuple[str | int, ...]  # keys and indices that lead to an entry


class Checked(NamedTuple):
    """The entries of a file that are well-formed; sentences on the others, and where they stood."""

    table: StudyTable
    problems: list[str]
    dropped: list[Place]


def checked(data: Mapping[str, Any]) -> Checked:
    """The entries of `data` that are well-formed, and what is wrong with the others."""
    kept, problems, dropped = copy.deepcopy(dict(data)), [], []
    again = False
    while True:
        try:
            table = StudyTable.model_validate(kept)
            return Checked(table, list(dict.fromkeys(problems)), dropped)
        except ValidationError as error:
            wrong = error.errors()
        # what is taken away can leave something else incomplete: that is not the user's
        told = (x for x in wrong if not (again and x["type"] == "missing"))
        problems += [_sentence(kept, x) for x in told]
        places = {_wrong_place(kept, x) for x in wrong}  # a block may lack several keys
        for place in sorted(places, key=_order, reverse=True):
            _remove(kept, place)
            dropped.append(place)
        again = True


def _order(loc: tuple) -> tuple:
    return tuple((isinstance(part, int), part if isinstance(part, int) else 0) for part in loc)


def _real(data: Any, loc: tuple) -> tuple:
    """The part of pydantic's location that leads through `data` (it adds branches of unions)."""
    steps = []
    for part in loc:
        inside = isinstance(data, Mapping) and part in data
        inside = inside or (isinstance(data, list) and isinstance(part, int) and part < len(data))
        if not inside:
            continue
        data = data[part]
        steps.append(part)
    return tuple(steps)


def _label(data: Any, loc: tuple) -> str:
    """`variable.contact.stiffness.low`: tables of a list by what they are about."""
    words = []
    for part in loc:
        if isinstance(part, int):
            block = data[part] if isinstance(data[part], Mapping) else {}
            name = block.get("path", block.get("name", block.get("quantity")))
            words.append(name if isinstance(name, str) else str(part + 1))
        else:
            words.append(str(part))
        try:
            data = data[part]
        except (KeyError, IndexError, TypeError):
            data = {}
    return ".".join(words)


def _sentence(data: Mapping, error: Any) -> str:
    """What is wrong at one place, as users read it."""
    kind, loc = error["type"], error["loc"]
    if kind == "missing" and loc[-1] == "path":
        return "a [[variable]] needs `path`: a parameter of the rig or its drive."
    label = _label(data, loc if kind == "missing" else _real(data, loc))
    if kind == "literal_error" and loc[-1] == "[key]":
        return f"`{label}`: {metric_problem(error['input'])}"
    return sentence(error, label, "a study file", _keys(loc[:-1]))


def _keys(loc: tuple) -> list[str]:
    """The keys that stand at a place of a study file."""
    model: Any = StudyTable
    for part in loc:
        if isinstance(part, str) and part in model.model_fields:
            kinds = [model.model_fields[part].annotation]
            while kinds:
                kind = kinds.pop()
                if isinstance(kind, type) and issubclass(kind, BaseModel):
                    model = kind
                kinds += getattr(kind, "__args__", ())
    return list(model.model_fields)


def _wrong_place(data: Any, error: Any) -> tuple:
    """Where the wrong entry stands; what misses a key is wrong as a whole."""
    return _real(data, error["loc"] if error["type"] != "missing" else error["loc"][:-1])


def _remove(data: Any, place: tuple) -> None:
    """Take the entry at a place out."""
    *way, last = place
    for part in way:
        data = data[part]
    del data[last]
