"""The command line: parse, call, print.

Loading the commands takes half a second, in which Ctrl-C is heard already.
"""

import atexit
import importlib
import signal
import sys
from typing import Any

from .._interrupts import CODE, NOTHING, answer, ends_hard, leave, listening

_LAZY: dict[str, str] = {name: "._frame" for name in ("run", "build_app", "COMMANDS")}
_LAZY |= {name: "._options" for name in ("Json", "emit")}


def main(tokens: list[str] | None = None) -> None:
    """Run the command line and exit with its code."""
    with listening():
        try:
            code = __getattr__("run")(tokens)
        except KeyboardInterrupt:  # before the command began
            answer()
            print(NOTHING, file=sys.stderr)
            code = CODE
        if ends_hard():
            leave(code)
    atexit.register(_deaf)
    sys.exit(code)


def _deaf() -> None:
    """What comes now comes too late: the work is done, and the libraries end."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def __getattr__(name: str) -> Any:
    """What the commands' frame and options have, loaded when it is asked for."""
    if name in _LAZY:
        return getattr(importlib.import_module(_LAZY[name], __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
