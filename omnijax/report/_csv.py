"""The numbers of figures and tables as CSV."""

import csv
import io
from collections.abc import Mapping
from typing import Any

import numpy as np

from ._content import Table


def figure_csv(data: Mapping[str, Any]) -> str:
    """Columns side by side; a shorter one ends in empty cells."""
    columns = [np.atleast_1d(np.asarray(values)) for values in data.values()]
    length = max((len(column) for column in columns), default=0)
    rows = (
        [_cell(column[i]) if i < len(column) else "" for column in columns] for i in range(length)
    )
    return _text([list(data), *rows])


def table_csv(table: Table) -> str:
    """Header with units, then the rows."""
    header = [f"{c.name} / {c.unit}" if c.unit else c.name for c in table.columns]
    return _text([header, *([_cell(value) for value in row] for row in table.rows)])


def _cell(value: Any) -> str:
    if isinstance(value, float | np.floating):
        return f"{float(value):.9g}"
    text = "; ".join(value) if isinstance(value, tuple) else str(value)
    # a spreadsheet would run such a cell as a formula
    risky = text[:1] in ("=", "@", "\t") or (text[:1] in ("+", "-") and not _number(text))
    return f"'{text}" if risky else text


def _number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _text(rows) -> str:
    out = io.StringIO()
    csv.writer(out, lineterminator="\n").writerows(rows)
    return out.getvalue()
