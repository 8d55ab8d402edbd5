"""Several lines of one place at once, as the balance of accelerations has them.

Two cogging torques bend a free run so far that neither alone leads towards it, and a machine that
is calibrated without them is far off.  With the measured position q in place of the simulated one
nothing is bent: what is left of the acceleration is the sum of a_k cos(N_k q) + b_k sin(N_k q),
linear in the lines' sizes and nearly so in the machine's own numbers, so that one line after the
other is found, all refitted together.  The free run begins at what this equation error gives.

A line that is looked for beside others which are not known yet may be found at a side lobe.  So
each is looked for once more beside all others, until none moves: the relaxation of Li, Stoica,
Efficient mixed-spectrum estimation with applications to target feature extraction (1996).
"""

import dataclasses

import numpy as np

from ..._search import AbstractModel, Fit, Point, Signatures, by_tangent, refit, taken_up
from ..._settings import SETTINGS

LINES = SETTINGS.free_model.lines
LEFT_COST = SETTINGS.free_floor.left_cost
RELAXED_TURNS = SETTINGS.free_together.relaxed_turns
MOVED_COST = SETTINGS.free_together.moved_cost
ROUNDS = SETTINGS.free_together.rounds


def lines_together(balance: AbstractModel, point: Point) -> Point | None:
    """A point with several new lines of a law at one place, the machine refitted with them.

    `balance` is the model by its balance of accelerations, with laws of lines.  A further line has
    to take a share of the squares that those before leave.  None where no law has two such lines.
    """
    first, several = refit(balance, point), []
    names = {c.name for c in balance.candidates(point)}
    for name in sorted(names):
        fit = first
        for _ in range(LINES):
            new = _with_line(balance, fit, name)
            if new is None or not new.cost < LEFT_COST * fit.cost:
                break
            fit = _relaxed(balance, new, len(point.effects))
        if len(fit.point.effects) > len(point.effects) + 1:
            several.append(fit)
    return min(several, key=lambda f: f.cost).point if several else None


def _relaxed(balance: AbstractModel, fit: Fit, known: int) -> Fit:
    """The fit with each line after the first `known` effects looked for anew beside the others."""
    lines = range(known, len(fit.point.effects))
    for _ in range(RELAXED_TURNS if len(lines) > 1 else 0):
        before = fit
        for _ in lines:  # the one that is looked for anew becomes the last
            effects = fit.point.effects
            name = effects[known].name
            others = fit.point.with_effects(*effects[:known], *effects[known + 1 :])
            new = _with_line(balance, refit(balance, others, rounds=ROUNDS), name)
            turned = (*effects[:known], *effects[known + 1 :], effects[known])
            same = dataclasses.replace(fit, point=fit.point.with_effects(*turned))
            fit = new if new is not None and new.cost < MOVED_COST * fit.cost else same
        if not fit.cost < before.cost:
            break
    return fit


def _with_line(balance: AbstractModel, fit: Fit, name: str) -> Fit | None:
    """The refit with the best further line of a name; None where there is none."""
    candidates = [c for c in balance.candidates(fit.point) if c.name == name]
    if not candidates or not np.isfinite(fit.cost):
        return None
    table = Signatures(candidates, balance.columns(fit.point, candidates))
    scan = table.scan(fit.residual, taken_up(fit.jacobian, len(balance.priors)), fit.point.u)
    starts = by_tangent(fit, scan.best_per_name())
    return refit(balance, starts[0].point, rounds=ROUNDS) if starts else None
