"""Tables of text: as wide as their words, aligned, the same on a terminal and in a pipe."""

import re
import textwrap
from collections.abc import Sequence

WIDTH = 79
_QUANTITY = re.compile(r"(\d) (?=[^\W\d]|[%(×])")  # a number and its unit stay on one line


def columns(rows: Sequence[Sequence[str]], indent: str = "") -> list[str]:
    """Lines with the cells of `rows` below each other, two spaces between columns."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    cells = ("  ".join(f"{c:{w}}" for c, w in zip(row, widths, strict=True)) for row in rows)
    return [f"{indent}{line}".rstrip() for line in cells]


def paragraph(text: str, hang: str = "", first: str = "") -> str:
    """Text broken at words; lines after the first begin with `hang`, the first with `first`."""
    told = textwrap.fill(
        _QUANTITY.sub("\\1\u00a0", text), WIDTH, initial_indent=first, subsequent_indent=hang,
        break_long_words=False, break_on_hyphens=False,
    )  # fmt: skip
    return told.replace("\u00a0", " ")
