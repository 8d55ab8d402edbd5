"""Faults of the disk: the n-th write fails, the disk is full from some byte on, nothing is written.

Python's own writes (files opened, renamed, made, synced) fail through an audit hook; those of HDF5
and Arrow through a limit on the size of files, as on a full disk.
"""

import contextlib
import errno
import os
import random
import resource
import shutil
import sys
import warnings
from collections.abc import Iterator
from pathlib import Path

from omnijax import InputError, load_run
from omnijax.recording import read_recording

from .commands import WRITING, Answer, contents, here, words_of

NEW = Path("new")
WRITES = os.O_WRONLY | os.O_RDWR | os.O_CREAT
CODES = (errno.ENOSPC, errno.EROFS, errno.EIO, errno.EACCES)


class Disk:
    """Counts what is written below a folder; fails the write `at`, or all from there on."""

    def __init__(self) -> None:
        self.at, self.all, self.error, self.count, self.on = -1, False, errno.ENOSPC, 0, False
        sys.addaudithook(self._hear)
        self._sync = os.fsync
        os.fsync = self._fsync

    def _hear(self, event: str, args: tuple) -> None:
        if not self.on:
            return
        if event == "open":
            path, _, flags = args
            if isinstance(path, str | os.PathLike) and flags & WRITES and self._ours(path):
                self._write()
        elif event in ("os.rename", "os.mkdir", "os.truncate") and self._ours(args[0]):
            self._write()

    def close(self) -> None:
        """No write fails any more."""
        self.on, os.fsync = False, self._sync

    def _fsync(self, file: int) -> None:
        if self.on:
            self._write()
        self._sync(file)

    @staticmethod
    def _ours(path) -> bool:
        return str(Path(os.fspath(path)).absolute()).startswith(str(Path.cwd()))

    def _write(self) -> None:
        self.count += 1
        if self.count - 1 == self.at or (self.all and self.count > self.at):
            raise OSError(self.error, os.strerror(self.error))

    @contextlib.contextmanager
    def failing(self, at: int, code: int, every: bool = False) -> Iterator[None]:
        """Inside, the write `at` fails with `code`, or `every` one from there on."""
        self.at, self.error, self.all, self.count, self.on = at, code, every, 0, True
        try:
            yield
        finally:
            self.on = False


@contextlib.contextmanager
def full_after(size: int) -> Iterator[None]:
    """Inside, no file can grow beyond `size` bytes."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def attack(disk: Disk, name: str, at: int, code: int, how: str) -> str | None:
    """Run a command whose write fails; what was wrong with the answer, or None."""
    shutil.rmtree(NEW, ignore_errors=True)
    NEW.mkdir()
    before = _users()
    failing = full_after(at) if how == "full" else disk.failing(at, code, how == "read-only")
    try:
        with failing, warnings.catch_warnings():
            warnings.filterwarnings("ignore", "Error writing persistent")  # a cache is not needed
            answer = here(words_of(WRITING[name], f"{NEW}/x"))
    except BaseException as error:
        return f"traceback: {type(error).__name__}: {str(error)[:200]}"
    wrong = [
        (answer.code not in (0, 2), f"code {answer.code}"),
        (answer.code == 2 and not answer.err.strip(), "nothing said"),
        ("Traceback" in answer.err + answer.out, "traceback"),
        (answer.code == 0 and not _said_done(answer), "no answer"),
        (_users() != before, "the user's files changed"),
        (bool(_litter()), f"left {_litter()}"),
    ]
    wrong += [(True, f"{path} is not whole") for path in _broken()]
    return "; ".join(text for bad, text in wrong if bad) or None


def _said_done(answer: Answer) -> bool:
    return bool(answer.out.strip()) or any(NEW.rglob("*"))


def _users() -> dict[str, bytes]:
    return {name: x for name, x in contents().items() if not name.startswith(str(NEW))}


def _litter() -> list[str]:
    return [str(p) for p in Path(".").rglob("*") if ".part" in p.name or ".partial" in p.name]


def _broken() -> Iterator[str]:
    """Results under their own names that are not whole."""
    for path in NEW.glob("x*"):
        try:
            whole = WHOLE.get(path.name[1:], bool)(path)
        except (InputError, OSError, ValueError):
            whole = False
        if not whole:
            yield str(path)


def _opens(path: Path) -> bool:
    from omnijax._netcdf import load_netcdf

    return "dR" not in load_netcdf(path) or load_run(path) is not None


def _uncut(path: Path) -> bool:
    return not any(fault.kind == "truncated" for fault in read_recording(path).faults)


WHOLE = {  # ending -> whether a file is whole
    ".nc": _opens,
    ".csv.gz": _uncut,
    ".parquet": _uncut,
    ".png": lambda path: path.read_bytes()[-8:-4] == b"IEND",
    ".html": lambda path: path.read_text("utf-8").rstrip().endswith("</html>"),
}


Plan = list[tuple[str, int, int, str]]  # command, at which write or byte, error, how


def all_faults(disk: Disk, seed: int = 0) -> tuple[int, list[str]]:
    """(attacks, what went wrong): every write of every command, read-only, and a full disk."""
    rng, plan = random.Random(seed), []
    for name, command in WRITING.items():
        shutil.rmtree(NEW, ignore_errors=True)
        NEW.mkdir()
        with disk.failing(-1, 0):
            answer = here(words_of(command, f"{NEW}/x"))
        assert answer.code == 0, f"{name}: {answer.err}"
        size = max(p.stat().st_size for p in NEW.rglob("*") if p.is_file())
        plan += [(name, at, rng.choice(CODES), "one") for at in range(disk.count)]
        plan += [(name, rng.randrange(disk.count), errno.EROFS, "read-only") for _ in range(2)]
        plan += [(name, 0, errno.EROFS, "read-only")]
        sizes = (0, 1, 4096, size // 2, size - 1)
        plan += [(name, at, errno.EFBIG, "full") for at in sizes if at < size]
    return _attacked(disk, plan)


CHEAP = ("init", "simulate nc", "simulate csv", "export", "export nc", "replay")


def some_faults(disk: Disk, number: int, seed: int) -> tuple[int, list[str]]:
    """The same, `number` drawn at random from commands that take no time."""
    rng, plan = random.Random(seed), []
    for _ in range(number):
        name, how = rng.choice(CHEAP), rng.choice(("one", "read-only", "full"))
        at = rng.choice((0, 1, 4096)) if how == "full" else rng.randrange(8)
        plan.append((name, at, rng.choice(CODES), how))
    return _attacked(disk, plan)


def _attacked(disk: Disk, plan: Plan) -> tuple[int, list[str]]:
    wrong = []
    for name, at, code, how in plan:
        said = attack(disk, name, at, code, how)
        if said is not None:
            wrong.append(f"{name}, {how} at {at} ({errno.errorcode[code]}): {said}")
    shutil.rmtree(NEW, ignore_errors=True)
    return len(plan), wrong
