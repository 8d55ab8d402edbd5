"""JSON logs: columns by name, or a list of samples, wherever it stands in the document."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from .._errors import InputError
from ._csv import CsvTable, unpacked
from ._spread import spread


def read_json(path: Path) -> CsvTable:
    """Columns of a `.json` or `.json.gz` log.

    Read are the longest list of samples (`[{"t": 0, "q": 1}, ...]`), or the longest lists of one
    length by name (`{"t": [...], "q": [...]}`), and the numbers beside them as constant columns.
    A nested name is `motor.position`; what is no number (a word, null) is NaN in its row.
    """
    raw, whole = unpacked(path)
    if not whole:
        raise InputError("the packed file ends too early.", path)
    document = json.loads(raw.decode("utf-8-sig"))
    tables = _tables(document, {})
    largest = max(reversed(tables), key=lambda x: x[0], default=None)  # of equals the innermost
    if largest is None:
        raise InputError("holds no list of samples and no lists of numbers by name.", path)
    length, columns, beside = largest
    constant = {k: np.full(length, float(v)) for k, v in beside.items() if k not in columns}
    return spread(columns | constant)


def _tables(node: Any, beside: dict[str, float]) -> list[tuple[int, dict, dict]]:
    """(length, columns, numbers beside it) of every table in a document."""
    if isinstance(node, list):
        if len(node) > 1 and all(isinstance(x, dict) for x in node):
            return [(len(node), _of_samples(node), beside)]
        return [x for one in node if isinstance(one, dict | list) for x in _tables(one, beside)]
    if not isinstance(node, dict):
        return []
    beside = beside | {k: v for k, v in node.items() if isinstance(v, int | float)}
    columns = {k: v for k, v in _flat(node).items() if _is_column(v)}
    longest = max(map(len, columns.values()), default=0)
    columns = {k: _numbers(v) for k, v in columns.items() if len(v) == longest}
    out = [(longest, columns, beside)] if longest > 1 else []
    return out + [x for v in node.values() if isinstance(v, dict | list)
                  for x in _tables(v, beside)]  # fmt: skip


def _of_samples(rows: list[dict]) -> dict[str, np.ndarray]:
    flat = [_flat(row) for row in rows]
    names = dict.fromkeys(k for row in flat for k in row)
    columns = {k: _numbers([row.get(k) for row in flat]) for k in names}
    return {k: x for k, x in columns.items() if np.isfinite(x).any()}


def _flat(node: dict, before: str = "") -> dict[str, Any]:
    """Values by dotted name."""
    out: dict[str, Any] = {}
    for key, value in node.items():
        name = f"{before}{key}"
        out |= _flat(value, f"{name}.") if isinstance(value, dict) else {name: value}
    return out


def _is_column(value: Any) -> bool:
    return isinstance(value, list) and all(
        x is None or isinstance(x, int | float | bool) for x in value
    )


def _numbers(values: list) -> np.ndarray:
    return np.array([
        float(x) if isinstance(x, int | float | bool) else np.nan for x in values
    ])  # fmt: skip
