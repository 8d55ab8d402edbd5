"""Points with further lines on a wheel's shaft, all its lines there chosen together."""

import numpy as np

from .._search import Effect, Fit, Point, beside_taken, taken_up, to_project
from .._settings import SETTINGS
from ._where import LAWS, LineSet, estimated, line_sets, order_grid, promising, shaft_runs

WEIGHED = SETTINGS.line_sets.weighed
ALL_WEIGHED = SETTINGS.line_sets.all_weighed
FINER = SETTINGS.rig_orders.finer


def points_with_lines(model, fit: Fit, id: str, place: str, more: int) -> list[Point]:
    """The fit's point with `more` lines of a law at a wheel, all its lines there chosen anew.

    What explains the fitted runs best, and all that does so as well to the margin of equals; first
    what explains the held-out runs beside them best.  Lines stand last.
    """
    if id not in LAWS or place not in model.rig.names:
        return []
    effects = fit.point.effects
    own = [i for i, e in enumerate(effects) if (e.id, e.place) == (id, place)]
    bare = fit.point.with_effects(*(e for i, e in enumerate(effects) if i not in own))
    known = [float(effects[i].values["order"]) for i in own]
    P = len(fit.point.u)
    gone = [P + k for k, f in enumerate(fit.free) if f.effect in own]
    J, u = to_project(model, np.delete(fit.jacobian, gone, axis=1), fit.point.u)
    taken = taken_up(J, len(u))
    (rest,) = model.residuals([bare], "train")
    rows, left = model.of_rotation(beside_taken(rest, taken, u), "train")
    k = model.rig.names.index(place)
    bases, beside = model.bases(bare), model.rotation_taken(taken[: len(rest)])
    fitted = shaft_runs(bases, left, rows, beside, k)
    grid = order_grid(bases, k)
    step = grid[1] - grid[0]
    if len(grid) * sum(r.samples for r in rows) > ALL_WEIGHED:
        gains = estimated(bases, left, rows, beside, k, grid)[LAWS.index(id)]
        some = np.array(promising(grid, gains, FINER * step, WEIGHED))
    else:
        some = grid
    judging = _judging(model, bare, k)
    margin = model.settings.equal_margin
    sets = line_sets(fitted, judging, id, some, step, known, more, margin)
    return [bare.with_effects(*bare.effects, *_lines(id, place, s)) for s in sets]


def _judging(model, point: Point, k: int) -> list:
    """What torques on the shaft of wheel `k` show in the held-out runs."""
    (rest,) = model.residuals([point], "held-out")
    rows, left = model.of_rotation(rest, "held-out")
    nothing = [np.zeros((x.size, 0)) for x in left]
    return shaft_runs(model.bases(point, "held-out"), left, rows, nothing, k)


def _lines(id: str, place: str, lines: LineSet) -> list[Effect]:
    """Effects of a law `size sin(N angle + phase)`, of the sizes of cosine and sine."""
    size = "amplitude" if id == "motor-ripple" else "g"
    return [
        Effect(id, place, {"order": float(order), size: float(np.hypot(cosine, sine)),
                           "phase": float(np.arctan2(cosine, sine))})
        for order, (cosine, sine) in zip(lines.orders, lines.sizes, strict=True)
    ]  # fmt: skip
