"""`design`: the best rig of a study."""

import dataclasses
from collections.abc import Mapping
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

from .._errors import InputError
from ..rig import Rig, get_parameter
from ._amounts import amount
from ._design_engine import Engine
from ._design_folder import Folder, Report
from ._design_result import Design, make_design, missed
from ._design_rig import RigCases, rig_problem
from ._design_search import Adam
from ._study_file import Study, study_of

FRESH = 64  # draws of the parts that the search has not seen


def design(
    study: str | Path | Mapping | Study,
    *,
    out: str | Path | None = None,
    resume: bool = False,
    report: Report | None = None,
) -> Design:
    """The best design of a study (a TOML file, its tables, or a `Study`).

    With `out` finished searches are stored there, and `resume` takes them up.  `report(done,
    total)` is called after each batch of searches.  The design is checked against the exact worst
    case, and against draws of the parts that the search did not see.
    """
    asked = study_of(study)
    if not asked.variables:
        raise InputError("a design needs at least one [[variable]] with path, low and high.")
    cases = RigCases(asked)
    problem = rig_problem(asked, cases)
    if asked.stochastic and not cases.parts:
        raise InputError("`search.stochastic_steps` needs a [tolerance] table to draw from.")
    engine = Engine(problem, asked.starts, asked.seed)
    store = None if out is None else Folder(out, asked.identity(), resume)
    drawn = Adam(asked.stochastic, seed=asked.seed) if asked.stochastic else None
    ends = engine.all_ends(asked.batch, store, report, drawn)
    found = make_design(problem, ends)
    notes = [*found.notes, *start_note(engine), *_notes(asked, cases, found)]
    return dataclasses.replace(found, notes=tuple(notes))


def designed_rig(study: str | Path | Mapping | Study, found: Design) -> Rig:
    """The study's rig with the design's values (under its first load)."""
    asked = study_of(study)
    plain = dataclasses.replace(asked, loads=asked.loads[:1])
    return RigCases(plain).rig(jnp.array(list(found.variables.values())))


def before(study: Study) -> np.ndarray | None:
    """The variables' values in the study's own rig; None where a wheel differs from the others."""
    values = []
    for v in study.variables:
        try:
            found = np.unique(np.asarray(get_parameter(study.rig, v.name)))
        except InputError:
            return None
        if len(found) != 1:
            return None
        values.append(found[0])
    return np.array(values)


def start_note(engine: Engine) -> list[str]:
    """That the start which the user gave meets not all constraints, where that is so."""
    problem = engine.problem
    if all(v.start is None for v in problem.variables):
        return []
    over = engine.values(np.asarray(engine.lanes.share[:1]))[1][0] - np.asarray(
        engine.lanes.limit[0]
    )
    lines = missed(problem, over)
    return [f"the given start is not feasible: {' and '.join(lines)}."] if lines else []


class Exact:
    """The objective of a design in every case, with nominal parts and with `FRESH` new draws."""

    def __init__(self, study: Study, cases: RigCases):
        self.study, self.parted = study, bool(cases.parts)
        unit = np.random.default_rng(study.seed + 1).uniform(-1, 1, (FRESH, len(cases.parts)))
        unit = np.sign(unit) if study.spread == "worst" else unit
        draws = np.concatenate([np.zeros((1, len(cases.parts))), unit * np.asarray(cases.width)])
        self.draws = jnp.asarray(draws if self.parted else draws[:1])
        self.figures = jax.jit(lambda x, draws: cases.weighted(cases.every(x, draws)[0]))

    def __call__(self, x) -> np.ndarray:
        """The objective (k, 1 + draws)."""
        return np.asarray(self.figures(jnp.asarray(x), self.draws))

    def over_cases(self, values: np.ndarray) -> np.ndarray:
        """The worst case or the mean, as the study asks."""
        return values.max(axis=0) if self.study.over == "worst" else values.mean(axis=0)


def _notes(study: Study, cases: RigCases, found: Design) -> list[str]:
    """The exact figures at the design, and the rig as it was."""
    exact, unit = Exact(study, cases), found.unit
    values = exact(list(found.variables.values()))
    nominal, lines = values[:, 0], []
    if len(nominal) > 1:
        worst = int(np.argmax(nominal))
        lines.append(
            f"exact over {len(nominal)} cases: worst {amount(nominal[worst], unit)} "
            f"({cases.cases[worst]}), mean {amount(nominal.mean(), unit)}."
        )
    if exact.parted:
        fresh = exact.over_cases(values[:, 1:])
        spread = fresh.std(ddof=1)
        lines.append(
            f"{FRESH} draws of the parts that the search did not see: mean "
            f"{amount(fresh.mean(), unit)} ± {amount(spread / np.sqrt(FRESH), unit)}, greatest "
            f"{amount(fresh.max(), unit)}, deviation {amount(spread, unit)}."
        )
    start = before(study)
    if start is not None:
        old = float(exact.over_cases(exact(start)[:, 0]))
        new = float(exact.over_cases(nominal))
        lines.append(
            f"the rig as it was: {amount(old, unit)}; the design, parts at their nominal values: "
            f"{amount(new, unit)} ({100 * (new / old - 1):+.1f} %)."
        )
    return lines
