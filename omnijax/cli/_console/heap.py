"""The process's heap: freed memory kept for the next array."""

from typing import Any

LARGE = 2**25  # bytes, the most that glibc takes: arrays above it are few, and go back


def keep_freed_memory() -> None:
    """Have glibc keep what is freed, but for the largest arrays, in one heap of all threads.

    A diagnosis makes and drops large arrays all the time.  By default each goes back to the system,
    which has to clear the pages of the next one: a tenth of the whole time.  Without glibc nothing
    changes.  It is meant for a process of one command, and before the first thread.
    """
    mallopt = _of_glibc("mallopt")
    if mallopt is None:
        return
    arena_max, mmap_threshold, trim_threshold, top_pad = -8, -3, -1, -2  # glibc's malloc.h
    mallopt(arena_max, 1)
    mallopt(mmap_threshold, LARGE)
    mallopt(trim_threshold, 2**31 - 1)
    mallopt(top_pad, 2**26)


def give_back_freed_memory() -> None:
    """Have glibc give back what is freed by now: between stages whose arrays are unlike.

    Kept for the next stage too, it was a third of a diagnosis' largest memory.
    """
    trim = _of_glibc("malloc_trim")
    if trim is not None:
        trim(0)


def _of_glibc(name: str) -> Any:
    """A function of glibc, or None where there is none."""
    import ctypes
    import sys

    return getattr(ctypes.CDLL(None), name, None) if sys.platform == "linux" else None
