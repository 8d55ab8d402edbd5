"""What no law of the library explains: the noise against which an effect must stand."""

from collections.abc import Callable, Sequence

import numpy as np

from ..._orthonormal import orthonormal_of_many_rows
from ..._search import (
    AbstractModel,
    Fit,
    Point,
    Signatures,
    at_finite_strength,
    by_tangent,
    refit,
    refits_about,
    taken_up,
)
from ..._settings import SETTINGS
from .._candidates import lines_together

LEAST_DIRECTION = SETTINGS.free_floor.least_direction
LAWS = SETTINGS.free_floor.laws
REFITTED = SETTINGS.free_floor.refitted
LEFT_COST = SETTINGS.free_floor.left_cost
NOISE_MISFIT = SETTINGS.free_floor.noise_misfit
TURNS = SETTINGS.free_floor.turns
TURN_COST = SETTINGS.free_floor.turn_cost
STEPS_BETWEEN = SETTINGS.fit.steps_between
RELATIVE = SETTINGS.free_floor.relative
LEAST_CORRELATION = SETTINGS.free_floor.least_correlation
LONGEST_LAG = SETTINGS.free_floor.longest_lag


def best_known(model: AbstractModel, fit: Fit, tell: Callable[[str], None],
               balance: Callable[[], AbstractModel] | None = None) -> Fit:  # fmt: skip
    """The refit with the laws that explain most of the train rows.

    The first at finite strength, for a strong one bends its tangent, and where none explains all,
    several lines of one place as the `balance` of accelerations has them; the next by tangents.
    """
    for step in range(LAWS):
        if fit.chi2 < NOISE_MISFIT * model.dof("train"):
            break
        known = fit.point.effects
        candidates = [c for c in model.candidates(fit.point) if not model.has(known, c.id, c.place)]
        table = Signatures(candidates, model.columns(fit.point, candidates))
        taken = taken_up(fit.jacobian, len(model.priors))
        scan = table.scan(fit.residual, taken, fit.point.u)
        if step == 0:
            starts = at_finite_strength(model, fit, scan.scores, set(model.laws))
        else:
            starts = by_tangent(fit, scan.best_per_name())
        starts = sorted(starts, key=lambda s: s.cost)[:REFITTED]
        starts = [s for s in starts if s.cost < LEFT_COST * fit.cost]
        fits = []
        for start in starts:
            fits.append(settled(model, start.point))
            tell(f"{start.name}: {fits[-1].cost / fit.cost:.3g} of the misfit is left")
        least = min((f.chi2 for f in fits), default=np.inf)
        if step == 0 and balance is not None and not least < NOISE_MISFIT * model.dof("train"):
            point = lines_together(balance(), Point(0 * fit.point.u))
            if point is not None:
                model.rebase(point)  # a window's start had stood for them
                fits.append(settled(model, point))
                said = f"{len(point.effects)} lines, {point.effects[-1].name}"
                tell(f"{said}: {fits[-1].cost / fit.cost:.3g} of the misfit is left")
        new = min(fits, key=lambda f: f.cost, default=fit)
        if not new.cost < LEFT_COST * fit.cost:
            break
        fit = new
    return fit


def settled(model: AbstractModel, point: Point) -> Fit:
    """The refit from a point, then about what `rebase` makes of the data with its laws."""
    fit = refit(model, point, rounds=STEPS_BETWEEN, relative=RELATIVE)
    return turned(model, fit) if model.unsettled(fit.point) else fit


def turned(model: AbstractModel, fit: Fit) -> Fit:
    """A fit refitted about what `rebase` makes of the data at its point.

    Starts and numbers lead each other on from far away, so again as long as much is gained.
    """
    for new in refits_about(model, fit.point, TURNS, relative=RELATIVE):
        gained = new.cost < TURN_COST * fit.cost
        fit = new
        if fit.chi2 < NOISE_MISFIT * model.dof("train") or not gained:
            break
    return fit


def beside(residual: np.ndarray, table: np.ndarray) -> tuple[np.ndarray, int]:
    """A residual less what a table of tangents (k, rows) can make of it, and the table's rank.

    Laws whose shapes differ in little are one direction of it.
    """
    basis = orthonormal_of_many_rows(table.T, short=LEAST_DIRECTION)
    return residual - basis @ (basis.T @ residual), basis.shape[1]


def inflation(parts: Sequence[np.ndarray]) -> float:
    """Rows that say as much as one independent row: 1 + 2 sum of the autocorrelation, at least 1.

    The sum ends at the first small correlation.
    """
    power = sum(float(x @ x) for x in parts)
    total, longest = 1.0, int(LONGEST_LAG * max(len(x) for x in parts))
    for lag in range(1, longest):
        r = sum(float(x[lag:] @ x[:-lag]) for x in parts if len(x) > lag) / max(power, 1e-300)
        if r < LEAST_CORRELATION:
            break
        total += 2 * r
    return total
