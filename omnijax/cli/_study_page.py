"""Shared output of the studies' commands."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from .._interrupts import answer, saying
from ._options import command_line

Switch = Annotated[bool, Parameter(negative="")]


@contextmanager
def kept(store: Path | None) -> Iterator[None]:
    """An interruption of the work inside says what is kept and how to go on."""

    def text() -> str:
        if store is None:
            return "Interrupted: nothing was kept. With --store FOLDER finished parts would be."
        parts = len(list(store.glob("[!.]*.npz")))
        return (
            f"Interrupted: {parts} finished {'part is' if parts == 1 else 'parts are'} kept in "
            f"{store}. Continue with the same command and --resume."
        )

    try:
        with saying(text):
            yield
    except KeyboardInterrupt:
        answer()
        raise KeyboardInterrupt(text()) from None


def deliver(
    found: Any,
    out: Path | None,
    report: Path | None,
    made: Callable[[], Any],
    as_json: bool,
    plain: Any,
    text: Callable[[], None] | None = None,
) -> None:
    """What every study's command ends with: the file, the page and the printed answer."""
    from ._options import emit

    if out is not None:
        found.save(out)
    if report is not None:
        from ..report import study_page

        study_page(found, made()).write(report)
    emit(as_json, plain, text or (lambda: print("\n".join(found.sentences()))))


def made_by(study: Path, asked: Any) -> Any:
    """What makes a study's page again; where finished parts were kept changes nothing."""
    from ..report import provenance
    from ..rig import rig_text

    typed = command_line(without=("--resume",), valued=("--store",))
    text = study.read_text(encoding="utf-8")
    return provenance(typed, rig_text(asked.rig), asked.seed, text)


def made_by_rig(rig: Any) -> Any:
    """What makes a page again that needs a rig alone."""
    from ..report import provenance
    from ..rig import rig_text

    return provenance(command_line(), rig_text(rig))
