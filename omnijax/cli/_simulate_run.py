"""The run behind `omnijax simulate`: in closed form, or in pieces that outlive their process."""

import dataclasses
import json
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

from .._errors import InputError
from .._interrupts import answer, check, saying
from .._status import Status
from ._progress import bar


def asked_of(rig: Any, drive: Any, times: Any, numerics: dict[str, Any]) -> dict[str, Any]:
    """All that decides a run's numbers, as JSON has it."""
    import tomllib

    import jax
    import numpy as np

    from ..rig import rig_text

    leaves = {
        jax.tree_util.keystr(path).strip("."): _shown(np.asarray(leaf))
        for path, leaf in jax.tree_util.tree_leaves_with_path(drive)
    }
    found = {"rig": tomllib.loads(rig_text(rig)), "drive": {"kind": type(drive).__name__, **leaves}}
    found |= {"times": _shown(np.asarray(times)), "numerics": numerics}
    return json.loads(json.dumps(found))


def _shown(values: Any) -> Any:
    """Few values as they are, many by their number, ends and digest."""
    import hashlib

    if values.size <= 12:
        return values.tolist()
    digest = hashlib.sha256(values.astype(float).tobytes()).hexdigest()[:16]
    ends = f"{float(values.flat[0])!r} to {float(values.flat[-1])!r}"
    return f"{values.shape} values, {ends}, digest {digest}"


class Plan(NamedTuple):
    """How a run is made in pieces."""

    rig: Any
    drive: Any
    times: Any
    exact: bool
    how: dict[str, Any]  # numerics

    def parts(self, begun: Any, first: int) -> Any:
        """The pieces from the sample `first` on, which goes on from `begun` (None: the start)."""
        from ..simulation import propagate_in_pieces, solve_in_pieces

        where = {"begun": begun, "origin": float(self.times[0])}
        if self.exact:
            model = self.how["model"]
            return propagate_in_pieces(
                self.rig, self.drive, self.times[first:], model=model, **where
            )
        return solve_in_pieces(self.rig, self.drive, self.times[first:], **self.how, **where)

    def like(self) -> Any:
        """What a piece ends with, of the right shape."""
        from ..simulation import build_model, initial_state_like, reached_like

        if self.exact:
            return reached_like(self.rig, self.drive, self.how["model"])
        return initial_state_like(build_model(self.rig, self.how["model"]))

    def is_long(self) -> bool:
        """Whether the run has several pieces."""
        from ..simulation import EXACT_PIECE, STEPPED_PIECE

        return len(self.times) > (EXACT_PIECE if self.exact else STEPPED_PIECE)


def planned(rig: Any, drive: Any, times: Any, numerics: Any) -> Plan:
    """In closed form where there is one; else by the solver."""
    from ..simulation import exact_run_obstacle

    how: dict[str, Any] = {"model": numerics.model, "solver": numerics.solver}
    exact = numerics.solver in ("auto", "exact")
    if exact:
        obstacle = exact_run_obstacle(rig, drive, times, numerics.model)
        if obstacle and numerics.solver == "exact":
            raise InputError(f"`solver` cannot be exact: {obstacle}; take auto.")
        exact = not obstacle
    how |= {"rtol": numerics.rtol or 1e-8, "max_steps": numerics.max_steps or 200_000}
    return Plan(rig, drive, times, exact, how)


def interrupted_run(
    path: Path | None, asked: dict[str, Any], like: Any, force: bool
) -> tuple[Any, Any] | None:
    """The interrupted run in `path` and its end, like `like`; `InputError` for another run.

    None where only pieces are there.
    """
    import jax.numpy as jnp

    from ..simulation import load_end, load_run
    from ..study import differences

    if path is None:
        raise InputError("`resume` needs the interrupted run: --out RUN.")
    whole = path.name.lower().endswith(".nc")
    if pieces_folder(path).is_dir() and not (whole and path.exists() and not force):
        return None
    if not whole:
        raise InputError(f"there is no interrupted run: {pieces_folder(path)} is not there.", path)
    run = load_run(path)
    end, stored = load_end(path, like)
    found = differences(json.loads(stored), asked) if stored else ["it does not say what it is of"]
    if found:
        keys = "\n  ".join(found)
        raise InputError(f"is another run and is left as it is. They differ in:\n  {keys}", path)
    return dataclasses.replace(run, status=jnp.asarray(int(Status.OK))), end


