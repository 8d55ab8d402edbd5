"""The command line: parse, call, print.

Loading the commands takes half a second, in which Ctrl-C is heard already.
"""

import atexit
import importlib
import os
import signal
import sys

from .._interrupts import NOTHING, ends_hard, exit_code, leave, listening, raise_lost

TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any

# XLA writes into the terminal where a compilation takes two minutes, with a plea for a report of a
# bug; what goes wrong comes as an exception.
QUIET = "3"

_LAZY: dict[str, str] = {name: "._frame" for name in ("run", "build_app", "COMMANDS")}
_LAZY |= {name: "._inputs" for name in ("Json", "emit")}


def main(tokens: list[str] | None = None) -> None:
    """Run the command line and exit with its code."""
    os.environ.setdefault("TF_CPP_MIN_LOG_LEVEL", QUIET)
    try:
        with listening():
            code = __getattr__("run")(tokens)
            raise_lost()
            if ends_hard():
                leave(code)
    except KeyboardInterrupt:  # before the command began, or as it ended
        print(NOTHING, file=sys.stderr)
        leave(exit_code())
    atexit.register(_deaf)
    sys.exit(code)


def _deaf() -> None:
    """What comes now comes too late: the work is done, and the libraries end."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def __getattr__(name: str) -> "Any":
    """What the commands' frame and options have, loaded when it is asked for."""
    if name in _LAZY:
        return getattr(importlib.import_module(_LAZY[name], __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
