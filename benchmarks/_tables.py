"""The rigs of `_general` with a measured profile on every wheel, in numpy alone: closed form.

Each profile is a periodic cubic spline over a turn.  On a piece a pole lambda follows rho by
-sum_j rho^(j)/lambda^(j + 1) beside a free part: poles are fast beside the pieces here, so that
nothing cancels.
"""

import functools

import numpy as np
from scipy.interpolate import CubicSpline

from . import _general
from . import _problem as problem

KNOTS = 48  # a turn
SIZE = 2e-4  # m
TURN = 2 * np.pi
POINTS = 40_000  # a period
PIECE = np.arange(4)


@functools.cache
def measured(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Angles (k,) and readings (n, k) of `count` wheels, 0 at the start."""
    angle, order = TURN * np.arange(KNOTS) / KNOTS, np.arange(1, 9)
    share = np.sin(1.0 + 2.3 * np.arange(count)[:, None] * order) / order
    return angle, SIZE * share @ np.sin(order[:, None] * angle)


@functools.cache
def splines(count: int) -> list[CubicSpline]:
    """rho (m) over the angle."""
    angle, reading = measured(count)
    knots = np.append(angle, TURN)
    return [CubicSpline(knots, np.append(x, x[0]), bc_type="periodic") for x in reading]


class Wheel:
    """What the poles (k,) of a rig do while one wheel passes its spline."""

    def __init__(self, spline: CubicSpline, speed: float, pole: np.ndarray):
        # rho's derivatives by time as pieces begin, (4, pieces)
        self.rho = spline.c[::-1] * (np.array([1, 1, 2, 6]) * speed**PIECE)[:, None]
        self.begin, self.pole = spline.x[:-1] / speed, pole
        self.period, self.length = TURN / speed, np.diff(spline.x) / speed

    def forced(self, piece, since) -> np.ndarray:
        """The part (k, t) that goes with the cubic."""
        a, b, c, d = self.rho[:, piece]
        each = [
            a + since * (b + since * (c / 2 + since * d / 6)),
            b + since * (c + since * d / 2),
            c + since * d,
            d + 0 * since,
        ]
        terms = [x / self.pole[:, None] ** (j + 1) for j, x in enumerate(each)]
        return -np.sum(terms, axis=0)

    def states(self, first: np.ndarray, count: int) -> np.ndarray:
        """z (k, count + 1) as pieces begin, from the first one on."""
        z = [first]
        for i in range(count):
            piece = np.array([i % len(self.begin)])
            free = z[-1] - self.forced(piece, np.zeros(1))[:, 0]
            length = self.length[piece]
            z.append(self.forced(piece, length)[:, 0] + free * np.exp(self.pole * length))
        return np.array(z).T

    def periodic(self) -> np.ndarray:
        """z at the start that comes back after a turn."""
        end = self.states(np.zeros(len(self.pole), complex), len(self.begin))[:, -1]
        return end / (1 - np.exp(self.pole * self.period))

    def response(self, first: np.ndarray, time: np.ndarray) -> np.ndarray:
        """z (k, t) at times (s) that grow, from `first` at the start."""
        turns, since = np.divmod(time, self.period)
        piece = np.minimum(np.searchsorted(self.begin, since, side="right"), len(self.begin)) - 1
        since = since - self.begin[piece]
        number = (turns * len(self.begin)).astype(int) + piece
        z = self.states(first, int(number.max()))[:, number]
        free = z - self.forced(piece, 0 * since)
        return self.forced(piece, since) + free * np.exp(self.pole[:, None] * since)


def _wheels(count: int, row):
    """Each wheel, and what dR (3, k) shows of its poles."""
    (pole,), (show,), (give,) = (x for x in _general.modes(count, np.asarray(row)[None]))
    for i, (spline, speed) in enumerate(zip(splines(count), _general.SPEEDS[:count], strict=True)):
        yield Wheel(spline, speed, pole), show * give[:, i]


def response(count: int, row, time) -> np.ndarray:
    """dR (3, t) from rest."""
    none = np.zeros(2 * (3 + count), complex)
    each = [(show @ wheel.response(none, time)).real for wheel, show in _wheels(count, row)]
    return np.sum(each, axis=0)


def figures(count: int, rows) -> np.ndarray:
    """RMS and peak of |dR| over the samples of a run from rest."""
    return np.array([problem.figures(response(count, row, _general.TIMES)) for row in rows])


def periods(count: int, row) -> list[np.ndarray]:
    """dR (3, `POINTS`) that each wheel alone makes in the long run, over its turn."""
    each = []
    for wheel, show in _wheels(count, row):
        time = wheel.period * np.arange(POINTS) / POINTS
        each.append((show @ wheel.response(wheel.periodic(), time)).real)
    return each


def long_run(each: list[np.ndarray], starts: int = 200) -> np.ndarray:
    """RMS and supremum of |dR| where each wheel's part (3, t) has a phase of its own.

    The longest sum is the one furthest along its own direction: from directions all around to the
    sum that is furthest there, and on along that.
    """
    mean = np.sum([x.mean(1) for x in each], axis=0)
    square = mean @ mean + sum(x.var(1).sum() for x in each)
    top = 0.0
    for direction in _general.directions(starts):
        d, before = direction, -1.0
        while True:
            total = np.sum([x[:, np.argmax(d @ x)] for x in each], axis=0)
            size = float(np.linalg.norm(total))
            if size <= before * (1 + 1e-14):
                break
            before, d = size, total / size
        top = max(top, before)
    return np.array([np.sqrt(square), top])
