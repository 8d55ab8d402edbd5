"""What is said beside a design: its figures by other means than the search's, and the old rig's."""

import copy
import dataclasses

import jax.numpy as jnp
import numpy as np

from ..._compiling import quick_jit
from ..._errors import InputError
from ..._text import quantity_text
from ...rig import get_parameter
from .._file import Study
from .._problem import Problem
from ._search import Engine
from .answer import missed
from .cases import RTOL, RigCases
from .result import Design
from .rig import objective_text, rig_problem

FRESH = 64  # draws of the parts that the search has not seen


def before(study: Study) -> np.ndarray | None:
    """The variables' values in the study's own rig; None where no design is that rig."""
    values = []
    for v in study.variables:
        try:
            values_there = np.unique(np.asarray(get_parameter(study.rig, v.name)))
        except InputError:
            return None
        if len(values_there) != 1:
            return None
        values.append(values_there[0])
    return np.array(values)


def start_note(engine: Engine) -> list[str]:
    """That the start which the user gave meets not all constraints, where that is so."""
    problem = engine.problem
    if all(v.start is None for v in problem.variables):
        return []
    over = engine.figures.values(np.asarray(engine.lanes.share[:1]))[1][0] - np.asarray(
        engine.lanes.limit[0]
    )
    lines = missed(problem, over)
    return [f"the given start is not feasible: {' and '.join(lines)}."] if lines else []


class Exact:
    """The objective of a design in every case, with nominal parts and with `FRESH` new draws."""

    def __init__(self, study: Study, cases: RigCases):
        self.study, self.cases, self.parted = study, cases, bool(cases.parts)
        unit = np.random.default_rng(study.seed + 1).uniform(-1, 1, (FRESH, len(cases.parts)))
        unit = np.sign(unit) if study.spread == "worst" else unit
        draws = np.concatenate(
            [np.zeros((1, len(cases.parts))), unit * np.asarray(cases.half_widths)]
        )
        self.draws = draws if self.parted else draws[:1]
        one_by_one = quick_jit(lambda x, draws: cases.every(x, draws)[0])
        self._metrics = self._in_bulk if cases.goes_in_bulk(len(self.draws)) else one_by_one

    def _in_bulk(self, x: np.ndarray, draws: np.ndarray) -> np.ndarray:
        return self.cases.with_draws(x[None], draws, False, 1).values[0]

    def __call__(self, x) -> np.ndarray:
        """The objective (k, 1 + draws)."""
        return np.asarray(self.cases.weighted(jnp.asarray(self._metrics(x, self.draws))))

    def over_cases(self, values: np.ndarray) -> np.ndarray:
        """The worst case or the mean, as the study asks."""
        return values.max(axis=0) if self.study.over == "worst" else values.mean(axis=0)


def noted(study: Study, cases: RigCases, problem: Problem, best: Design) -> tuple[list[str], dict]:
    """The exact figures at the design in words, and `Design.was`: the rig as it was."""
    exact, unit = Exact(study, cases), best.unit
    x = np.array(list(best.variables.values()))
    values = exact(x)
    nominal, lines = values[:, 0], [cases.note] if cases.note else []
    lines += _by_solver(study, cases, problem, x, best)
    if len(nominal) > 1:
        worst = int(np.argmax(nominal))
        lines.append(
            f"exact over {len(nominal)} cases: worst {quantity_text(nominal[worst], unit)} "
            f"({cases.cases[worst]}), mean {quantity_text(nominal.mean(), unit)}."
        )
    if exact.parted:
        fresh = exact.over_cases(values[:, 1:])
        spread = fresh.std(ddof=1)
        lines.append(
            f"{FRESH} draws of the parts that the search did not see: mean "
            f"{quantity_text(fresh.mean(), unit)} ± "
            f"{quantity_text(spread / np.sqrt(FRESH), unit)}, greatest "
            f"{quantity_text(fresh.max(), unit)}, deviation {quantity_text(spread, unit)}."
        )
    own = as_it_was(study, exact)
    old, new = (float(exact.over_cases(y)) for y in (own, nominal))
    start = before(study)
    was = {
        "name": objective_text(dataclasses.replace(study, tolerances=()))[0],
        "old": old,
        "new": new,
        "cases": {
            name: (float(a), float(b)) for name, a, b in zip(cases.cases, own, nominal, strict=True)
        },
        "variables": {}
        if start is None
        else dict(zip(best.variables, start.tolist(), strict=True)),
    }
    return lines, was


def as_it_was(study: Study, exact: Exact) -> np.ndarray:
    """The objective (k,) of the study's own rig with nominal parts."""
    start = before(study)
    if start is not None:
        return exact(start)[:, 0]
    plain = dataclasses.replace(study, variables=(), constraints=(), tolerances=())
    return Exact(plain, RigCases(plain))(np.zeros(0))[:, 0]


def _by_solver(
    study: Study, cases: RigCases, problem: Problem, x: np.ndarray, best: Design
) -> list[str]:
    """What the adaptive solver says of a design that fixed steps found."""
    if cases.how.method != "fixed":
        return []
    sure = copy.copy(cases)
    sure.how = cases.how._replace(method="full", rtol=RTOL)
    figures = quick_jit(rig_problem(study, sure).figures)
    f, g = (np.asarray(y) for y in figures(jnp.asarray(x), problem.extra))
    return [solver_note(problem, f, g, best)]


def solver_note(problem: Problem, f: np.ndarray, g: np.ndarray, best: Design) -> str:
    """What figures f (k,) and g (c,) of a design by the adaptive solver say of it."""
    value = float(f.max() if problem.worst else f.mean())
    held = " and ".join(missed(problem, g - np.array([x.bound for x in problem.limits])))
    told = [
        f"the adaptive solver gives {quantity_text(value, best.unit)} for this design "
        f"({100 * (value / best.objective - 1):+.1g} %)"
    ]
    told += [held or "it meets every limit"] if problem.limits else []
    return f"{'; '.join(told)}."
