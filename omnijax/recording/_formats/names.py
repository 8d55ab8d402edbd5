"""Names of columns: one column each, or it cannot be said which one is meant."""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from ..._errors import InputError


def once(file: str, columns: Iterable[tuple[str, Any]]) -> dict[str, Any]:
    """Columns by name; `InputError` where one name has two of them.

    Copies of one column, as the time beside every channel of a recorder, are that column.
    """
    out: dict[str, Any] = {}
    for name, values in columns:
        if name in out and not _alike(out[name], values):
            raise doubled(file, name)
        out.setdefault(name, values)
    return out


def doubled(file: str, name: str) -> InputError:
    """What is said of a name that two columns have."""
    return InputError(
        f"{file}: two columns are named {name!r} and differ: rename one of them or take it out."
    )


def leaves(columns: Iterable[tuple[Sequence[str], Any]]) -> dict[str, Any]:
    """Columns of a tree by the last name of their path; dotted paths where others end alike.

    Structs `motor` and `load` that both have a field `q` give `motor.q` and `load.q`.
    """
    ends: dict[str, list[tuple[str, Any]]] = {}
    for path, values in columns:
        ends.setdefault(path[-1], []).append((".".join(path), values))
    out: dict[str, Any] = {}
    for name, some in ends.items():
        first = some[0][1]
        alone = all(_alike(first, values) for _, values in some[1:])
        out |= {name: first} if alone else dict(some)
    return out


def _alike(a: Any, b: Any) -> bool:
    """Whether two columns hold the same."""
    a, b = np.asarray(a), np.asarray(b)
    numbers = a.dtype.kind in "fc" and b.dtype.kind in "fc"
    same = a.dtype.kind == b.dtype.kind != "O"  # of objects nobody knows
    return same and np.array_equal(a, b, equal_nan=numbers)
