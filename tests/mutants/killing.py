"""The numbers that hold a function, and whether one of them notices a change of it."""

import sys
import time
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

from .equations import Mutant

sys.path.insert(0, str(Path(__file__).parents[1]))


class Check(NamedTuple):
    """One check by numbers: its seconds, and the code that it runs through."""

    name: str
    run: Callable[[], None]
    seconds: float
    touched: set


def named_checks() -> dict[str, Callable[[], None]]:
    """Every check by numbers of the tests."""
    import test_formulas
    import test_mechanics
    import test_moment
    import test_moment_forms
    import test_ports

    modules = (test_formulas, test_moment, test_moment_forms, test_ports, test_mechanics)
    return {name: run for module in modules for name, run in module.CHECKS.items()}


def prepare(checks: dict[str, Callable[[], None]]) -> list[Check]:
    """The checks, cheapest first; what one raises as the tree stands is raised."""
    found = []
    for name, run in checks.items():
        run()  # compiles what JAX compiles
        began, touched = time.perf_counter(), watched(run)
        found.append(Check(name, run, time.perf_counter() - began, touched))
    return sorted(found, key=lambda check: check.seconds)


def watched(run: Callable[[], None]) -> set:
    """Code that `run` goes through."""
    touched = set()

    def note(frame, event, _):
        if event == "call":
            touched.add(frame.f_code)

    before = sys.getprofile()
    sys.setprofile(note)
    try:
        run()
    finally:
        sys.setprofile(before)
    return touched


class Tried(NamedTuple):
    """A mutant, and the check that kills it; None where it survives."""

    mutant: Mutant
    killer: str | None


def tried(mutants: Iterable[Mutant], checks: list[Check]) -> Iterator[Tried]:
    """Every mutant that means anything, tried."""
    last: dict[str, str] = {}
    for mutant in mutants:
        first = last.get(mutant.where)
        holding = [check for check in checks if mutant.code in check.touched]
        try:
            found = killer(mutant, sorted(holding, key=lambda check: check.name != first))
        except AttributeError:  # the port has no such field: nothing that a slip could leave
            continue
        if found is not None:
            last[mutant.where] = found
        yield Tried(mutant, found)


def killer(mutant: Mutant, checks: Iterable[Check]) -> str | None:
    """Name of the first check that fails under the mutant."""
    with mutant.apply():
        for check in checks:
            try:
                check.run()
            except AttributeError:
                raise
            except Exception:  # a wrong number, or a shape that no longer fits
                return check.name
    return None
