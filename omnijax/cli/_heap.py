"""The process's heap: freed memory kept for the next array."""


def keep_freed_memory() -> None:
    """Have glibc keep what is freed, in one heap that all threads share.

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
    arena_max, mmap_max, trim_threshold, top_pad = -8, -4, -1, -2  # glibc's malloc.h
    mallopt(arena_max, 1)
    mallopt(mmap_max, 0)
    mallopt(trim_threshold, 2**31 - 1)
    mallopt(top_pad, 2**26)
