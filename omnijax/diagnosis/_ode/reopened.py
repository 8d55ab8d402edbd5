"""Windows whose free start is caught, begun anew from what was measured.

A start that other laws drew away leads a window of stick and slip through other turns than the
machine took, and no step of Gauss and Newton leads back through them.  What comes early in a window
hangs on its start almost linearly: so the start is fitted to the window's opening first, then to
more and more of it, as multiple shooting does with its segments (Bock, 1983).
"""

from collections.abc import Callable, Mapping

import numpy as np

from .._settings import SETTINGS
from .rows import FreeRun

CAUGHT = SETTINGS.free_reopened.caught
OPENINGS = SETTINGS.free_reopened.openings

ByRun = Callable[[], dict[int, np.ndarray]]


def caught(runs: Mapping[int, FreeRun], left: Mapping[int, np.ndarray]) -> bool:
    """Whether some windows miss far more a row than half of them do."""
    missed = np.concatenate([r.mean_squares(left[i]) for i, r in runs.items()])
    missed = np.sort(missed[np.isfinite(missed)])
    return bool(len(missed) and missed[-1] > CAUGHT * missed[(len(missed) - 1) // 2])


def reopened(runs: Mapping[int, FreeRun], left: ByRun, slopes: ByRun) -> bool:
    """Whether some windows fit better from starts fitted to their openings; they keep these.

    `left()` gives by run what is left of its rows, `slopes()` what each number of the starts
    changes there, both at the starts that the runs have then.
    """
    first = left()
    if not caught(runs, first):
        return False
    known = {i: r.starts for i, r in runs.items()}
    for r in runs.values():
        r.start_at(np.zeros_like(r.starts))
    for share in OPENINGS:
        changes, rest = slopes(), left()
        for i, r in runs.items():
            r.start_at(r.better_starts(changes[i], rest[i], share))
    last, moved = left(), False
    for i, r in runs.items():
        new = np.nan_to_num(r.squares(last[i]), nan=np.inf)
        better = new < r.squares(first[i])
        r.start_at(np.where(better[:, None], r.starts, known[i]))
        moved |= bool(np.any(better))
    return moved
