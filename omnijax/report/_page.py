"""One offline HTML page from structured content."""

import base64
import hashlib
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from urllib.parse import quote

import jinja2
from markupsafe import Markup, escape

from .._files import write_bytes, write_text
from ._content import Badge, Column, Fact, Figure, Provenance, Section, Table, shown
from ._csv import figure_csv, table_csv
from ._style import raised
from ._svg import Renderings, rendered

TEMPLATES = Path(__file__).parent / "templates"


@dataclass(frozen=True)
class Page:
    """A page: a question, its answer first, then sections; `write` makes the files.

    `terms` says what names of the answer mean.
    """

    title: str
    question: str
    answer: str
    sections: Sequence[Section]
    provenance: Provenance
    facts: Sequence[Fact] = ()
    terms: Mapping[str, str] = field(default_factory=dict)

    def write(self, folder: str | Path, name: str = "index.html") -> Path:
        """Page, PNGs and CSVs in `folder`; the page also holds the others, so it travels alone."""
        folder = Path(folder)
        renderings = self._rendered()
        for part in self.sections:
            for figure in part.figures:
                picture = renderings[figure.name].png
                write_bytes(folder / f"{file_name(figure.name)}.png", picture)
                if figure.data:
                    csv = figure_csv(figure.data)
                    write_text(folder / f"{file_name(figure.name)}.csv", csv)
            for table in part.tables:
                if table.name:
                    csv = table_csv(table)
                    write_text(folder / f"{file_name(table.name)}.csv", csv)
        return write_text(folder / name, self._html(renderings))

    def html(self) -> str:
        """The whole page as text."""
        return self._html(self._rendered())

    def _rendered(self) -> dict[str, Renderings]:
        figures = [figure for part in self.sections for figure in part.figures]
        return {f.name: rendered(f.fig, file_name(f.name), f.axis) for f in figures}

    def _html(self, renderings: Mapping[str, Renderings]) -> str:
        script = "".join(
            (TEMPLATES / name).read_text(encoding="utf-8") for name in ("page.js", "dial.js")
        )
        digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
        return (
            _environment()
            .get_template("page.html.j2")
            .render(
                page=self,
                renderings=renderings,
                css=Markup((TEMPLATES / "page.css").read_text(encoding="utf-8")),
                script=Markup(script),
                digest=digest,
            )
        )


def file_name(name: str) -> str:
    """`name` without anything that a file system or a link could take for more than a name."""
    return re.sub(r"[^A-Za-z0-9._-]+", "-", name).strip("-.") or "unnamed"


def prose(text: str) -> list[Markup]:
    """Paragraphs, escaped; `code` in backticks."""
    paragraphs = [p.strip() for p in re.split(r"\n\s*\n", text) if p.strip()]
    return [_inline(p) for p in paragraphs]


def _inline(text: str) -> Markup:
    safe = str(escape(text))
    safe = re.sub(r"`([^`]+)`", r"<code>\1</code>", safe)
    safe = re.sub(r"(?<=[a-z0-9])\.(?=[a-z])", ".<wbr>", safe)  # a path may break at its dots
    return Markup(re.sub(r"10\^(−?\d+)", r"10<sup>\1</sup>", raised(safe)))


def _data_link(text: str | bytes, kind: str) -> str:
    if isinstance(text, bytes):
        return f"data:{kind};base64,{base64.b64encode(text).decode()}"
    return f"data:{kind};charset=utf-8,{quote(text)}"


def _svgs(renderings: Renderings) -> list[tuple[str, Markup, Markup]]:
    return [(d.unit, Markup(d.wide), Markup(d.narrow)) for d in renderings.drawings]


def _environment() -> jinja2.Environment:
    env = jinja2.Environment(
        loader=jinja2.FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    env.filters |= {
        "prose": prose,
        "inline": _inline,
        "shown": lambda value: _inline(shown(value)),
        "units": raised,
        "json": lambda value: json.dumps(value, allow_nan=False),
        "classes": _classes,
        "file": file_name,
        "svgs": _svgs,
        "png_link": _png_link,
        "csv_link": _csv_link,
    }
    env.tests["lines"] = lambda value: isinstance(value, tuple) and _texts(value)
    env.tests["badge"] = lambda value: isinstance(value, Badge)
    return env


def _classes(column: Column) -> Markup:
    """The class attribute of a column's cells."""
    names = " ".join(name for name in ("text", "minor", "unbroken") if getattr(column, name))
    return Markup(f' class="{names}"') if names else Markup("")


def _texts(values: tuple) -> bool:
    return all(isinstance(value, str) for value in values)


def _png_link(renderings: Renderings) -> str:
    return _data_link(renderings.png, "image/png")


def _csv_link(part: Figure | Table) -> str:
    text = table_csv(part) if isinstance(part, Table) else figure_csv(part.data)
    return _data_link(text, "text/csv")
