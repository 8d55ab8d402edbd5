"""Finished parts of a long study in a folder, and how an interrupted one is taken up again.

Designs, fronts, tolerances, global studies and the pieces of a long run are kept here: few parts,
of whatever arrays they have.  A sweep has a store of its own, `_sweep/store.py`: there the parts
are the result, arrays over up to millions of designs, read by slices and by several processes.
"""

import hashlib
import json
import weakref
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from .._errors import InputError, tell
from .._files import claim, real, write_text, writing
from .._lock import Lock
from ._differences import differences, plain

Report = Callable[[int, int], None]


class Folder:
    """Finished parts of a study as small files; `identity` is all that decides its numbers.

    One process writes it at a time.  Every part is whole and says its checksum; a damaged one is
    named and computed again.
    """

    def __init__(
        self, folder: str | Path, identity: Mapping[str, Any], resume: bool, what: str = "study"
    ):
        self.folder = Path(folder)
        mark, asked = self.folder / "study.json", plain(identity)
        if mark.exists():
            if not resume:
                raise InputError(f"holds a {what} already: continue with --resume.", folder)
            differing = differences(_stored(mark), json.loads(json.dumps(asked)))
            if differing:
                keys = "\n  ".join(differing)
                raise InputError(
                    f"holds another {what} and is left as it is. They differ in:\n  {keys}", folder
                )
        else:
            claim(folders=[self.folder])
            if resume:
                tell_of_a_start(self.folder)
            write_text(mark, json.dumps(asked, indent=1))
        self._lock = _locked(real(mark), what)

    def read(self, key: str) -> dict[str, np.ndarray] | None:
        """What `write` stored under `key`; None where it is not there, or damaged."""
        path = self.folder / f"{key}.npz"
        if not path.exists():
            return None
        try:
            with zipfile.ZipFile(path) as file:
                said = file.comment.decode("ascii")
            with np.load(path, allow_pickle=False) as file:
                arrays = {name: file[name] for name in file.files}
        except Exception:  # zipfile, zlib and numpy raise whatever they like on a broken file
            arrays, said = {}, "broken"
        if said and _digest(arrays) != said:
            tell([f"{path}: is damaged: this part is computed again."])
            return None
        return arrays

    def write(self, key: str, arrays: dict[str, np.ndarray]) -> None:
        """Store arrays; a killed write leaves no half file."""
        with writing(self.folder / f"{key}.npz", ours=True) as part:
            np.savez(part, **arrays)  # pyright: ignore[reportArgumentType]
            with zipfile.ZipFile(part, "a") as file:
                file.comment = _digest(arrays).encode("ascii")


def tell_of_a_start(folder: Path) -> None:
    """Say that there is nothing to go on with: the kill came early, or another name is meant."""
    tell([f"{folder}: nothing is kept there yet, so it begins from the start."])


_locks: weakref.WeakValueDictionary[Path, Lock] = weakref.WeakValueDictionary()


def _locked(mark: Path, what: str) -> Lock:
    """This process's lock of a study: one for all that write it here, until the last is gone."""
    held = _locks.get(mark)
    if held is None:
        held = _locks[mark] = Lock(mark, what)
    return held


def _digest(arrays: Mapping[str, np.ndarray]) -> str:
    """Of names, kinds, shapes and values."""
    hashed = hashlib.sha256()
    for name in sorted(arrays):
        value = np.ascontiguousarray(arrays[name])
        hashed.update(f"{name} {value.dtype.str} {value.shape} ".encode() + value.tobytes())
    return hashed.hexdigest()


def folder_of(out: str | Path | None, identity: Mapping[str, Any], resume: bool) -> Folder | None:
    """The folder `out`, if any, for finished parts."""
    if out is None and resume:
        raise InputError("`resume` needs the folder of the interrupted study.")
    return None if out is None else Folder(out, identity, resume)


def _stored(mark: Path) -> Mapping[str, Any]:
    try:
        asked = json.loads(mark.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        asked = None
    if not isinstance(asked, Mapping):
        raise InputError("is no study that can be continued.", mark)
    return asked
