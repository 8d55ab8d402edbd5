"""How much memory this process may still take."""

import os
from pathlib import Path

from ._errors import InputError

SHARE = 0.5  # of what is free: the most that one answer may need
_CGROUP = Path("/sys/fs/cgroup")


def available() -> float:
    """Bytes that can still be had: the system's, the container's and the process's limits."""
    return max(min(_system(), _container(), _process()), 0.0)


def _system() -> float:
    try:
        for line in Path("/proc/meminfo").read_text().splitlines():
            if line.startswith("MemAvailable:"):
                return 1024.0 * float(line.split()[1])
        return float(os.sysconf("SC_AVPHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    except (AttributeError, ValueError, OSError):  # not every system says
        return 2e9


def _container() -> float:
    try:
        most = float((_CGROUP / "memory.max").read_text())
        return most - float((_CGROUP / "memory.current").read_text())
    except (OSError, ValueError):  # no such file, or `max`
        return float("inf")


def _process() -> float:
    try:
        import resource

        most = resource.getrlimit(resource.RLIMIT_AS)[0]
        if most == resource.RLIM_INFINITY:
            return float("inf")
        pages = int(Path("/proc/self/statm").read_text().split()[0])
        return float(most - pages * resource.getpagesize())
    except (ImportError, OSError, ValueError):
        return float("inf")


def check_room(path: object, need: float) -> None:
    """`InputError` where a file's content needs more memory than a file may take."""
    most = SHARE / 2 * available()
    if need > most:
        raise InputError(
            f"unpacks to {in_words(need)}, but memory has room for {in_words(most)}: thin it out, "
            "or cut it.", path,
        )  # fmt: skip


def in_words(size: float) -> str:
    """`3.2 GB`, `40 MB`."""
    for unit, factor in (("TB", 1e12), ("GB", 1e9), ("MB", 1e6)):
        if size >= factor:
            return f"{size / factor:.3g} {unit}"
    return f"{max(size, 0.0) / 1e3:.3g} kB"
