"""JSON logs: columns by name, or a list of samples, wherever it stands in the document."""

import json
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ..._errors import InputError
from .._columns import UNITS, group_of
from .csv import CsvTable, unpacked
from .dates import is_stamp, seconds_of
from .names import once
from .spread import spread


def read_json(path: Path) -> CsvTable:
    """Columns of a `.json` or `.json.gz` log.

    Read are the longest list of samples (`[{"t": 0, "q": 1}, ...]`), or the longest lists of one
    length by name (`{"t": [...], "q": [...]}`), and the numbers beside them as constant columns; a
    channel of a recording that is shorter is there too, a group `dR` may be rows of three.
    A nested name is `motor.position`; what is no number (a word, null) is NaN in its row, and dates
    are seconds from the first.  One sample a line, columns as tables by row (`{"q": {"0": 0.1}}`)
    and `columns` beside rows of `data`, as pandas writes them, are read too.
    """
    raw, whole = unpacked(path)
    if not whole:
        raise InputError("the packed file ends too early.", path)
    document = _document(raw.decode("utf-8-sig"), path.name)
    tables = _tables(document, {})
    largest = max(reversed(tables), key=lambda x: x[0], default=None)  # of equals the innermost
    if largest is None:
        raise InputError("holds no list of samples and no lists of numbers by name.", path)
    length, columns, beside = largest
    stamped = [k for k, x in columns.items() if not isinstance(x, np.ndarray)]
    columns = {k: seconds_of(x) if k in stamped else x for k, x in columns.items()}
    constant = {k: np.full(length, float(v)) for k, v in beside.items() if k not in columns}
    return spread(columns | constant, dict.fromkeys(stamped, "s"))


def _document(text: str, file: str) -> Any:
    """The document of a text, a list where each of its lines is one."""
    load = partial(json.loads, object_pairs_hook=partial(once, file))
    try:
        return load(text)
    except json.JSONDecodeError as error:
        lines = [line for line in text.splitlines() if line.strip()]
        if error.msg != "Extra data" or len(lines) < 2:
            raise
        return [load(line) for line in lines]


def _tables(node: Any, beside: dict[str, float]) -> list[tuple[int, dict, dict]]:
    """(length, columns, numbers beside it) of every table in a document."""
    if isinstance(node, list):
        if len(node) > 1 and all(isinstance(x, dict) for x in node):
            return [(len(node), _of_samples(node), beside)]
        return [x for one in node if isinstance(one, dict | list) for x in _tables(one, beside)]
    if not isinstance(node, dict):
        return []
    node = _by_column(node)
    beside = beside | {k: v for k, v in node.items() if isinstance(v, int | float)}
    columns = {k: v for k, v in _flat(node).items() if _is_column(v) or _is_matrix(v)}
    longest = max((max(len(v), _width(v)) for v in columns.values()), default=0)
    columns = {k: _numbers(v) for k, v in columns.items() if _belongs(k, v, longest)}
    out = [(longest, columns, beside)] if longest > 1 else []
    return out + [x for v in node.values() if isinstance(v, dict | list)
                  for x in _tables(v, beside)]  # fmt: skip


def _by_column(node: dict) -> dict:
    """A table of pandas by column: rows of `data` with `columns`, or numbered rows by name."""
    names, rows = node.get("columns"), node.get("data")
    if isinstance(names, list) and isinstance(rows, list) and len(rows) > 0:
        square = all(isinstance(row, list) and len(row) == len(names) for row in rows)
        columns = zip(*rows, strict=True) if square else []
        return {str(k): list(x) for k, x in zip(names, columns, strict=True)} if square else node
    numbered = [x for x in node.values() if isinstance(x, dict) and len(x) > 1]
    if not numbered or any(not isinstance(x, dict) for x in node.values()):
        return node
    first = list(numbered[0])
    if all(k.isdigit() for k in first) and all(list(x) == first for x in node.values()):
        return {k: list(x.values()) for k, x in node.items()}
    return node


def _of_samples(rows: list[dict]) -> dict[str, Any]:
    flat = [_flat(row) for row in rows]
    names = dict.fromkeys(k for row in flat for k in row)
    columns = {k: _numbers([row.get(k) for row in flat]) for k in names}
    return {k: x for k, x in columns.items() if isinstance(x, list) or np.isfinite(x).any()}


def _flat(node: dict, before: str = "") -> dict[str, Any]:
    """Values by dotted name."""
    out: dict[str, Any] = {}
    for key, value in node.items():
        name = f"{before}{key}"
        out |= _flat(value, f"{name}.") if isinstance(value, dict) else {name: value}
    return out


def _is_column(value: Any) -> bool:
    if not isinstance(value, list):
        return False
    return _is_stamped(value) or all(x is None or isinstance(x, int | float) for x in value)


def _is_matrix(value: Any) -> bool:
    """Whether a list holds lists of numbers that are as long as each other."""
    if not (isinstance(value, list) and len(value) > 1 and isinstance(value[0], list)):
        return False
    return all(isinstance(x, list) and len(x) == len(value[0]) and _is_column(x) for x in value)


def _width(value: list) -> int:
    """Numbers in a row of a matrix, as many as samples where it holds channels below each other."""
    return len(value[0]) if _is_matrix(value) else 0


def _belongs(name: str, value: list, longest: int) -> bool:
    """Whether a list is a column of the table, or one of a recording that has lost its end."""
    return longest in (len(value), _width(value)) or (len(value) > 1 and group_of(name) in UNITS)


def _is_stamped(values: Any) -> bool:
    """Whether a list holds dates or times of day."""
    return len(values) > 1 and all(isinstance(x, str) and is_stamp(x) for x in values)


def _numbers(values: list) -> np.ndarray | list[str]:
    """Numbers (t,), or the stamps as they stand there."""
    if _is_stamped(values):
        return values
    if _is_matrix(values):
        return np.array([_numbers(row) for row in values])
    return np.array([
        float(x) if isinstance(x, int | float | bool) else np.nan for x in values
    ])  # fmt: skip
