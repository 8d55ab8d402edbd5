"""Who may run a law file that a rig names: nobody, before the user has said so.

A law file is a program: it can do whatever its reader can.  Consent is given once for each content
(its SHA-256), in answer to a question, or for one command by `--trust-laws`.
"""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path

from ._errors import InputError
from ._private import config_folder, open_to_others, private_folder

READ, ASK, TRUST = "read", "ask", "trust"
_mode: ContextVar[str] = ContextVar("law_files", default=ASK)
_ENVIRONMENT = "OMNIJAX_TRUSTED_LAWS"  # digests, for the processes that this one starts


@contextmanager
def law_files(mode: str) -> Iterator[None]:
    """Inside, law files that rigs name are run unasked (`trust`), or never (`read`)."""
    token = _mode.set(mode)
    try:
        yield
    finally:
        _mode.reset(token)


def are_read_only() -> bool:
    """Whether law files are read here and not run."""
    return _mode.get() == READ


def consent(path: Path, digest: str) -> None:
    """Return if the file may run; raise `InputError` if the user has not allowed it."""
    if _mode.get() == TRUST or digest in _allowed() or _asked(path, digest):
        trust(digest)
        return
    raise InputError(
        f"{path} is a program, and is run only after you have allowed it: read it, then give "
        "--trust-laws (in Python: omnijax.load_laws on it before the rig is loaded)."
    )


def trust(digest: str) -> None:
    """This process and those that it starts may run the content."""
    known = os.environ.get(_ENVIRONMENT, "").split(",")
    if digest not in known:
        os.environ[_ENVIRONMENT] = ",".join([*filter(None, known), digest])


def _allowed() -> set[str]:
    digests = set(os.environ.get(_ENVIRONMENT, "").split(","))
    file = _file()
    try:
        if open_to_others(file) is None:
            digests |= {line.partition(" ")[0] for line in file.read_text("utf-8").splitlines()}
    except (OSError, ValueError):  # nothing was ever allowed
        pass
    return digests


def _asked(path: Path, digest: str) -> bool:
    """Ask at a terminal; a yes is kept."""
    if not (sys.stdin and sys.stdin.isatty() and sys.stderr and sys.stderr.isatty()):
        return False
    print(
        f"The rig names the law file {path}, a program that will run with your rights.\n"
        f"SHA-256 {digest}\nHave you read it, and shall it run? [y/N] ",
        end="", file=sys.stderr, flush=True,
    )  # fmt: skip
    if sys.stdin.readline().strip().lower() not in ("y", "yes"):
        return False
    if private_folder(config_folder()) is None:
        with _file().open("a", encoding="utf-8") as file:
            file.write(f"{digest} {path.resolve()}\n")
    return True


def _file() -> Path:
    return config_folder() / "trusted-laws"
