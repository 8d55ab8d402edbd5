"""Files out: one rule for every command.

Nothing that exists is written over unless the user says so (`--force`), and an input of the running
command never.  `claim` checks that before any work, together with whether the file can be written.
A file appears by renaming, synced to the disk: it is whole, or it is not there.
"""

import errno
import itertools
import os
import stat
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from pathlib import Path

from ._errors import InputError
from ._interrupts import at_end

PIECES = ".pieces"  # after a run's name: the folder of what there is of it
_SPACE = 4096  # bytes written to learn whether a disk takes any
_number = itertools.count()
_parts: set[Path] = set()  # files under work, removed by whoever ends the process


class _Command:
    """What the running command has read, and what it may write over."""

    def __init__(self) -> None:
        self.inputs: set[tuple[int, int]] = set()  # device and inode
        self.written: set[Path] = set()
        self.force = False


_command: ContextVar[_Command | None] = ContextVar("command", default=None)


@contextmanager
def command() -> Iterator[None]:
    """The rule holds inside: for the one command that runs here."""
    token = _command.set(_Command())
    try:
        yield
    finally:
        _command.reset(token)


def pieces_folder(out: Path) -> Path:
    """Where the pieces of the run `out` lie until it is whole."""
    return out.parent / f"{out.name}{PIECES}"


def note_input(path: str | Path) -> None:
    """`path` is an input of the running command, and is never written."""
    here = _command.get()
    if here is not None:
        with suppress(OSError, ValueError):
            here.inputs.add(_identity(path))


@contextmanager
def looked_at() -> Iterator[None]:
    """Files read inside this block do not count as inputs: the command may write over them."""
    token = _command.set(None)
    try:
        yield
    finally:
        _command.reset(token)


def claim(
    files: Iterable[Path | None] = (),
    folders: Iterable[Path | None] = (),
    *,
    force: bool = False,
    resumed: Path | None = None,
) -> None:
    """Check before the work that results can be written; `InputError` with every problem.

    `files` are all that will be written, those beside what the user named too.  A folder may exist
    where it is empty.  `resumed` is a file of an interrupted run, which is written anew.
    """
    here = _command.get()
    if here is not None:
        here.force = here.force or force
        if resumed is not None:
            here.written.add(real(resumed))
    taken: set[Path] = set()
    problems: list[str] = []
    for path in files:
        if path is not None:
            problems += _file_problems(path, force or path == resumed, taken)
    for folder in folders:
        if folder is not None:
            problems += _folder_problems(folder, force, taken)
    if problems:
        raise InputError(problems)


def _file_problems(path: Path, force: bool, taken: set[Path]) -> Iterator[str]:
    here = _command.get()
    try:
        target = real(path)
        mode = os.lstat(target).st_mode if os.path.lexists(target) else None
    except (OSError, ValueError) as error:
        yield f"{str(path)!r} cannot be written: {_reason(error)}."
        return
    if target in taken:
        yield f"{path}: two results would have this name: choose another for one of them."
    taken.add(target)
    if _is_input(target) and not (here and target in here.written):
        yield f"{path}: is an input of this command, which is never written over."
    elif mode is not None and not stat.S_ISREG(mode):
        yield f"{path}: is a folder or a device, and not a file to be written."
    elif any(t in target.parents or target in t.parents for t in taken):
        yield f"{path}: two results cannot be a file and a file in a folder of that name."
    elif (mode is not None or os.path.islink(path)) and not force:
        yield f"{path}: exists already: choose another name, or write over it with --force."
    elif (reason := obstacle_of(target.parent)) is not None:
        yield f"{path}: cannot be written: {reason}."


_OF_FILES = {".html", ".htm", ".pdf", ".png", ".svg", ".csv", ".json", ".nc", ".toml"}


def _folder_problems(folder: Path, force: bool, taken: set[Path]) -> Iterator[str]:
    try:
        target = real(folder)
        if target in taken:
            yield f"{folder}: two results would have this name: choose another for one of them."
        taken.add(target)
        if target.exists() and not target.is_dir():
            yield f"{folder}: is a file, but a folder is to be written there."
        elif target.is_dir() and not force and any(p.name[0] != "." for p in target.iterdir()):
            yield (
                f"{folder}: is a folder with files in it: choose another, or write over those of "
                "the same names with --force."
            )
        elif (reason := obstacle_of(target)) is not None:
            yield f"{folder}: cannot be written: {reason}."
        elif not target.exists() and folder.suffix.lower() in _OF_FILES:
            yield (
                f"{folder}: a folder with a page and its figures is written here, but the name is "
                f"a file's: take {folder.with_suffix('')}, whose page is index.html in it."
            )
    except (OSError, ValueError) as error:
        yield f"{str(folder)!r} cannot be written: {_reason(error)}."


