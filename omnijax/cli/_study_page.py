"""Pages and shared output of the studies' commands."""

import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any


def progress(what: str) -> Callable[[int, int], None]:
    """A line on stderr that is written again as work is done; silent where no one looks."""
    begun = time.monotonic()

    def report(done: int, total: int) -> None:
        if sys.stderr.isatty():
            left = (time.monotonic() - begun) * (total - done) / max(done, 1)
            end = "\n" if done >= total else ""
            text = f"\r{what}: {done} of {total}, about {left:.0f} s left   "
            print(text, end=end, file=sys.stderr, flush=True)

    return report


def deliver(result: Any, out: Path | None) -> None:
    """Save the result where asked to."""
    if out is not None:
        result.save(out)


def write_page(
    folder: Path,
    title: str,
    question: str,
    lines: Sequence[str],
    figures: Sequence[tuple[str, str, Callable[[], Any], dict[str, Any]]],
    tables: Sequence[Any],
    rig: str = "",
    seed: int | None = None,
) -> Path:
    """One page: the first line answers, the others follow; figures are (name, caption, draw, data).

    `draw()` gives axes and is called inside the product's style.
    """
    from ..report import Figure, Page, Section, provenance, style

    drawn = []
    for name, caption, draw, data in figures:
        with style():
            drawn.append(Figure(draw().figure, name, caption, data))
    sections = [Section("Result", "\n\n".join(lines[1:]), drawn, tables)]
    command = "omnijax " + " ".join(sys.argv[1:])
    page = Page(title, question, lines[0], sections, provenance(command, rig, seed))
    return page.write(folder)
