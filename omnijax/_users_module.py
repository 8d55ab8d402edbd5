"""A user's Python file (laws, a machine) run as a module."""

import sys
import types
from itertools import count
from pathlib import Path

from ._errors import USERS_MODULE

_NUMBER = count()


def run_module(text: bytes, path: Path) -> types.ModuleType:
    """The module of a file's text, run as it is: no byte code that lies beside it is looked at.

    While it runs it is registered under a name of its own, for annotations that are texts are
    looked up there; whatever the file raises is raised.
    """
    module = types.ModuleType(f"{USERS_MODULE}{path.stem}_{next(_NUMBER)}")
    module.__file__ = str(path)
    sys.modules[module.__name__] = module
    try:
        exec(compile(text, str(path), "exec", dont_inherit=True), vars(module))
    finally:
        del sys.modules[module.__name__]
    return module
