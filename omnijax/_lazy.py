"""Faces of packages that import a name when it is first asked for.

A command that reads one file then does not wait for the solvers of its package.  The imports stand
in the face under `if TYPE_CHECKING:`, where editors and type checkers look; here they are read.
"""

import ast
import importlib
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any


def lazy_face(package: str) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """`__getattr__` and `__dir__` of the package: the names under its `if TYPE_CHECKING:`."""
    sources = _sources(Path(str(sys.modules[package].__file__)))

    def __getattr__(name: str) -> Any:
        if name not in sources:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        module, original = sources[name]
        value = getattr(importlib.import_module(module, package), original)
        if "jax" in sys.modules:  # its settings stand before anything of ours runs
            from . import _config as _config
        setattr(sys.modules[package], name, value)
        return value

    def __dir__() -> list[str]:
        return sorted(sources)

    return __getattr__, __dir__


def _sources(file: Path) -> dict[str, tuple[str, str]]:
    """Name in the face -> module (relative) and name there."""
    sources = {}
    for block in ast.parse(file.read_text(encoding="utf-8")).body:
        if isinstance(block, ast.If) and ast.unparse(block.test) == "TYPE_CHECKING":
            for node in block.body:
                assert isinstance(node, ast.ImportFrom), f"{file}:{node.lineno}"
                module = "." * node.level + (node.module or "")
                sources |= {name.asname or name.name: (module, name.name) for name in node.names}
    return sources
