"""Named arrays into columns of one table."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from .._columns import AXES, PER_WHEEL, UNITS
from .csv import CsvTable
from .dates import seconds_from


def spread(columns: Mapping[str, Any], units: Mapping[str, str] | None = None) -> CsvTable:
    """Columns from named arrays; a matrix `dR` (samples, 3) becomes dR_x, dR_y, dR_z.

    Dates and durations are seconds, dates from the first one.
    """
    flat: dict[str, np.ndarray] = {}
    said: dict[str, str] = {}
    length = max((np.shape(v)[0] for v in columns.values() if np.ndim(v) > 0), default=0)
    for name, raw in columns.items():
        value = np.asarray(raw)
        if value.dtype.kind in "mM" and value.ndim == 1 and len(value):
            flat[name], said[name] = seconds_from(value), "s"
            continue
        if value.dtype.kind not in "fiub" or value.size < 1 or value.size == 1 < length:
            continue
        value = np.asarray(value.squeeze() if value.size == max(value.shape) else value, float)
        parts = {name: value} if value.ndim == 1 else _parts(name, value, length)
        flat |= parts
        if units and name in units:
            said |= dict.fromkeys(parts, units[name])
    return CsvTable(flat, said, [], {})


def _parts(name: str, value: np.ndarray, length: int) -> dict[str, np.ndarray]:
    if value.ndim != 2 or name not in UNITS:
        return {}
    value = value if value.shape[0] == length else value.T
    numbers = [str(i + 1) for i in range(value.shape[1])]
    ends = numbers if name in PER_WHEEL else AXES
    return {f"{name}_{end}": column for end, column in zip(ends, value.T, strict=False)}
