"""Lines of one law on one shaft that are chosen together, and all that the runs tell as well.

Lines of a wheel that turns little look alike: one line between two may stand above either, and no
second line beside it leads to these; and of one line dozens of orders may explain the fitted runs
as well.  So sets of lines are compared, each with its best orders, by inner products alone.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..._settings import SETTINGS
from .orders import peaks, refined
from .shaft_lines import ShaftRun, gains_of, left_beside, products, sizes_of

ALIKE = SETTINGS.line_sets.alike
WORDS = SETTINGS.line_sets.words
BEAM = SETTINGS.line_sets.beam
ROUGH = SETTINGS.line_sets.rough
BEST = SETTINGS.line_sets.best
PARTNERS = SETTINGS.line_sets.partners
NEWTON = SETTINGS.line_sets.newton
APART = SETTINGS.line_sets.apart


class LineSet(NamedTuple):
    """Orders (lines,), and sizes (lines, 2) of the cosine and the sine of each."""

    orders: np.ndarray
    sizes: np.ndarray


def line_sets(
    fitted: Sequence[ShaftRun], judging: Sequence[ShaftRun], law: str, grid: np.ndarray,
    step: float, known: Sequence[float], more: int, margin: float,
) -> list[LineSet]:  # fmt: skip
    """Sets of the `known` lines' number and so many `more` that explain the `fitted` runs best.

    All within a `margin` of chi-square; first the one that explains these and the `judging` runs
    best.  Sizes are those that the fitted runs tell.  `grid` holds the orders that are looked at,
    `step` is a quarter of the resolution of the travel.
    """
    alone = gains_of(fitted, law, grid)
    if len(known) + more > 1:
        words = _words(fitted, law, grid, alone, known, step)
        sets = _grown(fitted, law, words, len(known), more, APART * step)
    else:
        sets = np.array(peaks(grid, alone, ALIKE, step))[:, None]
    sets, gains = _refined(fitted, law, sets, step / 2)
    sets = _unlike(sets[np.argsort(gains)[::-1]], APART * step)
    best = gains.max()
    sets = sets[gains_of(fitted, law, sets) > best - margin]
    both = [*fitted, *(_beside_nothing(x, fitted[0]) for x in judging)]
    shifted, gains = _refined(both, law, sets, step / 2)
    still = gains_of(fitted, law, shifted) > best - 2 * margin
    starts = np.where(still[:, None], shifted, sets)
    gains = np.where(still, gains, gains_of(both, law, sets))
    order = np.argsort(gains)[::-1]
    sizes = sizes_of(fitted, law, starts).reshape(*starts.shape, 2)
    return [LineSet(starts[j], sizes[j]) for j in order]


def _beside_nothing(run: ShaftRun, like: ShaftRun) -> ShaftRun:
    """A run of which no number takes up anything: they are told by the fitted runs alone."""
    none = np.zeros((len(run.along), like.along.shape[1] - 1))
    return run._replace(along=np.concatenate([run.along[:, :1], none], axis=1))


def _words(fitted, law: str, grid, alone, known: Sequence[float], step: float) -> np.ndarray:
    """Orders of which sets are made: `known` ones, and every second one of the grid.

    Of more than `WORDS` the best alone, and the best beside the known ones.
    """
    if len(grid) <= 2 * WORDS:
        return np.concatenate([known, grid[::2]])
    beside = np.column_stack([grid, np.broadcast_to(known, (len(grid), len(known)))])
    near = np.any(np.abs(grid[:, None] - np.asarray(known)) < APART * step, axis=1)
    further = np.where(near, 0.0, gains_of(fitted, law, beside))
    some = [x for gains in (alone, further) for x in peaks(grid, gains, WORDS // 4, step)]
    return np.concatenate([known, np.unique(some)])


def _grown(fitted, law: str, words: np.ndarray, known: int, more: int, apart: float) -> np.ndarray:
    """The best sets (sets, lines) of `more` lines than the first words, so many of them `known`.

    The best single lines, and the known ones, are made larger line by line; the best sets are kept.
    """
    gram, right, inside = products(fitted, law, words[None])
    left, right = left_beside(gram, inside)[0], right[0]
    first = sorted(range(len(words)), key=lambda j: -_gain(left, right, (j,)))
    beam = [(j,) for j in first[:BEAM]]
    for size in range(1, known + more):
        if size == known:
            beam = [*beam, tuple(range(known))]
        larger: dict[tuple[int, ...], float] = {}
        for some in beam:
            gains = _beside(left, right, some)
            far = np.min(np.abs(words[:, None] - words[list(some)]), axis=1) >= apart
            gains = np.where(far, gains, -np.inf)
            for j in np.argsort(gains)[::-1][:PARTNERS]:
                if np.isfinite(gains[j]):
                    larger[tuple(sorted((*some, int(j))))] = float(gains[j])
        kept = ROUGH if size == known + more - 1 else BEAM
        beam = sorted(larger, key=lambda s: -larger[s])[:kept]
    return words[np.array(beam)]


def _columns(words: Sequence[int]) -> np.ndarray:
    """The columns of words: cosine and sine of each."""
    return np.concatenate([[2 * j, 2 * j + 1] for j in words])


def _gain(left: np.ndarray, right: np.ndarray, words: Sequence[int]) -> float:
    """Fall of chi-square by the lines of some words."""
    at = _columns(words)
    return float(right[at] @ np.linalg.solve(left[np.ix_(at, at)], right[at]))


def _beside(left: np.ndarray, right: np.ndarray, words: Sequence[int]) -> np.ndarray:
    """By word the fall of chi-square by its line and those of some `words` together."""
    at = _columns(words)
    taken = np.linalg.solve(left[np.ix_(at, at)], left[at])
    rest = (right - right[at] @ taken).reshape(-1, 2)
    pairs = np.arange(len(right)).reshape(-1, 2)
    own = left[pairs[:, :, None], pairs[:, None, :]]
    own = own - np.einsum("kna,knb->nab", left[at].reshape(len(at), -1, 2),
                          taken.reshape(len(at), -1, 2))  # fmt: skip
    own += 1e-9 * np.trace(own, axis1=1, axis2=2)[:, None, None] * np.eye(2)
    own[list(words)] = np.eye(2)
    more = np.einsum("na,na->n", rest, np.linalg.solve(own, rest[:, :, None])[:, :, 0])
    return _gain(left, right, words) + more


def _refined(seen, law: str, sets: np.ndarray, step: float) -> tuple[np.ndarray, np.ndarray]:
    """The best `BEST` sets with every order moved to its best beside the others, and their gains.

    One after the other first, and then all together, as those of near lines hang on each other.
    """
    sets = sets.copy()
    gains = gains_of(seen, law, sets)
    for line in range(sets.shape[1]):

        def at(orders: np.ndarray, line: int = line) -> np.ndarray:
            moved = np.repeat(sets, len(orders) // len(sets), axis=0)
            moved[:, line] = orders
            return gains_of(seen, law, moved)

        moved, _ = refined(sets[:, line], gains, step, at)
        new = at(moved)
        sets[:, line] = np.where(new > gains, moved, sets[:, line])
        gains = np.maximum(new, gains)
    best = np.argsort(gains)[::-1][:BEST]
    sets, gains = sets[best], gains[best]
    for k in range(NEWTON):
        sets, gains = _all_moved(seen, law, sets, gains, step / 2**k)
    return sets, gains


def _all_moved(
    seen, law: str, sets: np.ndarray, gains: np.ndarray, step: float
) -> tuple[np.ndarray, np.ndarray]:
    """Sets after a Newton step of all orders, where it gains; slopes are differences of a step."""
    count, lines = sets.shape
    units = step * np.eye(lines)
    pairs = [(i, j) for i in range(lines) for j in range(i)]
    both = [units[i] + units[j] for i, j in pairs]
    ways = np.array([*units, *-units, *both, *(-x for x in both)])
    around = gains_of(seen, law, (sets[:, None] + ways).reshape(-1, lines)).reshape(count, -1)
    up, down, rest = np.split(around, [lines, 2 * lines], axis=1)
    slope, bent = (up - down) / 2, np.zeros((count, lines, lines))
    bent[:, range(lines), range(lines)] = up + down - 2 * gains[:, None]
    for k, (i, j) in enumerate(pairs):
        cross = rest[:, k] + rest[:, len(both) + k] - 2 * gains
        cross = (cross - bent[:, i, i] - bent[:, j, j]) / 2
        bent[:, i, j] = bent[:, j, i] = cross
    values, vectors = np.linalg.eigh(bent)
    along = np.einsum("nij,ni->nj", vectors, slope) / np.maximum(np.abs(values), 1e-300)
    moved = sets + step * np.clip(np.einsum("nij,nj->ni", vectors, along), -2, 2)
    new = gains_of(seen, law, moved)
    better = new > gains
    return np.where(better[:, None], moved, sets), np.where(better, new, gains)


def _unlike(sets: np.ndarray, apart: float) -> np.ndarray:
    """Sets, the best first, less those that have every line of a better one."""
    kept: list[np.ndarray] = []
    for some in np.sort(sets, axis=1):
        if all(np.any(np.abs(some - other) > apart) for other in kept):
            kept.append(some)
    return np.array(kept)
