"""`design`: the best rig of a study."""

import dataclasses
from collections.abc import Mapping
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

from .._errors import InputError
from ..rig import Rig, get_parameter
from ._design_engine import Engine
from ._design_folder import Folder, Report
from ._design_result import Design, amount, make_design
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
    return dataclasses.replace(found, notes=tuple(_notes(asked, cases, found)))


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


def _notes(study: Study, cases: RigCases, found: Design) -> list[str]:
    """The exact figures at the design, and the rig as it was."""
    x = jnp.array(list(found.variables.values()))
    nominal = jnp.zeros((1, len(cases.parts)))
    exact = jax.jit(lambda x, draws: cases.weighted(cases.every(x, draws)[0]))
    lines, values = [], np.asarray(exact(x, nominal))[:, 0]
    unit = found.unit
    if len(values) > 1:
        worst = int(np.argmax(values))
        lines.append(
            f"exact over {len(values)} cases: worst {amount(values[worst], unit)} "
            f"({cases.cases[worst]}), mean {amount(values.mean(), unit)}."
        )
    if cases.parts:
        draws = np.random.default_rng(study.seed + 1).uniform(-1, 1, (FRESH, len(cases.parts)))
        if study.spread == "worst":
            draws = np.sign(draws)
        fresh = np.asarray(exact(x, jnp.asarray(draws) * cases.width))
        part = fresh.max(axis=0) if study.over == "worst" else fresh.mean(axis=0)
        error = part.std() / np.sqrt(FRESH)
        lines.append(
            f"{FRESH} draws of the parts that the search did not see: mean "
            f"{amount(part.mean(), unit)} ± {amount(error, unit)}, greatest "
            f"{amount(part.max(), unit)}, deviation {amount(part.std(), unit)}."
        )
    start = before(study)
    if start is not None:
        old = np.asarray(exact(jnp.asarray(start), nominal))[:, 0]
        old = old.max() if study.over == "worst" else old.mean()
        new = values.max() if study.over == "worst" else values.mean()
        lines.append(
            f"the rig as it was: {amount(old, unit)}; the design, parts at their nominal values: "
            f"{amount(new, unit)} ({100 * (new / old - 1):+.1f} %)."
        )
    return lines
