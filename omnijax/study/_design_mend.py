"""A search's last part: the nearest optimum, or, where limits conflict, the least violation.

An augmented Lagrangian may leave the piece of the design space it began in and end in one without a
feasible design.  Then the search is led to the least violation,

    minimise max_j (g_j - limit_j)/scale_j    over 0 <= s <= 1,

and goes on from there if that meets every limit; else from its own start if that does.
"""

import numpy as np

from ._design_kkt import FEASIBLE
from ._design_polish import Scaled, Slopes, polish


def violations(problem: Scaled) -> Scaled:
    """The problem of least violation: each limit is a case, the worst of which counts."""

    def at(share: np.ndarray) -> Slopes:
        s = problem.at(share)
        over, slopes = (s.g - problem.limit) / problem.unit, s.dg / problem.unit[:, None]
        return Slopes(over, np.zeros(0), slopes, np.zeros((0, len(share))))

    return Scaled(at, np.zeros(0), np.zeros(0), 1.0, True)


def mend(
    problem: Scaled, near: np.ndarray, begin: np.ndarray, free: np.ndarray
) -> tuple[np.ndarray, int]:
    """Where the search from `begin` (d,) ends that has come to `near`, and the evaluations."""
    end, spent = polish(problem, near, free)
    over, value = problem.merit(problem.at(end))
    first, before = problem.merit(problem.at(begin))
    if (
        first <= FEASIBLE
        and (over > FEASIBLE or value > before)
        and not np.array_equal(near, begin)
    ):
        end, more = polish(problem, begin, free)
        over, spent = problem.merit(problem.at(end))[0], spent + more
    if over > FEASIBLE:
        least, more = polish(violations(problem), end, free)
        again, further = polish(problem, least, free)
        spent += more + further
        mended = problem.merit(problem.at(again))[0] <= FEASIBLE
        end = again if mended else least
    return end, spent
