"""Numbers in which a prediction is wavy: scanned over their range, where no tangent leads.

The number of a wave (so many periods a turn, so many a second) moves its phase by as much as the
angle or the time is long: a tangent tells a radian of that, and beside the right number lie many
wrong ones with a misfit that is least there.  What several such numbers change adds up, as the
prediction is linear in shapes and forces: each is scanned alone, and their best values are sought
together, all other numbers free to first order.
"""

import itertools
from collections.abc import Iterator, Sequence

import numpy as np

from .._settings import SETTINGS
from .fit import tangents_at
from .model import AbstractModel, Point, unit_bounds
from .scan import taken_up

WAVY_RATIO = SETTINGS.waves.wavy_ratio
FINEST_STEP = SETTINGS.waves.finest_step
SECOND_STEP = SETTINGS.waves.second_step
FAR = 1e15  # sigma; sums of its squares are numbers in single precision still
STARTS = SETTINGS.waves.starts
SEED = 21
TOLD = 16  # values after which the progress line goes on
TOGETHER = 8  # points that are evaluated at once: what a run foretells takes room


def scanned(model: AbstractModel, point: Point) -> Point | None:
    """A start for a refit, with waves' numbers near their best; None where no number is wavy."""
    (known,) = scanned_beside(model, [point], "train") or [None]
    return known


def scanned_beside(model: AbstractModel, points: Sequence[Point], split: str) -> list[Point]:
    """`scanned` of points that differ in their effects alone, at once; none where none is wavy.

    Points that differ in sensors' laws alone share the predicted runs.  The table is in float32: it
    has a row for each value of each number.
    """
    first, all_here = points[0], model.residuals(points, split)
    steps = _steps(model, first, all_here[0], split)
    ladders = {k: _ladder(model, first, k, step) for k, step in steps.items()}
    ladders = {k: u for k, u in ladders.items() if len(u) > 1}
    model.wavy = bool(ladders)
    if not ladders:
        return []
    P = len(first.u)
    others = [k for k in range(P) if k not in ladders]
    ways = []
    for point in points:
        J = tangents_at(model, point, split)
        ways.append(taken_up(J[:, [*others, *range(P, J.shape[1])]], len(others)))

    def beside(way: np.ndarray, rows: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Rows with the other numbers' priors at `u`, less what these take up along `way`."""
        whole = np.concatenate([rows, u[others]])
        return (whole - way @ (way.T @ whole)).astype(np.float32)

    rests = [beside(way, here, first.u) for here, way in zip(all_here, ways, strict=True)]
    count = sum(map(len, ladders.values()))
    tables = [np.empty((count, len(rest)), np.float32) for rest in rests]
    changes = (
        change
        for k, values in ladders.items()
        for change in _changes(model, points, k, values, all_here, split)
    )
    for j, change in enumerate(changes):
        if j % TOLD == 0:
            model.tell(f"{j} of {count} values of numbers that waves hang on")
        for table, way, rows in zip(tables, ways, change, strict=True):
            table[j] = beside(way, rows, 0 * first.u)
    scans = []
    for point, rest, table in zip(points, rests, tables, strict=True):
        best = first.u.copy()
        best[list(ladders)] = _together(rest, table, list(ladders.values()))
        scans.append(Point(best, point.effects))
    return scans


def _steps(model: AbstractModel, point: Point, here: np.ndarray, split: str) -> dict[int, float]:
    """By wavy number the step in sigma over which a tangent still tells its change.

    And over `SECOND_STEP` of it: a step of whole waves changes as little as a small one.
    """
    wavy = {k: 1.0 for k, p in enumerate(model.priors) if not p.limited}
    out: dict[int, float] = {}
    while wavy:
        for k, step in list(wavy.items()):
            if step <= FINEST_STEP or (
                _straight(model, point, k, step, here, split)
                and _straight(model, point, k, SECOND_STEP * step, here, split)
            ):
                del wavy[k]
                if step < 1:
                    out[k] = step
            else:
                wavy[k] = step / 2
    return out


def _straight(
    model: AbstractModel, point: Point, k: int, step: float, here: np.ndarray, split: str
) -> bool:
    """Whether equal steps up and down of number `k` make opposite changes, as a tangent's do."""
    values = point.u[k] + np.array([step, -step])
    (up,), (down,) = _changes(model, [point], k, values, [here], split)
    return bool(np.linalg.norm(up + down) < WAVY_RATIO * np.linalg.norm(up - down))


def _ladder(model: AbstractModel, point: Point, k: int, step: float) -> np.ndarray:
    """The values of a number over its range, the point's own among them."""
    least, most = (float(x[0]) for x in unit_bounds([model.priors[k]]))
    low, high = np.ceil((least - point.u[k]) / step), np.floor((most - point.u[k]) / step)
    return point.u[k] + step * np.arange(low, high + 1)


def _changes(
    model: AbstractModel, points: Sequence[Point], k: int, values: np.ndarray,
    here: Sequence[np.ndarray], split: str,
) -> Iterator[list[np.ndarray]]:  # fmt: skip
    """Value by value of number `k`: what it changes of the points' residuals `here`, up to `FAR`.

    A prediction may run away there; then it is far from every record, and its size is irrelevant.
    """
    together = max(1, TOGETHER // len(points))
    for first in range(0, len(values), together):
        some = np.tile(points[0].u, (len(values[first : first + together]), 1))
        some[:, k] = values[first : first + together]
        rows = model.residuals([Point(u, p.effects) for u in some for p in points], split)
        for j in range(0, len(rows), len(points)):
            with np.errstate(over="ignore", invalid="ignore"):
                yield [np.clip(np.nan_to_num(r - x, nan=FAR), -FAR, FAR)
                       for r, x in zip(rows[j:], here, strict=False)]  # fmt: skip


def _together(rest: np.ndarray, table: np.ndarray, ladders: Sequence[np.ndarray]):
    """The ladders' values at which |rest + sum of changes|^2 and the priors' part are least.

    From `STARTS` drawn ones on number after number is moved to its best until none moves.
    """
    gram, right = (x.astype(float) for x in (table @ table.T, table @ rest))
    ends = np.cumsum([0, *map(len, ladders)])
    own = np.diag(gram) + 2 * right + np.concatenate(ladders) ** 2
    rng, best, least = np.random.default_rng(SEED), np.zeros(len(ladders), int), np.inf
    for turn in range(STARTS):
        at = rng.integers(0, np.diff(ends)) if turn else _nearest(own, ends)
        moved = True
        while moved:
            before = at.copy()
            for j in range(len(at)):
                others = np.delete(ends[:-1] + at, j)
                part = slice(ends[j], ends[j + 1])
                at[j] = np.argmin(own[part] + 2 * gram[part, others].sum(axis=1))
            moved = bool(np.any(at != before))
        rows = ends[:-1] + at
        inner = gram[np.ix_(rows, rows)]
        cost = own[rows].sum() + inner.sum() - np.trace(inner)
        if cost < least:
            best, least = at.copy(), cost
    return np.array([u[k] for u, k in zip(ladders, best, strict=True)])


def _nearest(own: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """By ladder the value that is best alone."""
    return np.array([np.argmin(own[a:b]) for a, b in itertools.pairwise(ends)])
