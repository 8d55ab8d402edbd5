"""What pydantic finds wrong with a study file, in the words of its keys."""

import copy
from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel, ValidationError

from ..._errors import did_you_mean
from ...vibration import metric_problem
from .schema import StudyTable


def checked(data: Mapping[str, Any]) -> tuple[dict[str, Any], list[str]]:
    """The entries of `data` that are well-formed, and one sentence for each of the others."""
    kept, problems = copy.deepcopy(dict(data)), []
    for _ in range(10):  # what is taken away can leave something else incomplete
        try:
            StudyTable.model_validate(kept)
            break
        except ValidationError as error:
            found = [x for x in error.errors() if x["loc"] != ("drive",) or "drive" in kept]
            found = [x for x in found if x["type"] != "too_short"]  # told with what is needed
            if not found:
                break
            problems += [_sentence(kept, x) for x in found]
            for x in sorted(found, key=lambda x: _order(x["loc"]), reverse=True):
                _remove(kept, x)
    return kept, list(dict.fromkeys(problems))


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
    kind, loc, given = error["type"], error["loc"], error["input"]
    label = _label(data, loc if kind == "missing" else _real(data, loc))
    context = error.get("ctx", {})
    told = f"`{label}` {context.get('error', error['msg'])}"
    if kind == "missing":
        told = f"`{label}` is missing."
        if loc[-1] == "path":
            told = "a [[variable]] needs `path`: a parameter of the rig or its drive."
    elif kind == "extra_forbidden":
        keys = _keys(loc[:-1])
        hint = did_you_mean(str(loc[-1]), keys) or f" Known keys: {', '.join(keys)}."
        told = f"`{label}` is not a key of a study file.{hint}"
    elif kind in {"model_type", "dict_type", "model_attributes_type"}:
        told = f"`{label}` must be a table, but is {given!r}."
    elif kind == "list_type":
        told = f"`{label}` must be a list of tables ([[{label}]]), but is {given!r}."
    elif kind == "literal_error" and loc[-1] == "[key]":
        told = f"`{label}`: {metric_problem(given)}"
    elif kind == "literal_error":
        options = [x.strip("'") for x in context["expected"].replace(" or ", ", ").split(", ")]
        hint = did_you_mean(str(given), options)
        told = f"`{label}` must be one of {', '.join(options)}, but is {given!r}.{hint}"
    return told


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


def _remove(data: Any, error: Any) -> None:
    """Take the wrong entry out; what misses a key goes as a whole."""
    steps = _real(data, error["loc"] if error["type"] != "missing" else error["loc"][:-1])
    if not steps:
        return
    for part in steps[:-1]:
        data = data[part]
    del data[steps[-1]]