def pieces_folder(out: Path) -> Path:
    """Where the pieces of a run lie until it is whole."""
    return out.with_name(f"{out.name}.pieces")


class Pieces:
    """The samples of a run so far, piece by piece on the disk: what a kill leaves."""

    def __init__(self, out: Path, asked: dict[str, Any], resume: bool, force: bool):
        from ..study import Folder

        self.path = pieces_folder(out)
        if force and not resume and (self.path / "study.json").is_file():
            shutil.rmtree(self.path)
        self._folder = Folder(self.path, asked, resume, "run")
        self.count = 0

    def read(self, like: Any) -> Iterator[tuple[Any, Any]]:
        """The pieces up to the first one that is missing or damaged, and what each ends with."""
        import jax.numpy as jnp
        from jax.flatten_util import ravel_pytree

        from ..simulation import Trajectory

        while (found := self._folder.read(f"piece-{self.count:06}")) is not None:
            flat = found.pop("end")
            about = json.loads(str(found.pop("about")))
            names = tuple(about["names"])
            run = Trajectory(**found, method=about["method"], names=names)  # pyright: ignore
            self.count += 1
            yield run, ravel_pytree(like)[1](jnp.asarray(flat))

    def add(self, run: Any, end: Any) -> None:
        """Keep one piece."""
        import numpy as np
        from jax.flatten_util import ravel_pytree

        arrays = {
            field.name: np.asarray(getattr(run, field.name))
            for field in dataclasses.fields(run)
            if field.name not in ("method", "names")
        }
        about = json.dumps({"method": run.method, "names": run.names})
        arrays |= {"end": np.asarray(ravel_pytree(end)[0]), "about": np.asarray(about)}
        self._folder.write(f"piece-{self.count:06}", arrays)
        self.count += 1

    def remove(self) -> None:
        """The run is in its file."""
        shutil.rmtree(self.path, ignore_errors=True)


def perform(
    plan: Plan, before: tuple[Any, Any] | None, pieces: Pieces | None, command: str
) -> tuple[Any, Any]:
    """The run and, where it was interrupted, what to go on from.

    `before` are samples from a file, with what they end with; `pieces` have those of a process
    that was killed, and take the new ones.
    """
    from ..simulation import Gathered

    runs, end, times = Gathered(len(plan.times)), None, plan.times
    if pieces is not None:
        for run, last in pieces.read(plan.like()):
            runs.add(run)
            end = last
    if before is not None and len(before[0].t) > runs.count:
        runs, end = Gathered(len(times)), before[1]
        runs.add(before[0])
        if pieces is not None:
            pieces.count = 0
            pieces.add(*before)
    try:
        with (
            bar(f"simulating {times[-1] - times[0]:g} s") as report,
            saying(_kept(pieces, command)),
        ):
            report(runs.count, len(times))
            parts = plan.parts(end, max(runs.count - 1, 0)) if runs.count < len(times) else ()
            for piece in parts:
                check()
                runs.add(piece.run)
                end = piece.end
                if pieces is not None:
                    pieces.add(piece.run, end)
                report(runs.count, len(times))
                if not piece.run.ok:
                    break
    except KeyboardInterrupt:
        answer()
        if not runs.count:
            raise KeyboardInterrupt("Interrupted before the first sample.") from None
        return runs.whole(Status.INTERRUPTED), end
    return runs.whole(), None


def _kept(pieces: Pieces | None, command: str) -> Callable[[], str]:
    def text() -> str:
        if pieces is None or not pieces.count:
            return "Interrupted: nothing was kept."
        return (
            f"Interrupted: what was computed is in {pieces.path}.\nGo on with: {command} --resume"
        )

    return text
