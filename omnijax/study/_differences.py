"""In which keys two specifications differ: what a store says that holds another study."""

import dataclasses
from collections.abc import Mapping
from typing import Any


def differences(stored: Mapping[str, Any], asked: Mapping[str, Any]) -> list[str]:
    """Keys in which two trees of tables differ, each as `key: stored -> asked`."""
    before, after = (dict(_leaves(tree, "")) for tree in (stored, asked))
    keys = dict.fromkeys([*before, *after])
    return [
        f"{key}: {_short(before.get(key, 'absent'))} -> {_short(after.get(key, 'absent'))}"
        for key in keys
        if before.get(key) != after.get(key)
    ]


def plain(value: Any) -> Any:
    """Dataclasses and named tuples as tables, tuples as lists: what JSON gives back equal."""
    if dataclasses.is_dataclass(value):
        value = {f.name: getattr(value, f.name) for f in dataclasses.fields(value)}
    elif hasattr(value, "_asdict"):
        value = value._asdict()
    if isinstance(value, Mapping):
        return {str(key): plain(inner) for key, inner in value.items()}
    return [plain(inner) for inner in value] if isinstance(value, tuple | list) else value


def _leaves(value: Any, path: str):
    """(path, text) of every leaf; list entries that have a name are known by it."""
    if isinstance(value, Mapping):
        for key, inner in value.items():
            yield from _leaves(inner, f"{path}.{key}" if path else str(key))
    elif isinstance(value, list) and any(isinstance(x, Mapping) for x in value):
        for i, inner in enumerate(value):
            name = inner.get("name", inner.get("quantity", i))
            yield from _leaves(inner, f"{path}.{name}")
    else:
        yield path, repr(value)


def _short(text: str) -> str:
    return text if len(text) <= 60 else text[:57] + "..."
