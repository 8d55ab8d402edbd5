"""The problem that a study of a rig poses: objective and constraints over drives, loads, parts."""

from collections.abc import Callable
from functools import partial

import numpy as np
from jaxtyping import Array

from ..._arrays import largest
from ...vibration import METRICS
from .._file import Study
from .._problem import Many, Problem
from ._search import followed_by
from .cases import RigCases

EVALUATIONS = 25  # of a search, as most take
# What rounding leaves of a metric that is 0, by unit: far below what the slowest machine has.
FLOOR = {"m": 1e-15, "m/s^2": 1e-12}


def objective_text(study: Study) -> tuple[str, str]:
    """Name and unit of the objective."""
    units = {METRICS[name].unit for name, _ in study.weights}
    unit = units.pop() if len(units) == 1 else "1"
    if len(study.weights) == 1 and study.weights[0][1] == 1.0:
        name = study.weights[0][0]
    else:
        name = " + ".join(f"{w:g} {n}" for n, w in study.weights)
    if study.tolerances and study.spread == "mean+sigma":
        name = f"mean + {study.sigmas:g} sigma of {name}"
    if len(study.drives) * len(study.loads) > 1 or (study.tolerances and study.spread == "worst"):
        name = f"{'worst' if study.over == 'worst' else 'mean'} {name}"
    return name, unit


def floor_of(metric: str) -> float:
    """What rounding leaves of a metric that is 0, in its unit."""
    return FLOOR.get(METRICS[metric].unit, 0.0)


def figures_of(
    cases: RigCases, combined: Callable[[Array, Array], tuple[Array, Array]], draws: Array
) -> tuple[Callable, Many | None]:
    """`Problem.figures` and `Problem.many`: f (k,) and g (c,) of metrics and constraints.

    `combined(metrics, constraints)` makes them of those of every case and draw, (k, t, ...).
    """

    def figures(x, draws):
        return combined(*cases.every(x, draws))

    if not cases.goes_in_bulk(len(draws)):
        return figures, None
    total = EVALUATIONS * cases.study.starts
    first = partial(cases.with_draws, draws=np.asarray(draws), total=total)

    def made(x, metrics):
        return combined(metrics, cases.constraints(x, draws, metrics))

    return figures, followed_by(first, made)


def rig_problem(study: Study, cases: RigCases | None = None) -> Problem:
    """The problem of a study."""
    cases = RigCases(study) if cases is None else cases
    limits, held = cases.limits()
    many = bool(cases.parts) and study.spread == "worst"
    draws = cases.draws()
    names = cases.cases
    if many:
        names = tuple(
            f"{name} parts {t}".strip() if t else f"{name} nominal".strip()
            for name in names
            for t in range(len(draws))
        )

    def combined(metrics, g):
        return cases.spread(cases.weighted(metrics)), largest(g, axis=1).reshape(-1)[held]

    name, unit = objective_text(study)
    figures, in_bulk = figures_of(cases, combined, draws)
    return Problem(
        variables=study.variables,
        figures=figures,
        many=in_bulk,
        limits=tuple(limits),
        worst=study.over == "worst",
        cases=names,
        name=name,
        unit=unit,
        extra=draws,
        draw=cases.draw if cases.parts else None,
        costly=cases.how.integrated,
        order=cases.how.order,
        floor=sum(abs(weight) * floor_of(metric) for metric, weight in study.weights),
    )
