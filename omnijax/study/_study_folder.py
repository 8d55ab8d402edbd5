"""Finished parts of a long study in a folder, and how an interrupted one is taken up again."""

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from .._errors import InputError
from ._differences import differences, plain

Report = Callable[[int, int], None]


class Folder:
    """Finished parts of a study as small files; `identity` is all that decides its numbers."""

    def __init__(self, folder: str | Path, identity: Mapping[str, Any], resume: bool):
        self.folder = Path(folder)
        mark, asked = self.folder / "study.json", plain(identity)
        if mark.exists():
            if not resume:
                raise InputError("holds a study already: continue with --resume.", folder)
            found = differences(_stored(mark), json.loads(json.dumps(asked)))
            if found:
                keys = "\n  ".join(found)
                raise InputError(
                    f"holds another study and is left as it is. They differ in:\n  {keys}", folder
                )
            return
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            part = self.folder / ".study.part"
            part.write_text(json.dumps(asked, indent=1), encoding="utf-8")
            part.rename(mark)
        except OSError as error:
            raise InputError(f"cannot be written: {error.strerror}.", folder) from None

    def read(self, key: str) -> dict[str, np.ndarray] | None:
        """What `write` stored under `key`."""
        path = self.folder / f"{key}.npz"
        if not path.exists():
            return None
        with np.load(path, allow_pickle=False) as found:
            return {name: found[name] for name in found.files}

    def write(self, key: str, arrays: dict[str, np.ndarray]) -> None:
        """Store arrays; a killed write leaves no half file."""
        part = self.folder / f".{key}.part.npz"
        np.savez(part, **arrays)  # pyright: ignore[reportArgumentType]
        part.rename(self.folder / f"{key}.npz")


def folder_of(out: str | Path | None, identity: Mapping[str, Any], resume: bool) -> Folder | None:
    """The folder `out`, if any, for finished parts."""
    if out is None and resume:
        raise InputError("`resume` needs the folder of the interrupted study.")
    return None if out is None else Folder(out, identity, resume)


def _stored(mark: Path) -> Mapping[str, Any]:
    try:
        found = json.loads(mark.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        found = None
    if not isinstance(found, Mapping):
        raise InputError("is no study that can be continued.", mark)
    return found
