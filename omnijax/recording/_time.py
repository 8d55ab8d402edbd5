"""The time column: samples out of order, repeated, missing, or unevenly spaced."""

import bisect
import itertools

import numpy as np

from .._errors import InputError
from ._grid import UNEVEN, EvenTimes, grid_of
from ._recording import Fault, spans

GLITCH = 5  # rows; more than these out of order are another run, not a glitch of the clock


def usable_rows(file: str, time: np.ndarray) -> tuple[np.ndarray, list[Fault]]:
    """`ordered_rows` of a recording, and what is said of their spacing too."""
    rows, faults = ordered_rows(file, time)
    return rows, faults + _spacing_faults(file, time[rows], rows)


def ordered_rows(file: str, time: np.ndarray, first: int = 0) -> tuple[np.ndarray, list[Fault]]:
    """Rows (k,) of one run in increasing time, of `time` (t,) in s, and what is wrong with others.

    Where a clock was set back for good, another run begins: the longest is taken, by its rows that
    increase.  `first` is the number of the rows above in the file.  `InputError` where
    fewer than three rows are left.
    """
    number, faults = np.arange(len(time)) + 1 + first, []

    def say(bad: np.ndarray, kind: str, what: str, use: str) -> None:
        at = np.isin(np.arange(len(time)), bad)
        faults.append(Fault(file, "t", spans(at, number), kind, what, use))

    rows = np.flatnonzero(np.isfinite(time))
    if len(rows) < len(time):
        gone = np.setdiff1d(np.arange(len(time)), rows)
        say(gone, "missing", f"{len(gone)} rows have no time", "these rows are not used")
    if len(rows) < 3 or np.ptp(time[rows]) == 0:
        raise InputError(
            f"{file}, column `t`: three samples at increasing times are needed at least."
        )
    runs = _runs(time[rows])
    if len(runs) > 1:
        run = max(runs, key=lambda part: _increasing(time[rows[part]]).sum())
        left, before, after = np.delete(rows, run), *time[rows[runs[1].start - 1 :][:2]]
        what = f"time goes back from {before:g} s to {after:g} s and does not recover"
        rows = rows[run]
        use = f"only the longest run is used, rows {number[rows[0]]} to {number[rows[-1]]}"
        say(left, "non-increasing time", what, use)
    keep = _increasing(time[rows])
    if not keep.all():
        n = len(rows) - int(keep.sum())
        what = f"time does not increase at {n} row{'s' if n > 1 else ''}"
        use = "these rows are not used" if n > 1 else "this row is not used"
        say(rows[~keep], "non-increasing time", what, use)
    if np.sum(keep) < 3:
        raise InputError(f"{file}, column `t`: time does not increase over three rows or more.")
    return rows[keep], faults


def _runs(time: np.ndarray, begin: int = 0) -> list[slice]:
    """The runs of a log whose clock (t,) was set back between them; `begin` is its first row."""
    cuts = _set_back(time)
    if not cuts:
        return [slice(begin, begin + len(time))]
    parts = itertools.pairwise([0, *cuts, len(time)])
    return [run for a, b in parts for run in _runs(time[a:b], begin + a)]


def _set_back(time: np.ndarray) -> list[int]:
    """Rows at which a clock (t,) was set back by more than `GLITCH` rows; not all at once.

    There rows are left out between two that are kept, and time does not go on as long as they took.
    """
    kept = np.flatnonzero(_increasing(time))
    if len(kept) == len(time) or len(kept) < 2:
        return []
    step, best = np.median(np.diff(time[kept])), None
    ends, cuts = np.concatenate([[-1], kept, [len(time)]]), []
    for k in np.flatnonzero(np.diff(ends) > GLITCH + 1):
        a, b = ends[k : k + 2]
        between = time[a + 1 : b]
        early = between < time[a] if a >= 0 else np.zeros(len(between), bool)
        late = between > time[b] if b < len(time) else np.zeros(len(between), bool)
        went_on = (time[b] - time[a]) / step if a >= 0 and b < len(time) else 0.0
        if np.sum(early | late) - went_on > GLITCH:
            best = _best_cuts(time) if best is None else best
            cuts.append(max(int(a), 0) + 1 + int(np.argmax(best[max(int(a), 0) : b])))
    return cuts


def _best_cuts(time: np.ndarray) -> np.ndarray:
    """How good it is to cut before the second row, the third ... (t - 1,).

    By as many rows as can be that increase in both parts, among equal ones by how far time falls.
    """
    before, after = _counts(time)[:-1], _counts(-time[::-1])[-2::-1]
    return before + after - np.clip(np.diff(time) / max(np.ptp(time), 1e-300), -0.5, 0.5)


def _counts(time: np.ndarray) -> np.ndarray:
    """Of how many rows that increase the times up to each one (t,) have."""
    ends: list[float] = []
    counts = np.empty(len(time))
    for i, x in enumerate(time.tolist()):
        k = bisect.bisect_left(ends, x)
        ends[k : k + 1] = [x]
        counts[i] = len(ends)
    return counts


def _increasing(time: np.ndarray) -> np.ndarray:
    """Which rows (t,) to keep so that times increase: as many as can be, of equal ones the first.

    One damaged time far ahead does not cost all rows up to it.  Source: Fredman, On computing the
    length of longest increasing subsequences (1975).
    """
    if np.all(np.diff(time) > 0):
        return np.ones(len(time), bool)
    ends: list[float] = []  # the least time at which k + 1 rows that increase can end
    rows: list[int] = []  # and its row
    before = np.full(len(time), -1)
    for i, x in enumerate(time.tolist()):
        k = bisect.bisect_left(ends, x)
        before[i] = rows[k - 1] if k else -1
        if ends[k : k + 1] != [x]:
            ends[k : k + 1], rows[k : k + 1] = [x], [i]
    keep, i = np.zeros(len(time), bool), rows[-1]
    while i >= 0:
        keep[i], i = True, before[i]
    return keep


def _spacing_faults(file: str, time: np.ndarray, rows: np.ndarray) -> list[Fault]:
    steps, grid = np.diff(time), grid_of(time)
    faults = []
    late = np.flatnonzero(grid.gaps & (np.diff(rows) == 1))
    for k in late[:20]:
        what = (
            f"nothing was recorded from {time[k]:g} s to {time[k + 1]:g} s (step {grid.step:g} s)"
        )
        use = "the inputs are taken as linear across it and the outputs as unknown"
        span = ((int(rows[k]) + 1, int(rows[k + 1]) + 1),)
        faults.append(Fault(file, "t", span, "gap", what, use))
    if len(late) > 20:
        what = f"{len(late) - 20} more gaps"
        faults.append(Fault(file, "t", (), "gap", what, "treated in the same way"))
    near = steps[~grid.gaps]
    if np.abs(near - grid.step).max() > UNEVEN * grid.step:
        what = f"the steps vary from {near.min():g} s to {near.max():g} s"
        faults.append(Fault(file, "t", (), "uneven sampling", what, _even_times(grid)))
    return faults


def _even_times(grid: EvenTimes) -> str:
    """What a diagnosis does about uneven steps."""
    if not grid.even:
        return f"a diagnosis moves the samples to even times, {grid.step:g} s apart"
    rounded = f" (their times are rounded to {grid.rounding:g} s)" if grid.rounding else ""
    return f"the samples are taken as even, {grid.step:g} s apart{rounded}"
