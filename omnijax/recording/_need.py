"""Readers' packages that are extras."""

import importlib
from typing import Any

from .._errors import InputError


def need(module: str, package: str, suffix: str, extra: str = "measured") -> Any:
    """Import a reader's package, or say which command installs it."""
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise InputError(
            f'reading `{suffix}` files needs {package}: pip install "omnijax[{extra}]"'
        ) from error
