"""Users' own laws: loaded once a text, and kept so that a saved rig carries its file."""

import hashlib
from pathlib import Path

from .. import laws
from .._errors import InputError
from .._reading import TEXT, read_bytes
from ..laws import EFFECTS, AbstractLaw

_LOADED: dict[str, dict[str, type[AbstractLaw]]] = {}  # digest of the file -> its laws
_FILES: dict[type[AbstractLaw], tuple[str, bytes]] = {}  # law -> name and text of its file


def load_laws(path: str | Path) -> dict[str, type[AbstractLaw]]:
    """The laws of a Python file; the same text gives the same classes wherever it lies.

    Two rigs are equal only if their laws are of one class, so a second load must not make new ones.
    """
    path = Path(path)
    try:
        text = read_bytes(path, TEXT)
    except OSError as error:
        raise InputError(f"{path}: no such Python file of laws ({error.strerror}).") from None
    digest = hashlib.sha256(text).hexdigest()
    if digest not in _LOADED:
        try:
            found = laws.load_laws(path)
        except ValueError as error:
            raise InputError(str(error)) from None
        taken = sorted(set(found) & set(EFFECTS))
        if taken:
            raise InputError(
                f"{path}: the id `{taken[0]}` is one of omnijax's own; choose another."
            )
        _LOADED[digest] = found
        _FILES.update({law: (path.name, text) for law in found.values()})
    return _LOADED[digest]


def file_of(law: type[AbstractLaw]) -> tuple[str, bytes]:
    """Name and text of the file that a user's law came from."""
    if law not in _FILES:
        raise InputError(
            f"the law `{law.id or law.__name__}` cannot be saved: put its class into a Python file "
            "and take it from `omnijax.load_laws(file)`."
        )
    return _FILES[law]
