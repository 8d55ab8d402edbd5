"""Pages and shared output of the studies' commands."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from ._options import command_line

Switch = Annotated[bool, Parameter(negative="")]


@contextmanager
def kept(store: Path | None) -> Iterator[None]:
    """An interruption of the work inside says what is kept and how to go on."""
    try:
        yield
    except KeyboardInterrupt:
        if store is None:
            text = "Interrupted: nothing was kept. With --store FOLDER finished parts would be."
        else:
            parts = len(list(store.glob("[!.]*.npz")))
            text = (
                f"Interrupted: {parts} finished {'part is' if parts == 1 else 'parts are'} kept in "
                f"{store}. Continue with the same command and --resume."
            )
        raise KeyboardInterrupt(text) from None


def deliver(
    found: Any,
    out: Path | None,
    report: Path | None,
    page: Callable[[Path], None],
    as_json: bool,
    plain: Any,
    text: Callable[[], None] | None = None,
) -> None:
    """What every study's command ends with: the file, the page and the printed answer."""
    from ._options import emit

    if out is not None:
        found.save(out)
    if report is not None:
        page(report)
    emit(as_json, plain, text or (lambda: print("\n".join(found.sentences()))))


def made_by(study: Path, asked: Any) -> Any:
    """What makes a study's page again; where finished parts were kept changes nothing."""
    from ..report import provenance
    from ..rig import rig_text

    typed = command_line(without=("--resume",), valued=("--store",))
    text = study.read_text(encoding="utf-8")
    return provenance(typed, rig_text(asked.rig), asked.seed, text)


def readable(values: Any, unit: str) -> tuple[Any, str]:
    """Values in the unit that their middle one reads well in, and that unit."""
    import numpy as np

    from .._text import scaled

    found = np.asarray(values, float)
    finite = np.abs(found[np.isfinite(found)])
    factor, name = scaled(float(np.median(finite)) if len(finite) else 0.0, unit)
    return factor * found, name


def write_page(
    folder: Path,
    title: str,
    question: str,
    lines: Sequence[str],
    figures: Sequence[tuple[str, str, Callable[[], Any], dict[str, Any]]],
    tables: Sequence[Any],
    made: Any,
    facts: Sequence[Any] = (),
) -> Path:
    """One page: the first line answers, the others follow, then the figures, then the tables.

    Figures are (name, caption, draw, data); `draw()` gives axes, in the product's style.
    """
    from ..report import Figure, Page, Section, style

    drawn = []
    for name, caption, draw, data in figures:
        with style():
            drawn.append(Figure(draw().figure, name, caption, data))
    told = [_sentence(line) for line in lines]
    sections = [Section("Result", "\n\n".join(told[1:]), drawn)]
    sections += [Section("Numbers", tables=tables)] if tables else []
    page = Page(title, question, told[0], sections, made, facts)
    return page.write(folder)


def _sentence(line: str) -> str:
    """The line with a capital, unless it begins with a name of ours."""
    from ..vibration import METRICS

    first = line.split(maxsplit=1)[0].rstrip(":,")
    return line[0].upper() + line[1:] if first.isalpha() and first not in METRICS else line
