"""A search's main part: the nearest optimum, or, where limits conflict, the least violation.

A search may leave the piece of the design space it began in and end in one without a feasible
design.  Then it is led to the least violation,

    minimise max_j (g_j - limit_j)/scale_j    over 0 <= s <= 1,

and goes on from there if that meets every limit; else from its own start if that does.  In a
narrow piece the first long step leaves it for good, so that where it leads nowhere from a design
that meets every limit, shorter ones are tried.
"""

import numpy as np

from .kkt import FEASIBLE
from .sqp import Scaled, SqpSlopes, refined_by_sqp

REACHES = (1.0, 0.1, 0.02)  # of a range
LEGS = 8  # at most, one after the other where each goes as far as it may


def violations(problem: Scaled) -> Scaled:
    """The problem of least violation: each limit is a case, the worst of which counts."""

    def at(share: np.ndarray) -> SqpSlopes:
        s = problem.at(share)
        over, slopes = (s.g - problem.limit) / problem.unit, s.dg / problem.unit[:, None]
        return SqpSlopes(over, np.zeros(0), slopes, np.zeros((0, len(share))))

    return Scaled(at, np.zeros(0), np.zeros(0), 1.0, True)


def restore_feasibility(
    problem: Scaled, near: np.ndarray, begin: np.ndarray, free: np.ndarray
) -> tuple[np.ndarray, int]:
    """Where the search from `begin` (d,) ends that has come to `near`, and the evaluations."""
    end, spent = nearest(problem, near, free)
    over, value = problem.merit(problem.at(end))
    first, before = problem.merit(problem.at(begin))
    if (
        first <= FEASIBLE
        and (over > FEASIBLE or value > before)
        and not np.array_equal(near, begin)
    ):
        end, more = nearest(problem, begin, free)
        over, spent = problem.merit(problem.at(end))[0], spent + more
    if over > FEASIBLE:
        least, more = refined_by_sqp(violations(problem), end, free)
        again, further = nearest(problem, least, free)
        spent += more + further
        mended = problem.merit(problem.at(again))[0] <= FEASIBLE
        end = again if mended else least
    return end, spent


def nearest(problem: Scaled, begin: np.ndarray, free: np.ndarray) -> tuple[np.ndarray, int]:
    """The optimum near `begin`, or `begin` itself; and the evaluations."""
    reaches = REACHES if problem.merit(problem.at(begin))[0] <= FEASIBLE else REACHES[:1]
    spent = 0
    for reach in reaches:
        end = begin
        for _ in range(LEGS):
            at = end
            end, more = refined_by_sqp(problem, at, free, reach)
            spent += more
            if np.max(np.abs(end - at)) < 0.99 * reach:
                break
        if not np.array_equal(end, begin):
            return end, spent
    return begin, spent
