"""The run behind `omnijax simulate`: in closed form, or in pieces that can be interrupted."""

import dataclasses
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from .._errors import InputError


def interrupted_run(path: Path | None, rig: Any, model: str, command: str) -> tuple[Any, Any]:
    """The interrupted run in `path` and its last state; `InputError` where it is another run."""
    from ..simulate import load_trajectory
    from ..simulate._files import load_end
    from ..simulate._vector import build_model, initial_state_like

    if path is None or not path.name.endswith(".nc"):
        raise InputError("`resume` needs the interrupted run: --out RUN.nc.")
    run = load_trajectory(path)
    end, made = load_end(path, initial_state_like(build_model(rig, model)))
    if made != command:
        raise InputError(f"{path.name} was made by another command: {made}")
    return run, end


def perform(
    rig: Any, drive: Any, times: Any, before: tuple[Any, Any] | None, *, model: str, solver: str,
    **numerics: Any,
) -> tuple[Any, Any]:  # fmt: skip
    """The run and, where it was interrupted, the state to go on from."""
    import jax

    from ..simulate import exact_run_obstacle, propagate

    obstacle = exact_run_obstacle(rig, drive, times, model)
    if solver == "exact" and obstacle is not None:
        raise InputError(f"`solver` cannot be exact: {obstacle}; take auto.")
    if solver in ("auto", "exact") and obstacle is None:
        return jax.block_until_ready(propagate(rig, drive, times, model=model)), None
    return _in_pieces(rig, drive, times, before, model=model, solver=solver, **numerics)


def _in_pieces(rig: Any, drive: Any, times: Any, before, **options: Any) -> tuple[Any, Any]:
    from ..simulate._lengths import joined
    from ..simulate._solve import solve_in_pieces

    runs, end = ([], None) if before is None else ([before[0]], before[1])
    done = sum(len(run.t) for run in runs)
    pieces = solve_in_pieces(
        rig, drive, times[max(done - 1, 0) :], begun=end, origin=float(times[0]), **options
    )
    try:
        with _bar(f"simulating {times[-1] - times[0]:g} s", len(times), done) as advance:
            for piece in pieces:
                runs.append(piece.run)
                end = piece.end
                advance(len(piece.run.t))
    except KeyboardInterrupt:
        if not runs:
            raise KeyboardInterrupt("Interrupted before the first sample.") from None
        import jax.numpy as jnp

        return dataclasses.replace(joined(runs), status=jnp.asarray(4)), end
    return joined(runs), None


@contextmanager
def _bar(what: str, total: int, done: int) -> Iterator[Callable[[int], None]]:
    """A bar with the time left, where a person is watching."""
    import sys

    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    console = Console(file=sys.stderr)
    columns = (TextColumn("{task.description}"), BarColumn(), TimeRemainingColumn())
    shown = console.is_terminal
    with Progress(*columns, console=console, transient=True, disable=not shown) as progress:
        task = progress.add_task(what, total=total, completed=done)
        yield lambda samples: progress.advance(task, samples)
