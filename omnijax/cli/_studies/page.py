"""What the commands of study files share: where they keep and deliver, and the way there."""

from collections.abc import Callable, Iterable
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from ..._files import claim
from ..._interrupts import resumable
from ..._reading import existing
from .._console import bar, paragraph
from .._inputs import Force, Json, check_ending, command_line, emit

Switch = Annotated[bool, Parameter(negative="")]


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Results:
    """Where a study's work is kept, and where its answer goes."""

    store: Path | None = None
    """A folder for finished parts of the work."""
    resume: Switch = False
    """Take up the parts of that folder; with none there it begins from the start."""
    out: Path | None = None
    """A netCDF file for the result."""
    report: Path | None = None
    """A folder for a page with the figures."""
    force: Force = False
    json: Json = False


def worked(
    study: Path,
    results: Results,
    parts: str,
    run: Callable[..., Any],
    files: Callable[[Any], Iterable[Path]] = lambda asked: (),
) -> tuple[Any, Any]:
    """The study of a file and its result; `files` are written beside, `parts` are counted."""
    existing(study)
    check_ending(results.out, ".nc")
    from ...study import load_study

    asked = load_study(study)
    claim([results.out, *files(asked)], [results.report], force=results.force)
    with _kept(results.store), bar(parts) as progress:
        return asked, run(asked, out=results.store, resume=results.resume, report=progress)


def finish(
    study: Path,
    results: Results,
    asked: Any,
    result: Any,
    plain: Any,
    text: Callable[[], None] | None = None,
) -> None:
    """The file, the page and the printed answer of a study; its parts are still there."""
    with _kept(results.store):
        deliver(
            result,
            results.out,
            results.report,
            lambda: _made_by(study, asked),
            results.json,
            plain,
            text,
        )


def _kept(store: Path | None) -> AbstractContextManager[None]:
    """An interruption of the work inside says what is kept and how to go on."""

    def text() -> str:
        if store is None:
            return "Interrupted: nothing was kept. With --store FOLDER finished parts would be."
        parts = len(list(store.glob("[!.]*.npz")))
        return (
            f"Interrupted: {parts} finished {'part is' if parts == 1 else 'parts are'} kept in "
            f"{store}. Continue with the same command and --resume."
        )

    return resumable(text)


def deliver(
    result: Any,
    out: Path | None,
    report: Path | None,
    made: Callable[[], Any],
    as_json: bool,
    plain: Any,
    text: Callable[[], None] | None = None,
) -> None:
    """What every study's command ends with: the file, the page and the printed answer."""
    if out is not None:
        result.save(out)
    if report is not None:
        from ...report import study_page

        study_page(result, made()).write(report)
    told = (paragraph(line, "  ") for line in result.sentences())
    emit(as_json, plain, text or (lambda: print("\n".join(told))))


def _made_by(study: Path, asked: Any) -> Any:
    """What makes a study's page again; where finished parts were kept changes nothing."""
    from ...report import provenance
    from ...rig import rig_text

    typed = command_line(without=("--resume",), valued=("--store",))
    text = study.read_text(encoding="utf-8")
    return provenance(typed, rig_text(asked.rig), asked.seed, text)


def made_by_rig(rig: Any) -> Any:
    """What makes a page again that needs a rig alone."""
    from ...report import provenance
    from ...rig import rig_text

    return provenance(command_line(), rig_text(rig))
