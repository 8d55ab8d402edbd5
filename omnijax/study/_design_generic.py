"""`optimise`: the design engine on any pure function."""

from ._design_answer import make_design
from ._design_engine import Engine
from ._design_folder import Folder, Report
from ._design_problem import Problem
from ._design_result import Design
from ._design_search import Adam


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
    return make_design(problem, engine.all_ends(batch, report, stochastic))
