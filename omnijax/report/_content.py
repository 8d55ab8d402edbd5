"""What a page holds: sections of text, figures and tables, and how it came to be."""

import platform
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib import metadata
from typing import Any

import numpy as np
from matplotlib.figure import Figure as Drawn

from ._axis import SpeedAxis

VERSIONS_OF = ("omnijax", "jax", "diffrax", "equinox", "numpy", "matplotlib")


@dataclass(frozen=True)
class Column:
    """A table's column: its name and unit; `text` columns are set as prose, left-aligned.

    `minor` columns are left out on a telephone, so that those that matter stay in sight; a
    `unbroken` one holds values with units, which stay in one line.
    """

    name: str
    unit: str = ""
    text: bool = False
    minor: bool = False
    unbroken: bool = False


@dataclass(frozen=True)
class Badge:
    """A cell that judges: `tone` is good, mixed or bad; shown by colour, sign and word."""

    text: str
    tone: str

    def __str__(self) -> str:
        return self.text


@dataclass(frozen=True)
class Table:
    """Rows under columns with units.  `name` names its CSV; `caption` says what it shows.

    A cell is a number, a text, a `Badge`, or a tuple of texts (a list in the page).
    `stacked` turns every row into a card on narrow screens: for tables of sentences.  `folded`
    puts it behind the figures, to be opened by its caption.
    """

    columns: Sequence[Column]
    rows: Sequence[Sequence[Any]]
    name: str = ""
    caption: str = ""
    stacked: bool = False
    folded: bool = False

    def texts(self) -> list[list[Any]]:
        """The rows as a page shows them: the numbers of a column with the same places."""
        columns = [column_texts([row[i] for row in self.rows]) for i in range(len(self.columns))]
        return [list(row) for row in zip(*columns, strict=True)]


@dataclass(frozen=True)
class Figure:
    """A drawn figure, the numbers in it, and one sentence on what it shows.

    `name` names its files; `data` maps "name / unit" to a column of the CSV; `axis` makes the x
    axis selectable in rpm, rad/s, Hz and orders (the figure is then drawn over rad/s).
    """

    fig: Drawn
    name: str
    caption: str
    data: Mapping[str, Any] = field(default_factory=dict)
    axis: SpeedAxis | None = None


@dataclass(frozen=True)
class Dial:
    """Sliders of a page: residuals as shares of sizes change, mixed offline from stored ones.

    `model` is what `dial.js` reads: JSON of sliders, traces and mean products.
    """

    model: Mapping[str, Any]


@dataclass(frozen=True)
class Section:
    """A headed part of a page; `text` is prose: empty lines part it, backticks mark code."""

    title: str
    text: str = ""
    figures: Sequence[Figure] = ()
    tables: Sequence[Table] = ()
    dial: Dial | None = None


@dataclass(frozen=True)
class Fact:
    """A number of the answer: what it is, its value and unit."""

    label: str
    value: Any
    unit: str = ""


@dataclass(frozen=True)
class Provenance:
    """What makes the page again: command, texts of rig and study file, seed, versions."""

    command: str
    rig: str = ""
    seed: int | None = None
    versions: Mapping[str, str] = field(default_factory=dict)
    study: str = ""


def provenance(command: str, rig: str = "", seed: int | None = None, study: str = "") -> Provenance:
    """Provenance of a page made now, with this machine's versions."""
    versions = {"python": platform.python_version()}
    for name in VERSIONS_OF:
        try:
            versions[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            versions[name] = "not installed"
    return Provenance(command, rig, seed, versions, study)


def shown(value: Any) -> str:
    """A cell's text: numbers in four figures with a true minus sign, everything else as it is."""
    if value is None:
        return "–"
    if isinstance(value, bool | np.bool_):
        return "yes" if value else "no"
    if isinstance(value, str | Badge) or np.asarray(value).dtype.kind not in "iuf":
        return str(value)
    if np.ndim(value):
        return ", ".join(shown(x) for x in np.ravel(value))
    return _number(np.asarray(value))


def column_texts(values: Sequence[Any]) -> list[Any]:
    """Cells of a column; numbers of one size with as many places as the largest shows in four."""
    floats = [float(v) for v in values if _real(v)]
    sizes = [abs(v) for v in floats if v != 0 and np.isfinite(v)]
    if len(sizes) < 2 or not 1e-3 <= max(sizes) < 1e5 or min(sizes) < max(sizes) / 20:
        return list(values)
    places = max(0, 3 - int(np.floor(np.log10(max(sizes)))))
    return [
        f"{float(v):.{places}f}".replace("-", "−") if _real(v) and np.isfinite(v) else v
        for v in values
    ]  # fmt: skip


def _real(value: Any) -> bool:
    return isinstance(value, float | np.floating)


def _number(value: np.ndarray) -> str:
    if value.dtype.kind in "iu" or not np.isfinite(value):
        return str(value).replace("-", "−")
    mantissa, _, exponent = f"{float(value):.4g}".replace("-", "−").partition("e")
    return f"{mantissa} × 10^{exponent.lstrip('+0').replace('−0', '−')}" if exponent else mantissa
