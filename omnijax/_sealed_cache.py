"""Entries of jax's compilation cache with a seal: what is not whole is compiled anew.

jax writes an entry in place and reads whatever it finds there.  A full disk, a killed process or
one that reads while another writes leaves or sees a part, and jax warns of it in every later
process and never mends it; a flipped bit it does not see at all, and the entry is machine code.
"""

import contextlib
import hashlib
import logging
from pathlib import Path

SEAL = 32  # bytes at the end of an entry: SHA-256 of what stands before
_log = logging.getLogger("omnijax")


def seal_entries(folder: Path) -> None:
    """Have jax seal what it writes below `folder`, and take only what is whole from there."""
    try:  # jax has no public door to its cache; one that has moved keeps entries without seals
        from jax._src import compilation_cache
        from jax._src.lru_cache import LRUCache
    except ImportError as error:
        _log.info("entries of jax's cache have no seals: %s", error)
        return

    class Sealed(LRUCache):
        """The files of jax's own cache, each with a seal where they lie in omnijax's folder."""

        def _sealed(self) -> bool:
            return Path(str(self.path)) == folder

        def get(self, key: str) -> bytes | None:
            entry = super().get(key)
            if entry is None or not self._sealed():
                return entry
            body, seal = entry[:-SEAL], entry[-SEAL:]
            if hashlib.sha256(body).digest() == seal:
                return body
            _log.info("the compiled program %s is not whole and is made anew", key)
            with contextlib.suppress(OSError):
                (folder / f"{key}-cache").unlink()  # `put` leaves what is there
            return None

        def put(self, key: str, value: bytes) -> None:
            super().put(key, value + hashlib.sha256(value).digest() if self._sealed() else value)

    compilation_cache.LRUCache = Sealed  # pyright: ignore[reportPrivateImportUsage]
