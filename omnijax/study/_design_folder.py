"""Finished parts of a long study in a folder, and how an interrupted one is taken up again."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from .._errors import InputError

Report = Callable[[int, int], None]


class Folder:
    """Finished batches of a search as small files, so that it can be taken up again."""

    def __init__(self, folder: str | Path, identity: str, resume: bool):
        self.folder = Path(folder)
        mark = self.folder / "study.txt"
        if mark.exists():
            if not resume:
                raise InputError("holds a study already: continue with --resume.", folder)
            if mark.read_text(encoding="utf-8") != identity:
                raise InputError("holds another study, so it cannot be continued.", folder)
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            mark.write_text(identity, encoding="utf-8")
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
