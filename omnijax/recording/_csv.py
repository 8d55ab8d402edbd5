"""CSV in and out: fast where the file is clean, cell by cell where it is not."""

import gzip
import io
import math
import re
import zlib
from pathlib import Path
from typing import NamedTuple

import numpy as np

from .._errors import InputError
from .._files import write_bytes
from .._memory import SHARE, available, in_words
from .._reading import read_bytes
from ._recording import Fault

_LINE_END = re.compile(r"\r\n?|\n")
_MARK = re.compile(r"\s*\"?sep=(\\t|.)\"?\s*\Z", re.IGNORECASE)
EMPTY = {"", "nan", "na", "n/a", "null", "none", "-", "#n/a", "nat"}


class CsvTable(NamedTuple):
    """Columns of a file as they stand there, with units and noise where the file states them."""

    columns: dict[str, np.ndarray]
    units: dict[str, str]
    faults: list[Fault]
    noise: dict[str, float]


def read_csv(path: Path) -> CsvTable:
    """Read a CSV or CSV.gz file: comma, semicolon or tab, header row, UTF-8, `#` comments."""
    text, faults = _text(path)
    lines = [x for x in _LINE_END.split(text) if x.strip() and not x.lstrip().startswith("#")]
    said = _MARK.match(lines[0]) if lines else None  # Excel's own first line
    lines = lines[1:] if said else lines
    if len(lines) < 2:
        raise InputError(f"{path.name} holds no data: it needs a header row and samples below it.")
    mark = said[1].replace("\\t", "\t") if said else max(",;\t", key=lines[0].count)
    names = [name.strip().strip("\"'") for name in lines[0].split(mark)]
    if all(_number(name) is not None for name in names):
        raise InputError(f"{path.name} has no header row: its first row is numbers.")
    values = _fast(lines[1:], mark, len(names))
    if values is None:
        values, faulty = _careful(path.name, lines[1:], mark, names)
        faults += faulty
    return CsvTable(_by_name(path.name, names, values, faults), {}, faults, {})


def write_csv(path: Path, columns: dict[str, np.ndarray]) -> None:
    """Write columns with every digit that a float64 needs; NaN as an empty cell."""
    texts = [
        ["" if math.isnan(v) else repr(v) for v in np.asarray(x, float).tolist()]
        for x in columns.values()
    ]
    rows = map(",".join, zip(*texts, strict=True))
    data = ("\n".join([",".join(columns), *rows]) + "\n").encode()
    # no name and no time stamp in the gzip header: equal data give equal files
    write_bytes(path, gzip.compress(data, 6, mtime=0) if path.suffix == ".gz" else data)


def _text(path: Path) -> tuple[str, list[Fault]]:
    """The file's text; of a file that was cut off while packed, what can be unpacked."""
    (raw, whole), faults = unpacked(path), []
    if not whole:
        what = "the packed file ends too early"
        use = "the rows before are used"
        faults.append(Fault(path.name, "", (), "truncated", what, use))
        raw = raw[: raw.rfind(b"\n") + 1]
    return raw.decode("utf-8-sig", errors="replace"), faults


def unpacked(path: Path) -> tuple[bytes, bool]:
    """A text file's bytes, unpacked where it is `.gz`, and whether it is whole."""
    most = int(min(SHARE / 4 * available(), 2**40))  # the text, its lines and its numbers
    raw = read_bytes(path, most)
    return _unpacked(path, raw, most) if path.suffix.lower() == ".gz" else (raw, True)


def _unpacked(path: Path, raw: bytes, most: int) -> tuple[bytes, bool]:
    """Every member of a gzip file, `most` bytes at most, and whether the last one is whole."""
    parts, size, rest, whole = [], 0, raw, True
    while whole and rest.rstrip(b"\0"):  # some packers fill up with zeros
        if parts and not rest.startswith(b"\x1f\x8b"):
            raise InputError(f"has {len(rest)} bytes behind its packed rows: it is damaged.", path)
        unpack = zlib.decompressobj(wbits=31)
        try:
            parts.append(unpack.decompress(rest, most - size + 1))
        except zlib.error as error:
            where = f"part {len(parts) + 1} of it " if parts else ""
            raise InputError(f"{where}is not a gzip file ({error}).", path) from None
        size += len(parts[-1])
        if size > most or unpack.unconsumed_tail:
            text = f"unpacks to more than {in_words(most)}, the most that memory has room for"
            raise InputError(f"{text}: thin it out, or cut it.", path)
        whole, rest = unpack.eof, unpack.unused_data
    return b"".join(parts), whole


def _fast(lines: list[str], mark: str, width: int) -> np.ndarray | None:
    try:
        values = np.loadtxt(io.StringIO("\n".join(lines)), delimiter=mark, ndmin=2)
    except ValueError:
        return None
    return values if values.shape[1] == width else None


def _number(cell: str, decimal_comma: bool = False) -> float | None:
    """The number in a cell, NaN for an empty one, None where it is something else."""
    cell = cell.strip().strip("\"'")
    if cell.lower() in EMPTY:
        return float("nan")
    try:
        return float(cell.replace(",", ".") if decimal_comma else cell)
    except ValueError:
        return None


def _careful(file: str, lines: list[str], mark: str, names: list[str]):
    """Every cell for itself: text becomes NaN, short rows are filled up, and both are said."""
    values = np.full((len(lines), len(names)), np.nan)
    text: dict[int, list[tuple[int, str]]] = {}
    faults = []
    for row, line in enumerate(lines):
        cells = line.split(mark)
        if len(cells) != len(names):
            what = f"the row has {len(cells)} cells, but the header {len(names)}"
            use = (
                "its first cells are used" if len(cells) < len(names) else "the surplus is not used"
            )
            faults.append(Fault(file, "", ((row + 1, row + 1),), "ragged", what, use))
        for j, cell in enumerate(cells[: len(names)]):
            number = _number(cell, mark == ";")
            if number is None:
                text.setdefault(j, []).append((row + 1, cell.strip()))
            else:
                values[row, j] = number
    for j, words in text.items():
        rows = tuple((row, row) for row, _ in words)
        what = f"{words[0][1][:20]!r} is not a number"
        faults.append(Fault(file, names[j], rows, "text", what, "these cells count as missing"))
    return values, faults


def _by_name(file: str, names: list[str], values, faults: list[Fault]) -> dict[str, np.ndarray]:
    columns: dict[str, np.ndarray] = {}
    for j, name in enumerate(names):
        if name in columns:
            what = "the column stands twice in the header"
            faults.append(Fault(file, name, (), "double column", what, "the first one is used"))
        elif name:
            columns[name] = np.ascontiguousarray(values[:, j])
    return columns
