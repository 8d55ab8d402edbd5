"""`design`: the best rig of a study."""

import dataclasses
from collections.abc import Mapping
from pathlib import Path

import jax.numpy as jnp

from ..._errors import InputError
from ...rig import Rig
from .._evaluation import apply
from .._file import Study, study_of
from .._problem import Problem
from .._study_folder import Report, folder_of
from ._search import Adam, Engine
from .answer import make_design
from .cases import RigCases, stochastic_problems
from .notes import noted, start_note
from .result import Design
from .rig import rig_problem


def design(
    study: str | Path | Mapping | Study,
    *,
    out: str | Path | None = None,
    resume: bool = False,
    report: Report | None = None,
) -> Design:
    """The best design of a study (a TOML file, its tables, or a `Study`).

    With `out` finished searches are stored there, and `resume` takes them up.  `report(done,
    total)` is called after each search.  The design is checked against the exact worst
    case, and against draws of the parts that the search did not see.

    Figures are SI.  Raises `InputError` for a wrong study and for a variable that nothing
    depends on, `RunError` where runs fail.

    Source: BFGS, SQP and, where that ends outside of the limits, the augmented Lagrangian
    (Nocedal and Wright, Numerical Optimization, chapters 6, 17, 18).
    """
    asked = study_of(study)
    if not asked.variables:
        raise InputError("a design needs at least one [[variable]] with path, low and high.")
    if wrong := stochastic_problems(asked):
        raise InputError(wrong)
    cases = RigCases(asked)
    problem = rig_problem(asked, cases)
    store = folder_of(out, asked.identity("design"), resume)
    engine = Engine(problem, asked.starts, asked.seed, store)
    drawn = Adam(asked.stochastic, seed=asked.seed) if asked.stochastic else None
    ends = engine.all_ends(asked.batch, report, drawn)
    best = make_design(engine.problem, ends, size=engine.figures.size)
    more, was = noted(asked, cases, engine.problem, best)
    said = (*best.notes, *start_note(engine), *more)
    return dataclasses.replace(best, notes=said, was=was)


def design_problem(study: str | Path | Mapping | Study) -> Problem:
    """The problem that `design` solves for a study, for `optimise` or an optimiser of your own.

    Its variables are in the study's order, SI; `figures(x, extra)` is pure and differentiable.

    Raises `InputError` for a wrong study.
    """
    return rig_problem(study_of(study))


def designed_rig(study: str | Path | Mapping | Study, best: Design) -> Rig:
    """The study's rig with the design's values; its loads are cases of the study, not of the rig.

    Variables of a drive are no part of a rig.  Raises `InputError` for a wrong study.
    """
    asked = study_of(study)
    values = jnp.array(list(best.variables.values()))
    return apply(asked.rig, asked.drives[0].drive, tuple(best.variables), values)[0]