def obstacle_of(folder: Path) -> str | None:
    """Why no file can be written into `folder` (which may be made), in words; None where it can."""
    here = next((p for p in (folder, *folder.parents) if os.path.lexists(p)), Path("."))
    if not here.is_dir():
        return f"{here} is no folder"
    probe = here / f".omnijax-{os.getpid()}-{next(_number)}.part"
    _parts.add(probe)
    try:
        with probe.open("xb") as file:
            file.write(bytes(_SPACE))
            file.flush()
            os.fsync(file.fileno())
    except OSError as error:
        return _reason(error)
    finally:
        with suppress(OSError):
            probe.unlink(missing_ok=True)
        _parts.discard(probe)
    return None


@contextmanager
def writing(path: str | Path, ours: bool = False) -> Iterator[Path]:
    """A file to be written beside `path`; at the end it takes that name, synced to the disk.

    `InputError` where it cannot be written; then nothing has changed.  `ours` is a part of a store,
    whose folder was checked when it was opened.
    """
    try:
        target = real(path)
        if not ours:
            _refuse(target, path)
        target.parent.mkdir(parents=True, exist_ok=True)
    except (OSError, ValueError) as error:
        raise _failed(error, path) from None
    part = target.with_name(f".omnijax-{os.getpid()}-{next(_number)}.part{target.suffix}")
    _parts.add(part)
    try:
        yield part
        sync(part)
        with suppress(OSError):
            part.chmod(stat.S_IMODE(target.stat().st_mode))
        os.replace(part, target)
        sync(target.parent)
    except OSError as error:
        raise _failed(error, path) from None
    finally:
        with suppress(OSError):
            part.unlink(missing_ok=True)
        _parts.discard(part)
    here = _command.get()
    if here is not None:
        here.written.add(target)


def reserve(part: Path, size: int) -> None:
    """Take `size` bytes of the disk and give them back; `OSError` where it has not as many.

    For libraries that do not survive a full disk.
    """
    with part.open("wb") as file:
        if hasattr(os, "posix_fallocate"):
            try:
                os.posix_fallocate(file.fileno(), 0, size)
            except OSError as error:
                if error.errno not in (errno.EINVAL, errno.EOPNOTSUPP):
                    raise


def write_bytes(path: str | Path, content: bytes, ours: bool = False) -> Path:
    """Write a whole file."""
    with writing(path, ours) as part:
        part.write_bytes(content)
    return Path(path)


def write_text(path: str | Path, text: str) -> Path:
    """Write a whole file as UTF-8 with the line ends that stand in `text`."""
    return write_bytes(path, text.encode("utf-8"))


@at_end
def drop_parts() -> None:
    """Remove the files under work: the process ends now."""
    for part in list(_parts):
        with suppress(OSError):
            part.unlink(missing_ok=True)


def real(path: str | Path) -> Path:
    """Where a file written to `path` lies: links are followed."""
    return Path(os.path.realpath(path))


def _refuse(target: Path, path: str | Path) -> None:
    """`InputError` where the running command may not write `target`."""
    here = _command.get()
    if here is None or target in here.written or not os.path.lexists(target):
        return
    if _is_input(target):
        raise InputError("is an input of this command, which is never written over.", path)
    if not here.force:
        raise InputError(
            "exists already: choose another name, or write over it with --force.", path
        )


def _is_input(target: Path) -> bool:
    here = _command.get()
    try:
        return here is not None and _identity(target) in here.inputs
    except OSError:
        return False


def _identity(path: str | Path) -> tuple[int, int]:
    status = os.stat(path)
    return status.st_dev, status.st_ino


def sync(path: Path) -> None:
    """Sync to the disk; errors of file systems that cannot sync a folder are ignored."""
    if sys.platform == "win32" and path.is_dir():
        return
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    except OSError as error:
        if error.errno not in (errno.EINVAL, errno.ENOTSUP, errno.EBADF):
            raise
    finally:
        os.close(handle)


def _reason(error: Exception) -> str:
    return (getattr(error, "strerror", None) or str(error)).rstrip(".")


def _failed(error: Exception, path: str | Path) -> InputError:
    if isinstance(error, InputError):
        return error
    return InputError(f"cannot be written: {_reason(error)}.", path)
