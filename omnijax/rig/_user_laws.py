"""Users' own laws: loaded once a text, and kept so that a saved rig carries its file."""

import hashlib
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path

from .. import laws
from .._consent import consent, trust
from .._errors import InputError
from .._reading import TEXT, read_bytes
from ..laws import AXIS_EFFECTS, AbstractLaw, of_library

_Laws = dict[str, type[AbstractLaw]]

_LOADED: dict[str, dict[str, _Laws]] = {}  # digest of a text -> name of its file -> its laws
_FILES: dict[type[AbstractLaw], tuple[str, bytes]] = {}  # law -> name and text of its file
_CARRIED: ContextVar[Mapping[str, str]] = ContextVar("carried_laws")
AS_BYTES = "surrogateescape"  # a text of any bytes, which gives them back


def load_laws(path: str | Path) -> _Laws:
    """The laws of a Python file, which is run; the same text and name give the same classes.

    Two rigs are equal only if their laws are of one class, so a second load must not make new ones.
    A text under another name has classes of its own, which are saved under that name.
    Whoever calls this has chosen the file: rigs that name it may then use it in this process.

    Raises `InputError` where the file cannot be read or run, or a law in it is not whole.
    """
    path = Path(path)
    return _run(path, _text(path))


def rigs_laws(path: Path) -> _Laws:
    """The laws of a file that a rig names: it runs only where the user has allowed its content."""
    carried = _CARRIED.get({})
    text = carried[path.name].encode("utf-8", AS_BYTES) if path.name in carried else _text(path)
    digest = hashlib.sha256(text).hexdigest()
    if digest not in _LOADED:
        consent(path, digest)
    return _run(path, text)


@contextmanager
def carried_laws(texts: Mapping[str, str]) -> Iterator[None]:
    """Inside, a law file that a rig names is one of `texts` (by file name), where it is there."""
    token = _CARRIED.set(texts)
    try:
        yield
    finally:
        _CARRIED.reset(token)


def texts_of_laws(used: Iterable[AbstractLaw]) -> dict[str, str]:
    """Texts of the files that users' laws come from, by file name.

    Raises `InputError` where two files of one name hold different texts.
    """
    texts: dict[str, str] = {}
    for law in used:
        if of_library(law):
            continue
        name, content = file_of(type(law))
        text = content.decode("utf-8", AS_BYTES)
        if texts.setdefault(name, text) != text:
            raise InputError(f"two law files are called {name}: give one of them another name.")
    return texts


def _text(path: Path) -> bytes:
    try:
        return read_bytes(path, TEXT)
    except OSError as error:
        raise InputError(f"{path}: no such Python file of laws ({error.strerror}).") from None


def _run(path: Path, text: bytes) -> _Laws:
    digest = hashlib.sha256(text).hexdigest()
    if path.name not in _LOADED.get(digest, {}):
        try:
            defined = laws.laws_of(text, path)
        except ValueError as error:
            raise InputError(str(error)) from None
        taken = sorted(set(defined) & set(AXIS_EFFECTS))
        if taken:
            raise InputError(
                f"{path}: the id `{taken[0]}` is one of omnijax's own; choose another."
            )
        _LOADED.setdefault(digest, {})[path.name] = defined
        _FILES.update({law: (path.name, text) for law in defined.values()})
        trust(digest)
    return _LOADED[digest][path.name]


def file_of(law: type[AbstractLaw]) -> tuple[str, bytes]:
    """Name and text of the file that a user's law came from.

    Raises `InputError` for a law that came from none.
    """
    if law not in _FILES:
        raise InputError(
            f"the law `{law.id or law.__name__}` cannot be saved: put its class into a Python file "
            "and take it from `omnijax.load_laws(file)`."
        )
    return _FILES[law]
