"""The run behind `omnijax simulate`: in closed form, or in pieces that outlive their process."""

import dataclasses
import json
import shutil
from pathlib import Path
from typing import Any

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


def interrupted_run(path: Path | None, rig: Any, asked: dict[str, Any]) -> tuple[Any, Any] | None:
    """The interrupted run in `path` and its last state; `InputError` where it is another run.

    None where only the pieces of a killed process are there.
    """
    from ..simulation import build_model, initial_state_like, load_end, load_run
    from ..study import differences

    if path is None or not path.name.lower().endswith(".nc"):
        raise InputError("`resume` needs the interrupted run: --out RUN.nc.")
    if not path.exists() and pieces_folder(path).is_dir():
        return None
    run = load_run(path)
    end, stored = load_end(path, initial_state_like(build_model(rig, asked["numerics"]["model"])))
    found = differences(json.loads(stored), asked) if stored else ["it does not say what it is of"]
    if found:
        keys = "\n  ".join(found)
        raise InputError(f"is another run and is left as it is. They differ in:\n  {keys}", path)
    return run, end


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

    def read(self, like: Any) -> tuple[list[Any], Any]:
        """The pieces up to the first one that is missing or damaged, and the state after them."""
        import jax.numpy as jnp
        from jax.flatten_util import ravel_pytree

        from ..simulation import Trajectory

        runs, end = [], None
        while (found := self._folder.read(f"piece-{self.count:06}")) is not None:
            flat = found.pop("end")
            about = json.loads(str(found.pop("about")))
            names = tuple(about["names"])
            fields = {name: jnp.asarray(value) for name, value in found.items()}
            runs.append(Trajectory(**fields, method=about["method"], names=names))
            end = ravel_pytree(like)[1](jnp.asarray(flat))
            self.count += 1
        return runs, end

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
    rig: Any, drive: Any, times: Any, before: tuple[Any, Any] | None, pieces: Pieces | None,
    command: str, *, model: str, solver: str, **numerics: Any,
) -> tuple[Any, Any]:  # fmt: skip
    """The run and, where it was interrupted, the state to go on from."""
    from ..simulation import joined, solve_in_pieces

    runs, end = ([], None) if before is None else ([before[0]], before[1])
    if pieces is not None and before is None:
        from ..simulation import build_model, initial_state_like

        runs, end = pieces.read(initial_state_like(build_model(rig, model)))
    done = sum(len(run.t) for run in runs)
    parts = solve_in_pieces(
        rig, drive, times[max(done - 1, 0) :], begun=end, origin=float(times[0]),
        model=model, solver=solver, **numerics,
    )  # fmt: skip
    try:
        with (
            bar(f"simulating {times[-1] - times[0]:g} s") as report,
            saying(_kept(pieces, command)),
        ):
            report(done, len(times))
            for piece in parts if done < len(times) else ():
                check()
                runs.append(piece.run)
                end = piece.end
                if pieces is not None:
                    pieces.add(piece.run, end)
                done += len(piece.run.t)
                report(done, len(times))
    except KeyboardInterrupt:
        answer()
        if not runs:
            raise KeyboardInterrupt("Interrupted before the first sample.") from None
        import jax.numpy as jnp

        return dataclasses.replace(joined(runs), status=jnp.asarray(Status.INTERRUPTED)), end
    return joined(runs), None


def _kept(pieces: Pieces | None, command: str):
    def text() -> str:
        if pieces is None or not pieces.count:
            return "Interrupted: nothing was kept."
        return (
            f"Interrupted: what was computed is in {pieces.path}.\nGo on with: {command} --resume"
        )

    return text
