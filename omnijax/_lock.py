"""One writing process a folder: an advisory lock that ends with its process, however it ends."""

import sys
import weakref
from pathlib import Path
from typing import Any

from ._errors import InputError


class Lock:
    """Holds `file`, which must exist; `InputError` says that another process writes `what`."""

    def __init__(self, file: Path | None, what: str):
        self._file: Any = None
        if file is None or sys.platform == "win32":
            return
        import fcntl

        self._file = file.open("rb")
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            self._file.close()
            raise InputError(f"another process is writing this {what}.", file.parent) from None
        weakref.finalize(self, self._file.close)  # where nobody gives it back, its end does

    def release(self) -> None:
        """Give it back."""
        if self._file is not None:
            self._file.close()
