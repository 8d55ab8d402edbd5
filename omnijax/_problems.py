"""What pydantic finds wrong with a file, in sentences that begin with the key's path."""

from collections.abc import Iterable
from typing import Any

from ._errors import did_you_mean

_KINDS = {
    "model_type": "a table",
    "model_attributes_type": "a table",
    "dict_type": "a table",
    "string_type": "text",
    "string_too_short": "text of at least one character",
    "string_too_long": "text of at most 64 characters",
}


def sentence(entry: Any, path: str, file: str, keys: Iterable[str]) -> str:
    """One of pydantic's errors as users read it.

    `path` names the key, `file` says whose it is (`a rig file`), and `keys` are those that are
    known at the key's place.
    """
    kind, given, context = entry["type"], entry["input"], entry.get("ctx", {})
    if kind == "missing":
        return f"`{path}` is missing."
    if kind == "extra_forbidden":
        known, key = list(keys), str(entry["loc"][-1])
        hint = did_you_mean(key, known) or f" Known keys: {', '.join(known)}."
        if entry["loc"][0] == "effect" and "parameters" in known:
            hint += f" A law's own numbers stand in `parameters = {{ {key} = ... }}`."
        return f"`{path}` is not a key of {file}.{hint}"
    if kind == "value_error":
        return f"`{path}` {context['error']}"
    if kind == "literal_error":
        options = [x.strip("'") for x in context["expected"].replace(" or ", ", ").split(", ")]
        hint = did_you_mean(str(given), options)
        return f"`{path}` must be one of {', '.join(options)}, but is {given!r}.{hint}"
    if kind == "list_type":
        return f"`{path}` must be a list of tables ([[{path}]]), but is {given!r}."
    return f"`{path}` must be {_KINDS.get(kind, entry['msg'])}, but is {given!r}."
