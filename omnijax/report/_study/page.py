"""What the pages of studies share: the answer first, then figures in one style, then tables."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ..._text import scaled
from ...vibration import METRICS
from .._content import Fact, Figure, Provenance, Section, Table
from .._page import Page
from .._style import style
from .._terms import meanings

Drawing = tuple[str, str, Callable[[], Any], dict[str, Any]]  # name, caption, draw, data


def readable(values: Any, unit: str) -> tuple[Any, str]:
    """Values in the unit that their middle one reads well in, and that unit."""

    values_si = np.asarray(values, float)
    finite = np.abs(values_si[np.isfinite(values_si)])
    factor, name = scaled(float(np.median(finite)) if len(finite) else 0.0, unit)
    return factor * values_si, name


def answer_page(
    title: str,
    question: str,
    lines: Sequence[str],
    figures: Sequence[Drawing],
    tables: Sequence[Table],
    made: Provenance,
    facts: Sequence[Fact] = (),
) -> Page:
    """One page: the first line answers, the others follow, then the figures, then the tables.

    Figures are (name, caption, draw, data); `draw()` gives axes, in the product's style.
    """
    drawn = []
    for name, caption, draw, data in figures:
        with style():
            drawn.append(Figure(draw().figure, name, caption, data))
    told = [as_sentence(line) for line in lines]
    sections = [Section("Result", "\n\n".join(told[1:]), drawn)]
    sections += [Section("Numbers", tables=tables)] if tables else []
    terms = meanings(question, told[0], *(fact.label for fact in facts))
    return Page(title, question, told[0], sections, made, facts, terms)


def as_sentence(line: str) -> str:
    """The line with a capital, unless it begins with a name of ours."""
    first = line.split(maxsplit=1)[0].rstrip(":,")
    return line[0].upper() + line[1:] if first.isalpha() and first not in METRICS else line
