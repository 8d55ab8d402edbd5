"""A measured wheel profile: a CSV file with columns theta (rad) and rho (m)."""

import csv
import io
import itertools
import math
from collections.abc import Mapping, Sequence
from pathlib import Path

from .._errors import InputError, did_you_mean
from .._reading import TEXT, read_bytes
from ..laws import TableShape

COLUMNS = ("theta", "rho")
SAME = 0.1  # of a row's step: a last row this near to one period after the first is the first
CLOSE = 0.01  # of the rows' usual step: between closer rows a spline makes peaks of mere noise
CLOSING = 0.02  # of rho's range: by so much the ends of a measured turn may differ


def read_profile(
    table: str | Mapping, rollers: float, folder: Path
) -> tuple[list[float], list[float], float]:
    """theta in rad, rho in m and the period: one turn or one pitch, whichever theta spans.

    `table` is a CSV file relative to `folder`, or the two columns themselves.
    """
    theta, rho = _columns(table) if isinstance(table, Mapping) else _csv(folder / str(table))
    if len(theta) < 4 or len(theta) != len(rho):
        raise ValueError(f"needs four rows of theta and rho at least, but has {len(theta)}.")
    steps = [b - a for a, b in itertools.pairwise(theta)]
    for row, step in enumerate(steps, start=3):  # row 1 is the header
        if step <= 0:
            raise ValueError(f"must have increasing theta, but row {row} has {theta[row - 2]!r}.")
    usual = sorted(steps)[len(steps) // 2]
    for row, step in enumerate(steps, start=3):
        if step < CLOSE * usual:
            raise ValueError(
                f"has two rows at nearly one theta: row {row} is {step:.3g} rad after the one "
                f"before it, the others are {usual:.3g} rad apart. Keep one of the two."
            )
    span = theta[-1] - theta[0]
    period = _period(span, max(steps), usual, rollers)
    if abs(span - period) <= SAME * usual:
        theta, rho = _closed(theta, rho, period)
    return theta, rho, period


def _closed(theta: list[float], rho: list[float], period: float) -> tuple[list[float], list[float]]:
    """The rows of one period without the last, which is the first again.

    What its rho differs from the first row's by is taken off all rows in proportion to theta.
    """
    misclosure = rho[-1] - rho[0]
    if abs(misclosure) > 1e-9 + CLOSING * (max(rho) - min(rho)):
        raise ValueError(
            f"does not close: rho is {rho[0]!r} at the beginning and {rho[-1]!r} one period on."
        )
    spread = [r - misclosure * (t - theta[0]) / period for t, r in zip(theta, rho, strict=True)]
    return theta[:-1], spread[:-1]


def shape_of(table: str | Mapping, rollers: float, folder: Path) -> TableShape:
    """The spline through a table."""
    return TableShape.fit(*read_profile(table, rollers, folder))


def _period(span: float, widest: float, usual: float, rollers: float) -> float:
    """One pitch or one turn: the one that the table covers up to two of its widest steps."""
    for period in (2 * math.pi / rollers, 2 * math.pi):
        if period + SAME * usual >= span >= period * (1 - 1e-9) - 2 * widest:
            return period
    raise ValueError(
        f"must cover one pitch ({2 * math.pi / rollers:.6g} rad) or one turn ({2 * math.pi:.6g} "
        f"rad), but theta spans {span:.6g} rad."
    )


def _columns(table: Mapping) -> tuple[list[float], list[float]]:
    if set(table) != set(COLUMNS):
        raise ValueError("must have the columns theta and rho.")
    theta, rho = ([float(x) for x in table[name]] for name in COLUMNS)
    if not all(math.isfinite(x) for x in (*theta, *rho)):
        raise ValueError("must hold finite numbers only.")
    return theta, rho


def _csv(path: Path) -> tuple[list[float], list[float]]:
    try:
        text = read_bytes(path, TEXT).decode("utf-8-sig")
        lines = csv.reader(io.StringIO(text, newline=""))
        rows = [row for row in lines if row and not row[0].startswith("#")]
    except InputError as error:
        raise ValueError(f"names a file that is not read: {error}") from None
    except OSError as error:
        raise ValueError(f"names {path}, which cannot be read: {error.strerror}.") from None
    except (UnicodeDecodeError, csv.Error):
        raise ValueError(f"names {path}, which is not a text table.") from None
    header = [cell.strip() for cell in rows[0]] if rows else []
    for name in COLUMNS:
        if name not in header:
            hint = did_you_mean(name, header)
            raise ValueError(f"names {path}, which has no column `{name}` in its first row.{hint}")
    where = [header.index(name) for name in COLUMNS]
    return tuple([_cell(path, k, row, i) for k, row in enumerate(rows[1:], 1)] for i in where)  # pyright: ignore[reportReturnType]


def _cell(path: Path, number: int, row: Sequence[str], column: int) -> float:
    try:
        value = float(row[column])
    except (ValueError, IndexError):
        raise ValueError(f"names {path}, whose row {number} is no pair: {row!r}.") from None
    if not math.isfinite(value):
        raise ValueError(f"names {path}, whose row {number} is not finite: {row!r}.")
    return value
