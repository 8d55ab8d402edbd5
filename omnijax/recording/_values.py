"""Values that cannot be true: missing, constant, stuck or clipped."""

import numpy as np

from .._errors import InputError
from ._columns import INPUTS, OUTPUTS, group_of, unit_of
from ._grid import longer_than_bridged
from ._recording import Fault, spans

STUCK = 25  # equal values in a row that no live sensor gives
GREATEST = 1e9  # N m, N: what no motor and no hand gives
FAR = 1e3  # times the largest other value of an input, from which one cell is told


def clean(file: str, channels: dict[str, np.ndarray], rows: np.ndarray, noise_free) -> list[Fault]:
    """Mark in place what cannot be used as NaN; `noise_free(column)` tells simulated channels."""
    faults = _missing(file, channels, rows)
    for column, values in channels.items():
        if group_of(column) in OUTPUTS and np.isfinite(values).any() and not noise_free(column):
            faults += _dead(file, column, values, _moving(channels, column), rows)
    return faults


def mend_inputs(
    file: str, channels: dict[str, np.ndarray], time, rows
) -> tuple[np.ndarray, list[Fault]]:
    """Bridge missing inputs by straight lines; outputs during a long one are of no use.

    Where an input is lost for long (t,), and what is said of it.
    """
    faults, ever = [], np.zeros(len(time), bool)
    for column, values in channels.items():
        gone = ~np.isfinite(values)
        if group_of(column) not in INPUTS or not gone.any():
            continue
        values[gone] = np.interp(time[gone], time[~gone], values[~gone])
        lost = longer_than_bridged(gone)
        use = "a straight line bridges them"
        ever |= lost
        if lost.any():
            use += " and the outputs of the longer stretches are not used"
            for other, output in channels.items():
                if group_of(other) in OUTPUTS:
                    output[lost] = np.nan
        what = f"{gone.sum()} values of an input are missing"
        faults.append(Fault(file, column, spans(gone, rows), "missing", what, use))
    return ever, faults


def far_inputs(file: str, channels: dict[str, np.ndarray], rows: np.ndarray) -> list[Fault]:
    """One cell that is far above all others of an input; `InputError` for what no machine gives.

    A kick of one sample is possible: it is told and used.
    """
    faults = []
    for column, values in channels.items():
        size = np.nan_to_num(np.abs(values))
        if group_of(column) not in INPUTS or len(size) < 2:
            continue
        second, first = np.argpartition(size, -2)[-2:]
        value = f"{values[first]:g} {unit_of(column)}"
        if size[first] > GREATEST:
            raise InputError(
                f"{file}, column `{column}`, row {rows[first]}: {value} is more than any machine "
                f"gives ({GREATEST:g} at most)."
            )
        if size[first] > FAR * size[second] > 0:
            what = f"{value} is {size[first] / size[second]:.2g} times the largest other value"
            row = (int(rows[first]), int(rows[first]))
            faults.append(Fault(file, column, (row,), "outlier", what, "it is used as it stands"))
    return faults


def _missing(file: str, channels: dict[str, np.ndarray], rows: np.ndarray) -> list[Fault]:
    faults = []
    for column, values in channels.items():
        infinite = np.isinf(values)
        values[infinite] = np.nan
        gone = np.isnan(values)
        if not gone.any() or group_of(column) in INPUTS:
            continue
        what = f"{gone.sum()} of {len(values)} values are missing"
        if infinite.any():
            what += f" ({infinite.sum()} of them infinite)"
        use = "these samples of the channel are not used"
        if gone.all():
            what, use = "the column is empty", "the channel is not used"
        faults.append(Fault(file, column, spans(gone, rows), "missing", what, use))
    return faults


def _moving(channels: dict[str, np.ndarray], column: str) -> np.ndarray:
    """Rows at which equal values say something: not while all outputs rest, nor at the start of a
    run without noise, where several channels have not moved yet."""
    others = [
        np.diff(x, append=x[-1]) != 0
        for name, x in channels.items()
        if name != column and group_of(name) in OUTPUTS
    ]
    own = np.append(np.diff(channels[column]) != 0, True)
    if not others:
        return np.ones(len(own), bool)
    moving = np.any(others, axis=0)
    if any(not changes[:3].any() for changes in others):
        moving[: np.argmax(own) + 1] = False
    return moving


def _dead(file: str, column: str, values: np.ndarray, moving, rows) -> list[Fault]:
    good = values[np.isfinite(values)]
    if len(good) >= STUCK and np.ptp(good) == 0:
        what = f"the channel is constant at {good[0]:g}"
        values[:] = np.nan
        return [Fault(file, column, (), "constant", what, "the channel is not used")]
    faults = []
    if group_of(column) != "theta":  # a wheel at rest at its last angle is not clipped
        for bad, level in _clipped(values, moving):
            what = f"the channel is clipped at {level:g} ({bad.sum()} samples)"
            use = "these samples are not used"
            faults.append(Fault(file, column, spans(bad, rows), "clipped", what, use))
    for fault in faults:
        _forget(values, rows, fault)
    bad = _stuck(values, moving)
    if bad.any():
        what = f"the channel is stuck: {bad.sum()} equal values in a row"
        fault = Fault(file, column, spans(bad, rows), "stuck", what, "these samples are not used")
        _forget(values, rows, fault)
        faults.append(fault)
    return faults


def _forget(values: np.ndarray, rows: np.ndarray, fault: Fault) -> None:
    for a, b in fault.rows:
        values[(rows >= a) & (rows <= b)] = np.nan


def _clipped(values: np.ndarray, moving: np.ndarray) -> list[tuple[np.ndarray, float]]:
    """Extremes reached again and again, and far more often than the value next to them."""
    clipped = []
    for extreme in (np.nanmax(values), np.nanmin(values)):
        bad = (values == extreme) & moving
        longest = max((b - a + 1 for a, b in spans(bad)), default=0)
        if bad.sum() < 5 or longest < 3:
            continue
        rest = values[np.isfinite(values) & (values != extreme)]
        near = rest.max() if extreme > rest.max() else rest.min()
        if bad.sum() > 5 * np.sum(values == near):
            clipped.append((bad, float(extreme)))
    return clipped


def _stuck(values: np.ndarray, moving: np.ndarray) -> np.ndarray:
    """Long stretches of one value in a channel that else hardly ever repeats itself."""
    same = np.concatenate([[False], np.diff(values) == 0])
    bad = np.zeros(len(values), bool)
    for a, b in spans(same & moving):
        if b - a + 2 > STUCK:
            bad[a - 2 : b] = True
    coarse = np.mean(same[~bad]) > 0.05 if (~bad).any() else True
    return np.zeros_like(bad) if coarse else bad
