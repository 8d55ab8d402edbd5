"""Files in: whole or not at all, of a size that memory can hold, and never from a device.

Every file that is read through here is an input of the running command: see `_files`.
"""

import os
import stat
import tomllib
from pathlib import Path
from typing import Any

from . import _files
from ._errors import InputError, did_you_mean
from ._memory import SHARE, available, in_words

_UNFINISHED = (
    "the run is not finished: what there is of it lies in {}. The command that began it goes on "
    "from there with --resume, and then writes the file."
)
TEXT = 32e6  # bytes; a longer rig, study or NAME.toml is a mistake


def regular(path: str | Path) -> Path:
    """`path`, which is a file or is not there; `InputError` for a folder, a pipe or a device."""
    try:
        mode = os.stat(path).st_mode
    except ValueError:  # a zero byte
        raise InputError(f"{str(path)!r} is not the name of a file.") from None
    except OSError:  # what is missing is told where it is asked for
        return Path(path)
    if stat.S_ISDIR(mode):
        raise InputError("is a folder, not a file.", path)
    if not stat.S_ISREG(mode):
        raise InputError("is a pipe, a socket or a device, and not a file: it is not read.", path)
    _files.note_input(path)
    return Path(path)


def existing(path: str | Path, kind: str = "file") -> Path:
    """`path`, a file or folder that is there; `InputError` else, before anything slow is imported.

    `kind` says what it should be, in words: "file", "folder: a case is one, with a rig file".
    """
    path = Path(path)
    try:
        there = path.is_dir() if kind.startswith("folder") else path.exists()
        beside = [x.name for x in path.parent.iterdir()] if not there else []
    except (OSError, ValueError):
        there, beside = False, []
    pieces = path if path.name.endswith(_files.PIECES) else _files.pieces_folder(path)
    if kind == "file" and pieces.is_dir() and (pieces == path or not there):
        raise InputError(_UNFINISHED.format(pieces.name), path)
    if not there and path.is_file():
        raise InputError(f"is a file, and not a {kind}.", path)
    if not there:
        meant = did_you_mean(path.name, beside)
        raise InputError(f"there is no such {kind.partition(':')[0]}.{meant}", path)
    return regular(path) if kind == "file" else path


def read_bytes(path: str | Path, limit: float | None = None) -> bytes:
    """The whole content; `InputError` where it is longer than `limit` (a share of memory)."""
    most = int(min(available() * SHARE / 4, 2**62) if limit is None else limit)
    with regular(path).open("rb") as file:
        content = file.read(min(most, os.fstat(file.fileno()).st_size) + 1)
        content += file.read(max(most + 1 - len(content), 0)) if len(content) <= most else b""
    if len(content) > most:
        raise InputError(f"is larger than {in_words(most)}, the most that is read here.", path)
    return content


def read_toml(path: str | Path) -> dict[str, Any]:
    """The tables of a TOML file; `OSError` where it cannot be read, `InputError` for any other."""
    content = read_bytes(path, TEXT)
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        reason = f"{error.reason} at byte {error.start}"
        raise InputError(f"is not UTF-8 text: {reason}.", path) from None
    return toml_of(text, path)


def toml_of(text: str, source: object) -> dict[str, Any]:
    """The tables of TOML text; `InputError` names `source`."""
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise InputError("is not valid TOML: its brackets are nested too deeply.", source) from None
    except ValueError as error:  # TOMLDecodeError, and numbers of thousands of digits
        said = str(error).partition(";")[0].rstrip(".")
        raise InputError(f"is not valid TOML: {said}.", source) from None
