"""The process's heap: freed memory kept for the next array."""

LARGE = 2**25  # bytes, the most that glibc takes: arrays above it are few, and go back


def keep_freed_memory() -> None:
    """Have glibc keep what is freed, but for the largest arrays, in one heap of all threads.

    A diagnosis makes and drops large arrays all the time.  By default each goes back to the system,
    which has to clear the pages of the next one: a tenth of the whole time.  Without glibc nothing
    changes.  It is meant for a process of one command, and before the first thread.
    """
    import ctypes
    import sys

    if sys.platform != "linux":
        return
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is None:
        return
    arena_max, mmap_threshold, trim_threshold, top_pad = -8, -3, -1, -2  # glibc's malloc.h
    mallopt(arena_max, 1)
    mallopt(mmap_threshold, LARGE)
    mallopt(trim_threshold, 2**31 - 1)
    mallopt(top_pad, 2**26)
