"""What a torque on one wheel's shaft shows in the rotation of every run: lines of its angle.

A torque on one shaft turns the sphere about nearly the same axis all the time: the sums over time
are of that one number a sample, and what the rows hold follows from it.  So do all inner products:
the rows themselves, several times as many, are never made.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag

from ..._settings import SETTINGS
from .._noise import DataRows
from .._signatures import THIN, Linearisation
from ..runs import FINE

LEAST_LEFT = SETTINGS.rig_orders.least_left
MAIN_DIRECTION = SETTINGS.rig_orders.main_direction
TOGETHER = 64  # lines computed at a time
LAWS = ("motor-ripple", "current-ripple")


class ShaftRun(NamedTuple):
    """A run under torques on one shaft: how they show, and what is left and taken up of that."""

    angle: np.ndarray  # (samples,) rad, and turns a sample: `passing`
    passed: np.ndarray
    pushes: dict[str, np.ndarray]  # by law accelerations (samples, m) by a unit line
    shown: "TorquesShown"
    along: np.ndarray  # (sums, 1 + k) of what is left, and of the directions taken up

    def pushed(self, law: str, orders: np.ndarray) -> np.ndarray:
        """Accelerations (orders, samples, m) along the directions by lines of a law."""
        wave = np.exp(1j * orders[:, None] * self.angle) * np.sinc(orders[:, None] * self.passed)
        return wave[:, :, None] * self.pushes[law]


def shaft_runs(bases, rests, rows, taken, k: int) -> list[ShaftRun]:
    """What torques on the shaft of wheel `k` show in every base's run."""
    out = []
    for base, rest, r, own in zip(bases, rests, rows, taken, strict=True):
        h, (strength, ways) = base.run.step, strengths_of(base, k)
        shown = TorquesShown.of(ways, axes_of(base), (h, h), r.rotation, windows_of(r))
        pushes = [factor[:, None] * strength for factor in factors_of(base, k)]
        along = shown.along(np.concatenate([rest.reshape(-1, 1), own], axis=1))
        angle, passed = passing(base, k)
        out.append(ShaftRun(angle, passed, dict(zip(LAWS, pushes, strict=True)), shown, along))
    return out


def gains_of(seen: Sequence[ShaftRun], law: str, orders: np.ndarray) -> np.ndarray:
    """Fall of chi-square by a line of each order (orders,), its cosine and sine free.

    Or by each set of lines (sets, lines).
    """
    gram, right, inside = products(seen, law, orders)
    return explained(left_beside(gram, inside), right)


def sizes_of(seen: Sequence[ShaftRun], law: str, orders: np.ndarray) -> np.ndarray:
    """Sizes (sets, 2 lines) of the cosine and the sine of every line of a set that fit best."""
    gram, right, inside = products(seen, law, orders)
    return np.linalg.solve(left_beside(gram, inside), right[:, :, None])[:, :, 0]


def left_beside(gram, inside, least: float = LEAST_LEFT) -> np.ndarray:
    """What is left of gram (sets, c, c) beside `inside` (sets, c, k); `least` of it always."""
    size = np.trace(gram, axis1=1, axis2=2)[:, None, None]
    left = (1 + least) * gram - inside @ np.swapaxes(inside, 1, 2)
    return left + (1e-9 * size + 1e-300) * np.eye(gram.shape[1])


def explained(left, right) -> np.ndarray:
    """right . left^-1 . right of every set, `left` (sets, c, c) and `right` (sets, c)."""
    return np.einsum("na,na->n", right, np.linalg.solve(left, right[:, :, None])[:, :, 0])


