"""The run behind `omnijax simulate`: in closed form, or in pieces that can be interrupted."""

import dataclasses
from pathlib import Path
from typing import Any

from .._errors import InputError
from .._status import Status
from ._progress import bar


def interrupted_run(path: Path | None, rig: Any, model: str, command: str) -> tuple[Any, Any]:
    """The interrupted run in `path` and its last state; `InputError` where it is another run."""
    from ..simulation import build_model, initial_state_like, load_end, load_trajectory

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

    from ..simulation import exact_run_obstacle, simulate

    if solver == "exact" or (solver == "auto" and not exact_run_obstacle(rig, drive, times, model)):
        run = simulate(rig, drive, times, model=model, solver="exact")
        return jax.block_until_ready(run), None
    return _in_pieces(rig, drive, times, before, model=model, solver=solver, **numerics)


def _in_pieces(rig: Any, drive: Any, times: Any, before, **options: Any) -> tuple[Any, Any]:
    from ..simulation import joined, solve_in_pieces

    runs, end = ([], None) if before is None else ([before[0]], before[1])
    done = sum(len(run.t) for run in runs)
    pieces = solve_in_pieces(
        rig, drive, times[max(done - 1, 0) :], begun=end, origin=float(times[0]), **options
    )
    try:
        with bar(f"simulating {times[-1] - times[0]:g} s") as report:
            report(done, len(times))
            for piece in pieces:
                runs.append(piece.run)
                end = piece.end
                done += len(piece.run.t)
                report(done, len(times))
    except KeyboardInterrupt:
        if not runs:
            raise KeyboardInterrupt("Interrupted before the first sample.") from None
        import jax.numpy as jnp

        return dataclasses.replace(joined(runs), status=jnp.asarray(Status.INTERRUPTED)), end
    return joined(runs), None
