"""Where a text table begins: its header, a row of units, what separates its cells."""

import collections
import csv
import re
from collections.abc import Sequence
from typing import NamedTuple

MARKS = ";\t,"
LOOKED = 200  # last lines of a file, by which its shape is known
USUAL = 0.9  # share of them that have as many cells
BLANK = " "  # any white space separates
QUOTED = re.compile(r'"[^"]*"')
EXCEL = re.compile(r"\s*\"?sep=(\\t|.)\"?\s*\Z", re.IGNORECASE)
UNIT = re.compile(r"[\[(]?\s*((?:1/)?[A-Za-zµμ°%][\wµμ°%/^*·⋅²³. -]{0,23})\s*[\])]?\Z")
EMPTY = {"", "nan", "na", "n/a", "null", "none", "-", "#n/a", "nat"}


class Header(NamedTuple):
    """Names and units of the columns, what separates cells, the line of the first row of values.

    `before` lines of text stand above the header.
    """

    names: list[str]
    units: dict[str, str]
    mark: str
    begin: int
    before: int


def header_of(lines: Sequence[str]) -> Header:
    """The header of a table's `lines`: the first one, or the last above its rows that is as wide.

    A row below it that holds words alone is one of units.
    """
    said = EXCEL.match(lines[0])  # Excel's own first line
    first = 1 if said else 0
    at, mark = first, said[1].replace("\\t", "\t") if said else _most(lines[0])
    if not said and not _as_wide(lines, 0, mark):
        at, mark = _below_text(lines, mark)
    names = [cell.strip("\"'") for cell in cells_of(lines[at], mark)]
    units, begin = {}, at + 1
    if begin + 1 < len(lines):
        row = [cell.strip("\"'") for cell in cells_of(lines[begin], mark)]
        units = _units(names, row)
        begin += bool(units)
    return Header(names, units, mark, begin, at - first)


def cells_of(line: str, mark: str) -> list[str]:
    """The cells of a line."""
    if mark == BLANK:
        return line.split()
    if '"' in line:  # a mark between quotes separates nothing
        (parts,) = csv.reader([line], delimiter=mark, skipinitialspace=True)
        return [cell.strip() for cell in parts]
    return [cell.strip() for cell in line.split(mark)]


def number_of(cell: str, decimal_comma: bool = False) -> float | None:
    """The number in a cell, NaN for an empty one, None where it is something else."""
    cell = cell.strip().strip("\"'")
    if cell.lower() in EMPTY:
        return float("nan")
    try:
        return float(cell.replace(",", ".") if decimal_comma else cell)
    except ValueError:
        return None


def _most(line: str) -> str:
    """The mark that stands in a line most often, not between quotes."""
    return max(",;\t", key=QUOTED.sub("", line).count)


def _usual(lines: Sequence[str], mark: str) -> tuple[int, float]:
    """How many cells the last lines mostly have, and the share of those that do."""
    last = lines[-min(LOOKED, max(1, len(lines) - 1)) :]
    counts = collections.Counter(len(cells_of(line, mark)) for line in last)
    width, some = counts.most_common(1)[0]
    return width, some / len(last)


def _as_wide(lines: Sequence[str], at: int, mark: str) -> bool:
    """Whether a line has as many cells, more than one, as the rows mostly have."""
    width = len(cells_of(lines[at], mark))
    return width > 1 and width == _usual(lines, mark)[0]


def _below_text(lines: Sequence[str], mark: str) -> tuple[int, str]:
    """(line of the header, mark) of a table below lines of text; the first line where none is."""
    for other in (*MARKS, BLANK):
        width, share = _usual(lines, other)
        if width < 2 or share < USUAL:
            continue
        fits: list[int] = []
        for k, line in enumerate(lines):
            cells = cells_of(line, other)
            if len(cells) != width:
                continue
            if any(number_of(x, other != ",") is not None and x for x in cells):
                break
            fits.append(k)
        if fits:  # of a header and its units the header
            pair = len(fits) > 1 and fits[-1] == fits[-2] + 1
            return fits[-2] if pair and _all_units(lines[fits[-1]], other) else fits[-1], other
    return 0, mark


def _all_units(line: str, mark: str) -> bool:
    return bool(_units([str(k) for k in range(len(line))], cells_of(line, mark)))


def _units(names: Sequence[str], row: Sequence[str]) -> dict[str, str]:
    """Units by name of a row that may be one of units; nothing where it is one of values."""
    filled = [
        (name, cell) for name, cell in zip(names, row, strict=False)
        if cell.strip("[]() ").lower() not in {*EMPTY, "1"}
    ]  # fmt: skip
    matches = [(name, UNIT.match(cell)) for name, cell in filled]
    if not matches or len(row) > len(names) or not all(m for _, m in matches):
        return {}
    return {name: m[1].strip() for name, m in matches if m}