def products(seen: Sequence[ShaftRun], law: str, orders: np.ndarray):
    """Inner products of the c = 2 lines columns of every set of lines (sets, lines), the cosine and
    the sine of each: (sets, c, c); with the rests (sets, c); with the directions taken (.., c, k).
    Orders (sets,) are sets of one line."""
    sets = np.reshape(orders, (len(orders), -1))
    count, lines = sets.shape
    gram, right = np.zeros((count, 2 * lines, 2 * lines)), np.zeros((count, 2 * lines))
    inside = np.zeros((count, 2 * lines, seen[0].along.shape[1] - 1))
    few = max(1, TOGETHER // lines)
    for x in seen:
        for first in range(0, count, few):
            part = slice(first, first + few)
            pushed = x.pushed(law, sets[part].ravel())
            size, along = x.shown.products(pushed, x.along, lines)
            gram[part] += size
            right[part] += along[..., 0]
            inside[part] += along[..., 1:]
    return gram, right, inside


def axes_of(base: Linearisation) -> np.ndarray:
    """Axes about which the sphere turns, (samples or 1, n, 3)."""
    axes = base.response.axes
    return axes if len(axes) == 1 else axes[:: FINE // THIN]


def rates_of(base: Linearisation, k: int) -> np.ndarray:
    """Acceleration (samples, 3) of the sphere by a torque on shaft `k`, rad/s^2 a N m."""
    return base.response.rates[:: FINE // THIN, k]


def strengths_of(base: Linearisation, k: int) -> tuple[np.ndarray, np.ndarray]:
    """`rates_of` as strengths (samples, m) along m directions (m, 3), without what is next to none.

    About fixed axes one direction holds all but some 1e-6 of them.
    """
    left, sizes, ways = np.linalg.svd(rates_of(base, k), full_matrices=False)
    m = np.count_nonzero(sizes > MAIN_DIRECTION * sizes[0])
    return left[:, :m] * sizes[:m], ways[:m]


def factors_of(base: Linearisation, k: int) -> list[np.ndarray]:
    """By law what a line is multiplied by before every sample."""
    torque = before_each(base.torque[:, k])
    return [torque if law == "current-ripple" else np.ones_like(torque) for law in LAWS]


def passing(base: Linearisation, k: int) -> tuple[np.ndarray, np.ndarray]:
    """(angle (samples,) rad of wheel `k` half a sample before each one, turns a sample there).

    The mean of exp(i N theta) over the time between two samples is that of its middle times
    sinc(N turns).
    """
    return before_each(base.motion.theta[:, k]), (
        before_each(base.motion.speed[:, k]) * base.run.step / (2 * np.pi)
    )


def before_each(values: np.ndarray) -> np.ndarray:
    """Values (FINE points,) half a sample before each sample; the first as it is."""
    return np.concatenate([values[:1], values[FINE // 2 :: FINE]])


class TorquesShown(NamedTuple):
    """How torques along some directions show in the whitened Omega and rolled lengths of a run.

    Every entry of a row is a sum of few numbers of its sample, times weights: of the sphere's speed
    along each direction, and of their rolled lengths (about axes that move, of the wheels').  These
    numbers by sample are the sums of a torque.
    """

    ways: np.ndarray  # (m, 3) directions
    axes: np.ndarray  # (1 or t, n, 3)
    steps: tuple[float, float]  # s, between the sums of accelerations over samples, and of the rows
    weights: np.ndarray  # (a, t, 3 + n)
    squares: np.ndarray  # (a, a, t), sums of products of the weights
    # nuisance directions: samples, products with the weights (a, samples, k), among the rows
    windows: list[tuple[slice, np.ndarray, slice, np.ndarray]]

    @staticmethod
    def of(ways, axes, steps: tuple[float, float], weight: np.ndarray,
           windows: Sequence[tuple[slice, np.ndarray]]) -> "TorquesShown":  # fmt: skip
        """From the rows' `weight` (t, 3 + n) and their nuisance directions."""
        lever = ways @ axes[0].T if len(axes) == 1 else np.eye(axes.shape[1])
        weights = block_diag(ways, lever)[:, None] * weight
        squares = np.einsum("atc,btc->abt", weights, weights)
        width, parts = weight.shape[1], []
        for part, q in windows:
            at = slice(part.start // width, part.stop // width)
            of_rows = q.reshape(at.stop - at.start, width, -1)
            parts.append((at, np.einsum("atc,tck->atk", weights[:, at], of_rows), part, q))
        return TorquesShown(ways, axes, steps, weights, squares, parts)

    def along(self, rows: np.ndarray) -> np.ndarray:
        """What makes inner products with rows (t (3 + n), k) of sums: (a t, k)."""
        rows = np.array(rows)
        for *_, part, q in self.windows:
            rows[part] -= q @ (q.T @ rows[part])
        rows = rows.reshape(*self.weights.shape[1:], rows.shape[1])
        out = np.einsum("atc,tck->atk", self.weights, rows, optimize=True)
        return out.reshape(out.shape[0] * out.shape[1], out.shape[2])

    def sums(self, pushed: np.ndarray) -> np.ndarray:
        """Sums (2 orders, a, t) of the cosine and the sine of each line.

        `pushed` (orders, t, m) holds sums of accelerations along the directions over samples.
        """
        h, step = self.steps
        orders, t, m = pushed.shape
        both = np.stack([np.real(pushed), np.imag(pushed)], axis=1).reshape(2 * orders, t, m)
        turned = h * np.cumsum(np.swapaxes(both, 1, 2), axis=2, dtype=float)
        rates = turned
        if len(self.axes) > 1:
            rates = np.einsum("tij,mj,nmt->nit", self.axes, self.ways, turned, optimize=True)
        return np.concatenate([turned, step * np.cumsum(rates, axis=2)], axis=1)

    def products(
        self, pushed: np.ndarray, along: np.ndarray, lines: int = 1
    ) -> tuple[np.ndarray, np.ndarray]:
        """Inner products of the c = 2 lines columns of every set of so many `lines`, one after the
        other in `pushed`: (sets, c, c), and (sets, c, k) with the rows whose `along` (a t, k) is
        given."""
        sums, columns = self.sums(pushed), 2 * lines
        count, (_, a, t) = len(pushed) // lines, sums.shape
        weighed = np.zeros_like(sums)
        for i, j in zip(*np.nonzero(self.squares.any(axis=2)), strict=True):
            weighed[:, i] += sums[:, j] * self.squares[i, j]
        flat = sums.reshape(columns * count, a * t)
        each = flat.reshape(count, columns, a * t)
        gram = weighed.reshape(count, columns, a * t) @ np.swapaxes(each, 1, 2)
        for at, q, *_ in self.windows:
            own = sum(sums[:, i, at] @ q[i] for i in range(a))
            own = np.reshape(own, (count, columns, q.shape[2]))
            gram -= own @ np.swapaxes(own, 1, 2)
        return gram, (flat @ along).reshape(count, columns, along.shape[1])


def windows_of(rows: DataRows) -> list[tuple[slice, np.ndarray]]:
    """The nuisance directions of the rotation rows, and where they stand among these alone."""
    first = rows.elastic.size
    return [
        (slice(part.start - first, part.stop - first), q)
        for part, q in rows.nuisance if part.start >= first
    ]  # fmt: skip
