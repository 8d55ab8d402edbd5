"""What has happened to a store since it was written: lost, cut or changed files, each by its name.

Every chunk ends with a checksum (zarr's `crc32c` codec); the store's own `zarr.json` holds the
digests of those of its arrays, and one of itself.
"""

import hashlib
import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from ..._errors import InputError
from ..._files import write_bytes
from ..._reading import read_bytes

FILES, ITSELF = "files", "sha256"  # attributes of the store
_TAIL = 4  # bytes of a chunk's checksum
_CHANGED = "is damaged: it is not what the sweep wrote."


def seal(folder: Path) -> None:
    """Note the digests of the files that describe a new store."""
    top = folder / "zarr.json"
    described = json.loads(top.read_text(encoding="utf-8"))
    files = {file.parent.name: _digest(file.read_bytes()) for file in folder.glob("*/zarr.json")}
    described["attributes"][FILES] = files
    described["attributes"][ITSELF] = _own_digest(described)
    write_bytes(top, json.dumps(described, indent=2).encode(), ours=True)


def add_note(folder: Path, key: str, value: str) -> None:
    """One more attribute of a store, among those that its digest covers."""
    top = folder / "zarr.json"
    described = json.loads(top.read_text(encoding="utf-8"))
    described["attributes"][key] = value
    described["attributes"][ITSELF] = _own_digest(described)
    write_bytes(top, json.dumps(described, indent=2).encode(), ours=True)


def check_description(folder: Path) -> None:
    """`InputError` names a file that no longer describes the store as it was written."""
    described = _read(folder / "zarr.json", folder)
    attributes = described.get("attributes")
    if not isinstance(attributes, dict) or "spec" not in attributes:
        raise InputError("is not the store of a sweep.", folder)
    if ITSELF in attributes and attributes[ITSELF] != _own_digest(described):
        raise InputError(_CHANGED, folder / "zarr.json")
    for name, said in attributes.get(FILES, {}).items():  # none in stores of version 0.1
        file = folder / name / "zarr.json"
        if not file.is_file():
            raise InputError("is missing: copy it from where the sweep was written.", file)
        if _digest(file.read_bytes()) != said:
            raise InputError(_CHANGED, file)


def _read(file: Path, folder: Path) -> dict[str, Any]:
    try:
        document = json.loads(read_bytes(file))
    except FileNotFoundError:
        raise InputError("is not the store of a sweep.", folder) from None
    except (ValueError, RecursionError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(_CHANGED, file) from None
    if not isinstance(document, dict):
        raise InputError("is not the store of a sweep.", folder)
    return document


def _own_digest(described: dict[str, Any]) -> str:
    rest = {k: v for k, v in described["attributes"].items() if k != ITSELF}
    return _digest(json.dumps(described | {"attributes": rest}, sort_keys=True).encode())


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def damaged_chunks(folder: Path, arrays: dict[str, Any], done: Iterable[int]) -> dict[int, str]:
    """The chunks of `done` that cannot be used, with the file and what is wrong with it."""
    damaged: dict[int, str] = {}
    for chunk in sorted(done):
        for name, array in arrays.items():
            wrong = _wrong(folder / name / "c" / str(chunk), array, chunk)
            if wrong:
                damaged[chunk] = f"{name}/c/{chunk} {wrong}"
                break
    return damaged


def _wrong(file: Path, array: Any, chunk: int) -> str | None:
    """What is wrong with a chunk's file, in words."""
    try:
        raw = file.read_bytes()
    except FileNotFoundError:
        return "is missing"
    except OSError as error:
        return f"cannot be read ({error.strerror})"
    if len(raw) <= _TAIL:
        return "is cut off"
    if any(type(codec).__name__ == "Crc32cCodec" for codec in array.compressors):
        said = int.from_bytes(raw[-_TAIL:], "little")
        return None if _checksum(raw[:-_TAIL]) == said else "is damaged"
    try:  # a store of before there were checksums
        array[chunk * array.chunks[0] : (chunk + 1) * array.chunks[0]]
    except Exception:  # zarr's codecs raise whatever they like
        return "is damaged"
    return None


def _checksum(content: bytes) -> int:
    try:
        from google_crc32c import value
    except ModuleNotFoundError:  # zarr before 3.1 brings the other one
        from crc32c import crc32c as value  # pyright: ignore
    return int(value(content))
