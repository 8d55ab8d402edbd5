"""`optimise`: the design engine on any pure function."""

from .._problem import Problem
from .._study_folder import Folder, Report
from ._search import Adam, Engine
from .answer import make_design
from .result import Design


def optimise(
    problem: Problem,
    *,
    starts: int = 8,
    seed: int = 0,
    batch: int = 8,
    store: Folder | None = None,
    report: Report | None = None,
    stochastic: Adam | None = None,
) -> Design:
    """The best design of `problem` from `starts` searches, `batch` of them side by side.

    `report(done, total)` is called after each search; `store` keeps finished ones.  With
    `stochastic` optax's Adam moves the starts on fresh draws first.
    """
    engine = Engine(problem, starts, seed, store)
    ends = engine.all_ends(batch, report, stochastic)
    return make_design(engine.problem, ends, size=engine.figures.size)
