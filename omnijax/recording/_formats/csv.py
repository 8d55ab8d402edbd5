"""CSV in and out: fast where the file is clean, cell by cell where it is not."""

import gzip
import io
import math
import re
import zlib
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..._errors import InputError
from ..._files import write_bytes
from ..._memory import SHARE, available, in_words
from ..._reading import read_bytes
from .._recording import Fault, spans
from .dates import is_stamp, seconds_of
from .header import BLANK, cells_of, header_of, number_of
from .names import once

_LINE_END = re.compile(r"\r\n?|\n")
_CONTROLS = bytes({*range(32), 127} - set(b"\t\n\v\f\r\x1a\x1b"))  # what no text holds
_WIDE = (b"\xff\xfe", b"\xfe\xff")  # first bytes of UTF-16


class CsvTable(NamedTuple):
    """Columns of a file as they stand there, with units and noise where the file states them."""

    columns: dict[str, np.ndarray]
    units: dict[str, str]
    faults: list[Fault]
    noise: dict[str, float]


def read_csv(path: Path) -> CsvTable:
    """Read a text table: comma, semicolon, tab or blanks, `#` comments, text above the header.

    Dates and times of day are seconds from the first one; a row of units below the header is read.
    """
    text, faults = _text(path)
    lines = [x for x in _LINE_END.split(text) if x.strip() and not x.lstrip().startswith("#")]
    if len(lines) < 2:
        raise InputError(f"{path.name} holds no data: it needs a header row and samples below it.")
    header = header_of(lines)
    names, rows = header.names, lines[header.begin :]
    if not rows:
        raise InputError(f"{path.name} holds no data: it needs a header row and samples below it.")
    if all(number_of(name) is not None for name in names):
        raise InputError(f"{path.name} has no header row: its first row is numbers.")
    if header.before:
        what = f"{header.before} lines of text stand above the header"
        faults.append(Fault(path.name, "", (), "preamble", what, "they are not used"))
    values, units = _fast(rows, header.mark, len(names)), header.units
    if values is None:
        values, stamped, faulty = _careful(path.name, rows, header.mark, names)
        faults += faulty
        units = units | dict.fromkeys(stamped, "s")
    if not np.isfinite(values).any():
        raise InputError(f"{path.name} holds no numbers: it needs samples below its header row.")
    return CsvTable(_by_name(path.name, names, values), units, faults, {})


def write_csv(path: Path, columns: dict[str, np.ndarray]) -> None:
    """Write columns with every digit that a float64 needs; NaN as an empty cell."""
    texts = [
        ["" if math.isnan(v) else repr(v) for v in np.asarray(x, float).tolist()]
        for x in columns.values()
    ]
    rows = map(",".join, zip(*texts, strict=True))
    data = ("\n".join([",".join(columns), *rows]) + "\n").encode()
    # no name and no time stamp in the gzip header: equal data give equal files
    write_bytes(path, gzip.compress(data, 6, mtime=0) if path.suffix.lower() == ".gz" else data)


def _text(path: Path) -> tuple[str, list[Fault]]:
    """The file's text; if a packed file was cut off, the part that can be unpacked."""
    (raw, whole), faults = unpacked(path), []
    if not whole:
        what = "the packed file ends too early"
        use = "the rows before are used"
        faults.append(Fault(path.name, "", (), "truncated", what, use))
        raw = raw[: raw.rfind(b"\n") + 1]
    if _is_binary(raw):
        raise InputError("is no text table: its bytes are those of another kind of file.", path)
    return _decoded(raw), faults


def _is_binary(raw: bytes) -> bool:
    """Whether more of the first bytes are controls than damage makes of a text."""
    head = raw[:4096]
    controls = len(head) - len(head.translate(None, _CONTROLS))
    return not raw.startswith(_WIDE) and controls > max(8, 0.02 * len(head))


def _decoded(raw: bytes) -> str:
    """Text of UTF-8, of UTF-16 with its mark, or of what Windows writes in the west."""
    if raw.startswith(_WIDE):
        return raw.decode("utf-16", errors="replace")
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        return raw.decode("cp1252", errors="replace")


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
        between = None if mark == BLANK else mark
        values = np.loadtxt(io.StringIO("\n".join(lines)), delimiter=between, ndmin=2)
    except ValueError:
        return None
    return values if values.shape[1] == width else None


def _careful(file: str, lines: list[str], mark: str, names: list[str]):
    """Read each cell by itself; text becomes NaN, short rows are filled, both reported as faults.

    Returns values, names of columns that are stamps of time, and faults.
    """
    rows = [cells_of(line, mark) for line in lines]
    _check_width(file, rows, len(names))
    faults = _ragged(file, rows, len(names))
    first = next((row for row in rows if len(row) == len(names)), [])
    stamped = [j for j, cell in enumerate(first) if is_stamp(cell)]
    values = np.full((len(lines), len(names)), np.nan)
    text: dict[int, list[tuple[int, str]]] = {}
    for row, cells in enumerate(rows):
        for j, cell in enumerate(cells[: len(names)]):
            if j in stamped:
                continue
            number = number_of(cell, mark != ",")
            if number is None:
                text.setdefault(j, []).append((row + 1, cell.strip()))
            else:
                values[row, j] = number
    for j in stamped:
        values[:, j] = seconds_of([row[j] if j < len(row) else "" for row in rows])
    for j, words in text.items():
        spans = tuple((row, row) for row, _ in words)
        what = f"{words[0][1][:20]!r} is not a number"
        faults.append(Fault(file, names[j], spans, "text", what, "these cells count as missing"))
    return values, [names[j] for j in stamped], faults


def _by_name(file: str, names: list[str], values) -> dict[str, np.ndarray]:
    named = [(name, j) for j, name in enumerate(names) if name]
    return once(file, ((name, np.ascontiguousarray(values[:, j])) for name, j in named))


def _ragged(file: str, rows: list[list[str]], width: int) -> list[Fault]:
    """Faults of rows that are wider or narrower than the header, one fault for each width."""
    counts = np.array([len(cells) for cells in rows])
    faults = []
    for count in sorted({*counts.tolist()} - {width}):
        where = spans(counts == count)
        one = where[0][0] == where[-1][1]
        what = f"{'the row has' if one else 'rows have'} {count} cells, but the header {width}"
        use = "the first cells are used" if count < width else "the surplus is not used"
        faults.append(Fault(file, "", where, "ragged", what, use))
    return faults


def _check_width(file: str, rows: list[list[str]], width: int) -> None:
    """`InputError` if most rows have more cells than the header: which columns is unknown."""
    wider = sum(any(cells[width:]) for cells in rows)
    if wider > len(rows) / 2:
        most = max(map(len, rows))
        raise InputError(
            f"{file}: rows have up to {most} cells, but the header {width}. Columns that are "
            "separated by commas need numbers with a point, or rows have names of their own."
        )
