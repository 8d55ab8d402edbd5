"""`omnijax replay`: one offline file that shows a run."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from .._files import claim
from .._reading import existing
from ._inputs import Force, Json, check_ending, emit, file_kind, replay_axis


def replay(
    run: Path,
    /,
    *,
    out: Annotated[Path | None, Parameter(name=["--out", "-o"])] = None,
    drive: Path | None = None,
    title: str | None = None,
    force: Force = False,
    json: Json = False,
) -> None:
    """Write an offline page that replays a run: scene, scrubber, speed, exaggeration.

    Example: omnijax replay run.nc --out replay.html

    Parameters
    ----------
    run
        A run saved by `omnijax simulate --out RUN.nc`; or a machine file of an axis, whose signals
        are shown.
    out
        The page; the run's name with .html where it is not given.
    drive
        Of a machine file: the log whose inputs move it.
    title
        Heading of the page; the run's name where it is not given.
    """
    from .._errors import InputError

    existing(run)
    check_ending(out, ".html", ".htm")
    if file_kind(run) == "machine":
        return replay_axis(run, drive, out or run.with_suffix(".html"), title, force, json)
    if drive is not None:
        raise InputError("--drive speaks of a machine file; a saved run has moved already.")
    if run.suffix.lower() not in (".nc", ".csv", ".gz", ".parquet"):  # of a recording it is told
        raise InputError(
            "`replay` takes a run saved by `omnijax simulate --out RUN.nc`, or the machine file of "
            f"an axis; {run.name} is neither."
        )
    from ..simulation import load_run
    from ..view import rig_of_run, write_replay

    trajectory, page = load_run(run), out or run.with_suffix(".html")
    claim([page], force=force)
    try:
        path = write_replay(trajectory, rig_of_run(run), page, title or run.stem)
    except InputError:
        raise
    except ValueError as error:
        raise InputError(f"{run.name}: {error}") from error
    size = path.stat().st_size
    emit(json, {"page": str(path), "bytes": size}, lambda: print(f"{path} ({size / 1e6:.2f} MB)"))
