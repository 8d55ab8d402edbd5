"""The run behind `omnijax simulate`: in closed form, or in pieces that outlive their process."""

import json
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from ..._errors import InputError
from ..._files import pieces_folder
from ..._interrupts import NOTHING, raise_lost
from .._console import bar


def asked_of(rig: Any, drive: Any, times: Any, numerics: dict[str, Any]) -> dict[str, Any]:
    """All that decides a run's numbers, as JSON has it."""
    import jax
    import numpy as np

    from ...rig import rig_identity

    leaves = {
        jax.tree_util.keystr(path).strip("."): _shown(np.asarray(leaf))
        for path, leaf in jax.tree_util.tree_leaves_with_path(drive)
    }
    asked = {"rig": rig_identity(rig), "drive": {"kind": type(drive).__name__, **leaves}}
    asked |= {"times": _shown(np.asarray(times)), "numerics": numerics}
    return json.loads(json.dumps(asked))


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
    times: Any  # of the samples, and of the points between them where a sensor remembers
    points: int  # a sample
    exact: bool
    how: dict[str, Any]  # numerics

    def parts(self, begun: Any, first: int) -> Any:
        """The pieces from the sample `first` on, which goes on from `begun` (None: the start)."""
        from ...simulation import propagate_in_pieces, solve_in_pieces

        where = {"begun": begun, "origin": float(self.times[0])}
        if self.exact:
            model = self.how["model"]
            return propagate_in_pieces(
                self.rig, self.drive, self.times[first:], model=model, **where
            )
        return solve_in_pieces(self.rig, self.drive, self.times[first:], **self.how, **where)

    def like(self) -> Any:
        """What a piece ends with, of the right shape."""
        from ...simulation import build_model, initial_state_like, reached_like

        if self.exact:
            return reached_like(self.rig, self.drive, self.how["model"])
        return initial_state_like(build_model(self.rig, self.how["model"]))

    def is_long(self) -> bool:
        """Whether the run has several pieces."""
        from ...simulation import EXACT_PIECE, STEPPED_PIECE

        return len(self.times) > (EXACT_PIECE if self.exact else STEPPED_PIECE)


def planned(rig: Any, drive: Any, times: Any, numerics: Any) -> Plan:
    """In closed form where there is one; else by the solver."""
    import numpy as np

    from ...simulation import MAX_STEPS, RTOL, goes_exactly, to_be_seen

    rig, times, points = to_be_seen(rig, times)
    times = np.asarray(times)
    how: dict[str, Any] = {"model": numerics.model, "solver": numerics.solver}
    exact = goes_exactly(rig, drive, times, numerics.model, numerics.solver)
    how |= {"rtol": numerics.rtol or RTOL, "max_steps": numerics.max_steps or MAX_STEPS}
    return Plan(rig, drive, times, points, exact, how)


def whole_run(out: Path | None, asked: dict[str, Any], force: bool) -> Any:
    """The run that a resumed command asks for where `out` holds it whole already; else None.

    A kill may have come before its pieces were removed: then they end it, and go.  `InputError`
    where `out` is a run that was asked for otherwise.
    """
    from ...simulation import Trajectory, asked_in
    from ...study import differences

    if out is None:
        raise InputError("`resume` needs the interrupted run: --out RUN.")
    if force or not out.exists():
        return None
    stored = asked_in(out)
    differing = differences(json.loads(stored), asked) if stored else ["it does not say what of"]
    if differing:
        keys = "\n  ".join(differing)
        raise InputError(f"is another run and is left as it is. They differ in:\n  {keys}", out)
    return None if pieces_folder(out).is_dir() else Trajectory.load(out)


class StoredPieces:
    """The samples of a run so far, piece by piece on the disk: what a kill leaves."""

    def __init__(self, out: Path, asked: dict[str, Any], resume: bool, force: bool):
        from ...study import Folder

        self.path = pieces_folder(out)
        if force and not resume and (self.path / "study.json").is_file():
            shutil.rmtree(self.path)
        self._folder = Folder(self.path, asked, resume, "run")
        self.count = 0
        self._times = (0.0, 0.0)  # first and last sample that the pieces hold, s

    def read(self, like: Any) -> Iterator[tuple[Any, Any]]:
        """The pieces up to the first one that is missing or damaged, and what each ends with."""
        import jax.numpy as jnp
        from jax.flatten_util import ravel_pytree

        from ...simulation import Trajectory

        while (stored := self._folder.read(f"piece-{self.count:06}")) is not None:
            flat = stored.pop("end")
            about = json.loads(str(stored.pop("about")))
            names = tuple(about["names"])
            run = Trajectory(**stored, method=about["method"], names=names)  # pyright: ignore
            self._count(run)
            yield run, ravel_pytree(like)[1](jnp.asarray(flat))

    def add(self, run: Any, end: Any) -> None:
        """Keep one piece."""
        import numpy as np
        from jax.flatten_util import ravel_pytree

        names = (*run.UNITS, "status", "steps")
        arrays = {name: np.asarray(getattr(run, name)) for name in names}
        about = json.dumps({"method": run.method, "names": run.names})
        arrays |= {"end": np.asarray(ravel_pytree(end)[0]), "about": np.asarray(about)}
        self._folder.write(f"piece-{self.count:06}", arrays)
        self._count(run)

    def _count(self, run: Any) -> None:
        first = self._times[0] if self.count else float(run.t[0])
        self._times = first, float(run.t[-1])
        self.count += 1

    def remove(self) -> None:
        """The run is in its file."""
        shutil.rmtree(self.path, ignore_errors=True)
        self.count = 0

    def kept(self, command: str) -> str:
        """What an interruption leaves, and how to go on."""
        if not self.count:
            return NOTHING
        first, last = self._times
        return (
            f"Interrupted after {last - first:.4g} s: what was computed is in {self.path}, and "
            f"this goes on with it: {command} --resume"
        )


def perform(plan: Plan, pieces: StoredPieces | None) -> Any:
    """The run; `pieces` have what an ended process computed of it, and take what is new."""
    from ...simulation import Gathered, at_samples

    runs, end, times = Gathered(len(plan.times)), None, plan.times
    if pieces is not None:
        for run, last in pieces.read(plan.like()):
            runs.add(run)
            end = last

    with bar(f"simulating {times[-1] - times[0]:g} s") as report:
        report(runs.count, len(times))
        parts = plan.parts(end, max(runs.count - 1, 0)) if runs.count < len(times) else ()
        for piece in parts:
            raise_lost()
            runs.add(piece.run)
            if pieces is not None:
                pieces.add(piece.run, piece.end)
            report(runs.count, len(times))
            if not piece.run.ok:
                break
    return at_samples(runs.whole(), plan.points)
