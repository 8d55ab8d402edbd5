"""Cases of a test of which some run with the whole suite alone (`make test-all`)."""

from collections.abc import Callable, Iterable
from typing import Any

import pytest


def tiered(cases: Iterable[Any], full: Callable[[Any], bool]) -> list[Any]:
    """`cases` for `parametrize`: those that `full` asks for stay out of `make test`."""
    return [pytest.param(case, marks=[pytest.mark.full] * full(case)) for case in cases]


def more(*cases: tuple[Any, ...]) -> list[Any]:
    """Further `cases` of several values for `parametrize`, which stay out of `make test`."""
    return [pytest.param(*case, marks=pytest.mark.full) for case in cases]
