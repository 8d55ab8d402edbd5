"""Columns of a size that neither gaps, nor forces, nor the columns beside them allow."""

from typing import Any

import numpy as np

from .._columns import AXES, channels
from .._recording import Recording
from .factors import FACTORS, WRONG, Wrong, pieces
from .turning import greatest_turn

FEWEST = 2  # columns that can be told apart
ORDER = 7  # of the differences that leave of a column its noise
WHITE = 0.6  # of the -7/8 by which such differences of white noise correlate
DEEP = 20.0  # times the depth of a gap that dR in its right unit is at most
PUSHED = 20.0  # times what contacts and forces can do to the platform
SHAKEN = 100.0  # m/s^2, below which no acceleration is too large
SURE = 5.0  # sigma by which the mean acceleration has to stand out
GIVEN = 6  # pieces with a force that tell it


def siblings(run: Recording, rig: Any) -> Wrong:
    """One column of a group whose noise and size are both a thousand times those of the others.

    It is wrong where the rig allows no such size, and against two others whose size it allows.  One
    that is too small needs such others: little may move along it.
    """
    for group in ("dR", "a"):
        names = _measured(run, group)
        values = [run.channels[c] for c in names]
        if len(names) < FEWEST or not all(map(_noisy, values)):
            continue
        tables = np.array([[_roughness(x), np.nanstd(x)] for x in values])
        wrong = np.sign([np.log10(_factor(run, rig, c) or 1.0) for c in names])
        for i, column in enumerate(names):
            others = np.delete(np.arange(len(names)), i)
            odd = _stands_out(tables[i] / tables[others])
            against = not wrong[others].any() and (len(others) > 1 or wrong[i] == odd)
            if odd != 0 and (against or wrong[i] == odd == 1):
                yield (column,), 10.0 ** (3 * odd)


def gap_sizes(run: Recording, rig: Any) -> Wrong:
    """Columns of dR against the depth of the gaps that the wheels rolled over."""
    if greatest_turn(run, rig) >= float(np.max(np.asarray(rig.gaps.pitch))):
        yield from _by_own_size(run, rig, "dR")


def accelerations(run: Recording, rig: Any) -> Wrong:
    """Columns of a against what contacts can do to the platform, and against the force."""
    wrong = list(_by_own_size(run, rig, "a"))
    yield from wrong or _pushed(run, rig)


def _measured(run: Recording, group: str) -> list[str]:
    return [c for c in channels(group, run.wheels) if run.measures(c)]


def _stands_out(ratios: np.ndarray) -> int:
    """1 where all ratios to other columns are far above one, -1 far below, else 0."""
    return int(np.all(ratios > WRONG)) - int(np.all(ratios < 1 / WRONG))


def _roughness(values: np.ndarray) -> float:
    """Median of the differences of a high order, in the column's unit; NaN where there are none."""
    rough = np.diff(values, ORDER)
    rough = np.abs(rough[np.isfinite(rough)])
    return float(np.median(rough)) if len(rough) else np.nan


def _noisy(values: np.ndarray) -> bool:
    """Whether the seventh differences are those of white noise: neighbours correlate by -7/8."""
    rough = np.diff(values, ORDER)
    rough = rough[np.isfinite(rough)]
    power = np.sum(rough**2)
    return bool(power > 0 and np.sum(rough[1:] * rough[:-1]) < -WHITE * power)


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.nanmean(values**2)))


def _by_own_size(run: Recording, rig: Any, group: str) -> Wrong:
    """The columns whose own size is wrong; the whole group where that of every one is.

    One that is too small is none beside others that are right: little may move along it.  One
    whose size tells nothing is in the unit of those whose noise is like its own.
    """
    names = _measured(run, group)
    own = {c: _factor(run, rig, c) for c in names}
    for factor in {f for f in own.values() if f is not None}:
        wrong = [c for c in names if own[c] == factor]
        if factor > 1:
            least = min(_roughness(run.channels[c]) for c in wrong) / np.sqrt(factor)
            wrong += [c for c in names if own[c] is None and _roughness(run.channels[c]) > least]
        if len(wrong) == len(names):
            yield channels(group, run.wheels), factor
        elif factor > 1:
            yield from (((c,), factor) for c in wrong)


def _factor(run: Recording, rig: Any, column: str) -> float | None:
    """How many times too large a column of dR or a is for the rig; None where it may be right."""
    size = _rms(run.channels[column])
    if column.startswith("a"):
        return 1e3 if size > max(PUSHED * _allowed(run, rig), SHAKEN) else None
    depth = float(np.max(np.asarray(rig.gaps.depth)))
    if depth == 0 or 1 / WRONG < size / depth < WRONG:
        return None
    return next((f for f in FACTORS["dR"].values() if 1 / WRONG < size / depth / f < DEEP), None)


def _allowed(run: Recording, rig: Any) -> float:
    """Acceleration of the platform by the force and by the contacts over their gaps, m/s^2."""
    stiff = float(np.sum(np.asarray(rig.wheels.contact.stiffness)))
    push = _rms(run.force) + stiff * float(np.max(np.asarray(rig.gaps.depth)))
    return push / float(rig.total_mass)


def _pushed(run: Recording, rig: Any) -> Wrong:
    """Columns of a and the force that do not belong to each other: all, where all that tell do.

    Where none tells alone, all are asked together.
    """
    slopes, sigma = _slopes(run, float(rig.total_mass))
    if not np.any(slopes > SURE * sigma):
        weights = sigma**-2.0
        total = max(float(np.sum(weights)), 1e-300)
        slopes, sigma = np.full(3, slopes @ weights / total), np.full(3, total**-0.5)
    sure = slopes > SURE * sigma
    small, large = sure & (slopes < 1 / WRONG), sure & (slopes > WRONG)
    if np.any(sure) and any(np.array_equal(sure, wrong) for wrong in (small, large)):
        group, factor = _misread(run, rig, channels("a", run.wheels), bool(large.any()))
        yield channels(group, run.wheels), factor
        return
    for i in np.flatnonzero(small | large):
        group, factor = _misread(run, rig, (f"a_{AXES[i]}",), bool(large[i]))
        yield (f"{group}_{AXES[i]}",), factor


def _misread(run: Recording, rig: Any, columns: tuple[str, ...], large: bool) -> tuple[str, float]:
    """Which group is in a wrong unit, and how many times too large: `a` or the force.

    `large` is whether some columns of `a` are too large for the force.
    """
    if not large:
        return "force", 1e3
    allowed = _rms(run.table(columns)) < PUSHED * _allowed(run, rig)
    return ("force", 1e-3) if allowed else ("a", 1e3)


def _slopes(run: Recording, mass: float) -> tuple[np.ndarray, np.ndarray]:
    """By axis M_T times the mean acceleration over the force, and its 1-sigma, in pieces' means."""
    stride = pieces(run)
    count = len(run) // stride
    slopes, sigma = np.ones(3), np.full(3, np.inf)
    pushed, moved = (
        x[: count * stride].reshape(count, stride, 3).mean(axis=1)
        for x in (run.force, mass * run.group("a"))
    )
    for i in range(3):
        good = np.isfinite(moved[:, i]) & (np.abs(pushed[:, i]) > 0)
        if good.sum() >= GIVEN:
            force, answer = pushed[good, i], moved[good, i]
            slopes[i] = force @ answer / (force @ force)
            sigma[i] = np.std(answer - slopes[i] * force) / np.sqrt(force @ force)
    return slopes, sigma
