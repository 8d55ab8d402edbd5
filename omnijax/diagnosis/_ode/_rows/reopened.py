"""Windows whose free start is caught, begun anew from what was measured.

A start that other laws drew away leads a window of stick and slip through other turns than the
machine took, and no step of Gauss and Newton leads back through them.  What comes early in a window
hangs on its start almost linearly: so the start is fitted to the window's opening first, then to
more and more of it, as multiple shooting does with its segments (Bock, 1983).
"""

from collections.abc import Callable, Mapping

import numpy as np

from ..._settings import SETTINGS
from .rows import FreeRun

CAUGHT_RATIO = SETTINGS.free_reopened.caught_ratio
OPENINGS = SETTINGS.free_reopened.openings

ByRun = dict[int, np.ndarray]


def caught(runs: Mapping[int, FreeRun], left: ByRun) -> bool:
    """Whether some windows miss far more a row than half of them do."""
    missed = np.concatenate([r.mean_squares(left[i]) for i, r in runs.items()])
    missed = np.sort(missed[np.isfinite(missed)])
    return bool(len(missed) and missed[-1] > CAUGHT_RATIO * missed[(len(missed) - 1) // 2])


def reopened(
    runs: Mapping[int, FreeRun],
    known: ByRun,
    left: Callable[[ByRun], ByRun],
    tangents: Callable[[ByRun], ByRun],
) -> ByRun | None:
    """Starts by run, of some windows fitted to their openings as they fit better; else `known`.

    None where no window is caught or fits better.  `left` gives by run what is left of its rows at
    some starts, `tangents` what each number of these changes there.
    """
    first = left(known)
    if not caught(runs, first):
        return None
    starts = {i: r.as_measured() for i, r in runs.items()}
    for share in OPENINGS:
        changes, rest = tangents(starts), left(starts)
        starts = {
            i: r.better_starts(starts[i], changes[i], rest[i], share) for i, r in runs.items()
        }
    last = left(starts)
    better = {
        i: np.nan_to_num(r.squares(last[i]), nan=np.inf) < r.squares(first[i])
        for i, r in runs.items()
    }
    if not any(np.any(x) for x in better.values()):
        return None
    return {i: np.where(better[i][:, None], starts[i], known[i]) for i in runs}
