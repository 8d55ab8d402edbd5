"""The time column: samples out of order, repeated, missing, or unevenly spaced."""

import numpy as np

from .._errors import InputError
from ._recording import Fault, spans

GLITCH = 5  # rows; more than these out of order are another run, not a glitch of the clock
LATE = 1.5  # steps; a longer one is a missing stretch
UNEVEN = 0.05  # of a step


def usable_rows(file: str, time: np.ndarray) -> tuple[np.ndarray, list[Fault]]:
    """Rows in increasing time, and what is wrong with the time column."""
    faults: list[Fault] = []
    missing = ~np.isfinite(time)
    if missing.any():
        what = f"{missing.sum()} rows have no time"
        faults.append(Fault(file, "t", spans(missing), "missing", what, "these rows are not used"))
    rows = np.flatnonzero(~missing)
    if len(rows) < 3 or np.ptp(time[rows]) == 0:
        raise InputError(
            f"{file}, column `t`: three samples at increasing times are needed at least."
        )
    keep, end = _increasing(time[rows])
    faults += _order_faults(file, time, rows, keep, end)
    rows = rows[keep]
    if len(rows) < 3:
        raise InputError(f"{file}, column `t`: time does not increase over three rows or more.")
    faults += _spacing_faults(file, time[rows], rows)
    return rows, faults


def _increasing(time: np.ndarray) -> tuple[np.ndarray, int]:
    """Which samples to keep, and where the record ends: where the clock goes back for good."""
    if np.all(np.diff(time) > 0):
        return np.ones(len(time), bool), len(time)
    steps = np.diff(time)
    step = np.median(steps[steps > 0]) if (steps > 0).any() else 0.0
    kept: list[int] = []
    i = 0
    while i < len(time):
        if not kept or time[i] > time[kept[-1]]:
            kept.append(i)
            i += 1
            continue
        ahead = next((m for m in range(1, GLITCH + 1) if _follows(time, kept[-1], i + m, step)), 0)
        if ahead:  # rows i ... are late or repeated
            i += ahead
            continue
        back = next((m for m in range(1, GLITCH + 1) if _before(time, kept, i, m, step)), 0)
        if not back:
            keep = np.zeros(len(time), bool)
            keep[kept] = True
            return keep, i
        del kept[-back:]  # the rows before ran ahead
    keep = np.zeros(len(time), bool)
    keep[kept] = True
    return keep, len(time)


def _follows(time: np.ndarray, last: int, next_: int, step: float) -> bool:
    if next_ >= len(time):
        return next_ == len(time)
    return 0 < time[next_] - time[last] <= (next_ - last + 1.5) * step


def _before(time: np.ndarray, kept: list[int], i: int, m: int, step: float) -> bool:
    return len(kept) > m and 0 < time[i] - time[kept[-m - 1]] <= (m + 1.5) * step


def _order_faults(file: str, time, rows, keep, end: int) -> list[Fault]:
    faults = []
    bad = np.zeros(len(time), bool)
    dropped = rows[:end][~keep[:end]]
    bad[dropped] = True
    if bad.any():
        n = bad.sum()
        what = f"time does not increase at {n} row{'s' if n > 1 else ''}"
        use = "these rows are not used" if n > 1 else "this row is not used"
        faults.append(Fault(file, "t", spans(bad), "non-increasing time", what, use))
    if end < len(rows):
        first, last = rows[end], rows[-1]
        before = time[rows[end - 1]]
        what = f"time goes back from {before:g} s to {time[first]:g} s and does not recover"
        use = f"only the {int(keep.sum())} rows before are used"
        span = ((int(first) + 1, int(last) + 1),)
        faults.append(Fault(file, "t", span, "non-increasing time", what, use))
    return faults


def _spacing_faults(file: str, time: np.ndarray, rows: np.ndarray) -> list[Fault]:
    steps = np.diff(time)
    step = float(np.median(steps))
    faults = []
    late = np.flatnonzero((steps > LATE * step) & (np.diff(rows) == 1))
    for k in late[:20]:
        what = f"nothing was recorded from {time[k]:g} s to {time[k + 1]:g} s (step {step:g} s)"
        use = "the inputs are taken as linear across it and the outputs as unknown"
        span = ((int(rows[k]) + 1, int(rows[k + 1]) + 1),)
        faults.append(Fault(file, "t", span, "gap", what, use))
    if len(late) > 20:
        what = f"{len(late) - 20} more gaps"
        faults.append(Fault(file, "t", (), "gap", what, "treated in the same way"))
    near = steps[steps <= LATE * step]
    if np.abs(near - step).max() > UNEVEN * step and np.std(near) > 0.2 * UNEVEN * step:
        what = f"the steps vary from {near.min():g} s to {near.max():g} s"
        use = "spectra are taken after resampling"
        faults.append(Fault(file, "t", (), "uneven sampling", what, use))
    return faults
