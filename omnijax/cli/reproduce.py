"""`omnijax reproduce`: the paper's figures, claims and errata on one page."""

from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from ._inputs import Force, Json, Whole, emit


def reproduce(
    *,
    out: Annotated[Path, Parameter(name=["--out", "-o"])],
    samples: Whole = 4,
    seed: Whole = 0,
    force: Force = False,
    json: Json = False,
) -> int:
    """Remake the paper: its figures 7 to 14, its claims judged, its errata checked.

    Example: omnijax reproduce --out paper

    Parameters
    ----------
    out
        Folder for index.html, claims.json, fig07.png … fig14.png and the numbers as CSV.
    samples
        Points of the parameters that the paper does not give, beside the bundled rig's own.
    seed
        Of the points.
    """
    import os

    from .._errors import InputError
    from .._files import claim

    # a failed check inside a compiled solve then gives NaN, which no reading accepts, and needs no
    # call back to Python: without one, JAX keeps the program for the next process
    os.environ.setdefault("EQX_ON_ERROR", "nan")
    if samples < 1:
        raise InputError([f"`--samples` must be at least 1, but is {samples}."])
    claim(folders=[out], force=force)
    from ..paper import STEPS
    from ..paper import reproduce as remake

    with _progress() as bar:
        task = bar.add_task("starting", total=STEPS)

        def say(step: str) -> None:
            bar.update(task, description=step, advance=1)

        reproduction = remake(out, samples=samples, seed=seed, say=say)
        bar.update(task, description="done", completed=STEPS)
    emit(
        json,
        {**reproduction.to_json(), "page": str(reproduction.page)},
        lambda: _print(reproduction),
    )
    return 0


def _progress() -> Any:
    """A bar on the error stream, so that the output stays for results."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.completed}/{task.total}"),
        TimeElapsedColumn(),
        console=Console(stderr=True),
        transient=True,
    )


def _print(reproduction: Any) -> None:
    for claim in reproduction.claims:
        print(f"{claim.verdict:28} {claim.content}")
    borne = sum(row.confirmed for row in reproduction.errata)
    print(f"{borne} of {len(reproduction.errata)} errata of the paper are borne out by a number.")
    print(f"page: {reproduction.page}")
