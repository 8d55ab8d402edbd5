"""Is a design optimal?  Karush, Kuhn and Tucker's conditions, multipliers by least squares.

    sum_k w_k df_k/ds + sum_j lambda_j dg_j/ds + bounds = 0,    w, lambda >= 0,   sum w = 1

over the active cases, limits and bounds; s is the share of each variable's range.  The residual is
relative to the objective: to first order no step over a whole range changes it by more.
"""

from typing import NamedTuple

import numpy as np
from scipy.optimize import nnls

STATIONARY, FEASIBLE = 1e-4, 1e-5
ON_BOUND, ACTIVE = 1e-4, 1e-4


class DualPoint(NamedTuple):
    """Figures and their slopes over the shares at one design."""

    share: np.ndarray  # (d,)
    f: np.ndarray  # (k,)
    g: np.ndarray  # (c,) less its limit, in units of its scale
    df: np.ndarray  # (k, d)
    dg: np.ndarray  # (c, d), scaled


class Kkt(NamedTuple):
    """Multipliers and residual; `bounds` is signed: below 0 at a lower bound, above at an upper."""

    residual: float
    violation: float
    cases: np.ndarray  # (k,) weights
    limits: np.ndarray  # (c,) objective per scaled unit of the limit
    bounds: np.ndarray  # (d,) objective per range


def conditions(point: DualPoint, free: np.ndarray, worst: bool, size: float) -> Kkt:
    """The best multipliers for a design, and what they leave over."""
    k, c, d = len(point.f), len(point.g), len(point.share)
    violation = float(np.max(point.g, initial=0.0))
    leading = point.f >= point.f.max() - ACTIVE * size if worst else np.ones(k, bool)
    slopes = point.df[leading] if worst else point.df.mean(axis=0)[None]
    tight = point.g >= -ACTIVE
    low = (point.share <= ON_BOUND) & free
    high = (point.share >= 1 - ON_BOUND) & free
    eye = np.eye(d)
    columns = [*slopes, *(size * point.dg[tight]), *(-size * eye[low]), *(size * eye[high])]
    matrix = np.array(columns).T[free] / size
    lead = len(slopes)
    heavy = 1e6  # the weights' sum is exact
    row = np.concatenate([np.full(lead, heavy), np.zeros(matrix.shape[1] - lead)])
    weights, _ = nnls(np.vstack([matrix, row]), np.append(np.zeros(len(matrix)), heavy))
    residual = float(np.max(np.abs(matrix @ weights), initial=0.0))
    parts = np.split(weights, np.cumsum([lead, tight.sum(), low.sum()]))
    cases, limits, bounds = np.zeros(k), np.zeros(c), np.zeros(d)
    cases[leading] = parts[0] if worst else 1 / k
    limits[tight] = size * parts[1]
    bounds[low] -= size * parts[2]
    bounds[high] += size * parts[3]
    return Kkt(residual, violation, cases, limits, bounds)


def verdict(kkt: Kkt, better: float) -> tuple[str, str]:
    """(status, reason) of finite figures: `optimal`, `infeasible` or `not optimal`.

    `better` is the relative gain of the best feasible neighbour that was tried.
    """
    if kkt.violation > FEASIBLE:
        return "infeasible", "a constraint is violated"
    if kkt.residual > STATIONARY:
        return "not optimal", (
            f"the KKT residual {kkt.residual:.2g} is above {STATIONARY:g}: the search stopped "
            "early, or the objective has a kink here"
        )
    if better > STATIONARY:
        return "not optimal", f"a neighbouring design is better by {100 * better:.2g} %"
    return "optimal", f"KKT residual {kkt.residual:.1e}, no feasible neighbour is better"
