"""Orders of a wheel's angle that stand out in what is left of the rotation: a fine scan.

A line of order N in the torque on shaft k turns the sphere by the integral of its response times
exp(i N theta_k); a line in the current is one times the commanded torque.

What a line has in common with the rows is a Fourier sum over one and the same series for all
orders, the rows sent backwards through the response.  Between two samples the torque is the mean
of the wave over the angle in between: a line may pass half the sampling rate where the wheel is
fast.  What it changes in all is computed at some of the samples, and in full for the best.  It
counts less what the model's own numbers would take up of it: where a wheel turns little or slowly
they take up most of many a line, and a wrong order had stood above the right one.
"""

import functools
from collections.abc import Callable, Sequence

import numpy as np

from ..._orthonormal import orthonormal
from ..._settings import SETTINGS
from ..._threads import each
from .._noise import DataRows
from .._signatures import Linearisation
from .shaft_lines import (
    LAWS,
    TOGETHER,
    TorquesShown,
    axes_of,
    explained,
    factors_of,
    gains_of,
    left_beside,
    passing,
    rates_of,
    shaft_runs,
    strengths_of,
    windows_of,
)

GRID = SETTINGS.rig_orders.grid
FINER = SETTINGS.rig_orders.finer
PEAKS = SETTINGS.rig_orders.peaks
MOST_ORDERS = SETTINGS.rig_orders.most_orders
DENSE = SETTINGS.rig_orders.dense
SPARSE = SETTINGS.rig_orders.sparse
LOWEST_ORDER = SETTINGS.rig_orders.lowest_order
USUAL_SPEED = SETTINGS.rig_orders.usual_speed
FAST_SPEED = SETTINGS.rig_orders.fast_speed
THINNED = SETTINGS.rig_orders.thinned
LEAST_LEFT_THINNED = SETTINGS.rig_orders.least_left_thinned
WEIGHED = SETTINGS.rig_orders.weighed
REFINED_GAIN = SETTINGS.rig_orders.refined_gain
MOST_REFINED = SETTINGS.rig_orders.most_refined
SLOWEST_WHEEL = SETTINGS.rig_orders.slowest_wheel
FEWEST_ORDERS = SETTINGS.rig_orders.fewest_orders

Orders = dict[str, list[tuple[list[float], int]]]  # by law and wheel: orders, and of how many


def strongest_orders(
    bases: Sequence[Linearisation], rests: Sequence[np.ndarray], rows: Sequence[DataRows],
    taken: Sequence[np.ndarray] | None = None,
) -> Orders:  # fmt: skip
    """The orders of the strongest lines, and how many there were to choose from.

    `rests` are the whitened rotation rows (samples, 3 + n) left in each base's run, `taken` by run
    the directions (rows, k), orthonormal with those of the other rows, along which the model's own
    numbers have taken up all they can.  Lines are compared by what they would explain of these
    rows beside that.
    """
    taken = [np.zeros((x.size, 0)) for x in rests] if taken is None else taken
    of_wheel = functools.partial(_strongest, bases, rests, rows, taken)
    lines = each(of_wheel, range(bases[0].rig.size))
    return {law: [of[law] for of in lines] for law in LAWS}


def _strongest(bases, rests, rows, taken, k: int) -> dict[str, tuple[list[float], int]]:
    """By law the orders of wheel `k`, and of how many."""
    grid = order_grid(bases, k)
    step, out = grid[1] - grid[0], {}
    seen = shaft_runs(bases, rests, rows, taken, k)
    for law, first in zip(LAWS, estimated(bases, rests, rows, taken, k, grid), strict=True):
        some = np.array(promising(grid, first, FINER * step))
        gains_at = functools.partial(gains_of, seen, law)
        gains = gains_at(some)
        order = np.argsort(gains)[::-1]
        nearly = np.count_nonzero(gains > REFINED_GAIN * gains.max())
        picked = order[: min(max(PEAKS, nearly), MOST_REFINED)]
        fine = refined(some[picked], gains[picked], step / FINER, gains_at)
        out[law] = peaks(*fine, PEAKS, GRID * step), max(1, len(grid) // GRID)
    return out


def refined(
    orders: np.ndarray, gains: np.ndarray, step: float, gains_at: Callable[[np.ndarray], np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """The best order about each of `orders`, and its gain: of a parabola through neighbours.

    The right line may stand lower on a grid than a wrong one that lies on it.  A top is looked for
    within two steps; where a neighbour is higher, between that one's own neighbours, since a
    parabola that goes on beyond its points may miss by more than it gains.
    """
    near = np.maximum(orders[:, None] + np.array([-step, step]), LOWEST_ORDER)
    left, right = gains_at(near.ravel()).reshape(near.shape).T
    up, down = right > np.maximum(gains, left), left > np.maximum(gains, right)
    beyond = gains_at(np.maximum(orders + np.where(down, -2, 2) * step, LOWEST_ORDER))
    middle = np.maximum(orders + (up.astype(float) - down) * step, LOWEST_ORDER)
    left, gains, right = (
        np.where(up, gains, np.where(down, beyond, left)),
        np.where(up, right, np.where(down, left, gains)),
        np.where(up, beyond, np.where(down, gains, right)),
    )
    rise, bent = (right - left) / 2, left + right - 2 * gains
    hollow = bent >= 0
    way = np.where(hollow, np.sign(rise), -rise / np.where(hollow, 1.0, bent))
    way = np.clip(way, -1, 1)
    return np.maximum(middle + way * step, LOWEST_ORDER), gains + way * rise + way**2 * bent / 2


def estimated(bases, rests, rows, taken, k: int, grid: np.ndarray) -> list[np.ndarray]:
    """By law `gains_of` over an even `grid`, the sizes of lines from `THINNED` samples.

    The higher an order, the less of it the model's own numbers take up: what is left of a line
    changes slowly there, and is the same of its cosine and its sine.
    """
    right = np.zeros((len(LAWS), len(grid), 2))
    for base, rest, r in zip(bases, rests, rows, strict=True):
        right += _in_common(base, rest, r, k, grid)
    thinned = [_thinned(r, way) for r, way in zip(rows, taken, strict=True)]
    own = np.eye(taken[0].shape[1])  # of the directions with each other, all other rows as they are
    own += sum(few.T @ few - way.T @ way for few, way in zip(thinned, taken, strict=True))
    left = functools.partial(_thinly_left, bases, rows, thinned, np.linalg.cholesky(own), k)
    dense = _dense(grid)
    gains = [explained(*x) for x in zip(left(grid[:dense]), right[:, :dense], strict=True)]
    if dense == len(grid):
        return gains
    some, out = grid[dense::SPARSE], []
    far = left(some, TOGETHER // SPARSE)
    for near, size, along in zip(gains, far, right[:, dense:], strict=True):
        sizes = np.interp(grid[dense:], some, np.trace(size, axis1=1, axis2=2) / 2)
        gain = np.sum(along**2, axis=1) / np.maximum(sizes, 1e-300)
        out.append(np.concatenate([near, gain]))
    return out


def _thinly_left(
    bases, rows, thinned, root, k: int, grid: np.ndarray, together: int = TOGETHER
) -> list[np.ndarray]:
    """By law `left_beside` (orders, 2, 2) of lines over an even `grid`, from `THINNED` samples.

    `thinned` are the directions there, `root` the Cholesky factor of their inner products.  The
    mean between samples is that of the middle of orders `together`.
    """
    gram = np.zeros((len(LAWS), len(grid), 2, 2))
    inside = np.zeros((len(LAWS), len(grid), 2, len(root)))
    for base, r, few in zip(bases, rows, thinned, strict=True):
        size, part = _sizes(base, r, few, k, grid, together)
        gram, inside = gram + size, inside + part
    inside = np.swapaxes(np.linalg.solve(root, np.swapaxes(inside, -1, -2)), -1, -2)
    return [left_beside(*x, LEAST_LEFT_THINNED) for x in zip(gram, inside, strict=True)]


def _thinned(rows: DataRows, taken: np.ndarray) -> np.ndarray:
    """Directions (rotation rows, k) at `THINNED` samples, (fewer rows, k)."""
    keep = _kept(rows)
    few = taken.reshape(*rows.rotation.shape, taken.shape[1])[keep] * np.sqrt(THINNED)
    few = few.reshape(len(keep) * rows.rotation.shape[1], taken.shape[1])
    for part, q in _thinned_windows(rows, keep):
        few[part] -= q @ (q.T @ few[part])
    return few


def _kept(rows: DataRows) -> np.ndarray:
    """The samples that stand for `THINNED` ones."""
    return np.arange(THINNED - 1, rows.samples // THINNED * THINNED, THINNED)


def _sizes(base: Linearisation, rows: DataRows, taken, k: int, grid: np.ndarray, together: int):
    """Of each law's and line's cosine and sine, from `THINNED` samples: inner products (laws,
    orders, 2, 2) with each other and (.., 2, k) with the directions `taken`.

    Waves are in single precision: they tell which lines are looked at closely, no more.
    """
    h, samples = base.run.step, rows.samples // THINNED * THINNED
    strength, ways = strengths_of(base, k)
    torques = np.concatenate([f[:, None] * strength for f in factors_of(base, k)], axis=1)[:samples]
    torques = torques.reshape(-1, THINNED, torques.shape[1]).astype(np.float32)
    axes = axes_of(base)
    axes = axes if len(axes) == 1 else axes[THINNED - 1 : samples : THINNED]
    theta, passed = (x[:samples] for x in passing(base, k))
    keep = _kept(rows)
    weight = rows.rotation[keep] * np.sqrt(THINNED)
    shown = TorquesShown.of(ways, axes, (h, h * THINNED), weight, _thinned_windows(rows, keep))
    own = shown.along(taken)
    block = np.exp(1j * np.outer(np.arange(together) * (grid[1] - grid[0]), theta))
    block = block.astype(np.complex64)
    out = np.zeros((len(LAWS), len(grid), 2, 2))
    inside = np.zeros((len(LAWS), len(grid), 2, taken.shape[1]))
    for first in range(0, len(grid), together):
        part = slice(first, min(first + together, len(grid)))
        count = part.stop - first
        mean = np.sinc(grid[first + count // 2] * passed)
        wave = block[:count] * (mean * np.exp(1j * grid[first] * theta)).astype(np.complex64)
        wave = np.swapaxes(wave.reshape(count, -1, THINNED), 0, 1)
        pushed = np.split(np.swapaxes(wave @ torques, 0, 1), len(LAWS), axis=2)
        for law, one in enumerate(pushed):
            out[law, part], inside[law, part] = shown.products(one, own)
    return out, inside


def _thinned_windows(rows: DataRows, keep: np.ndarray) -> list[tuple[slice, np.ndarray]]:
    """The nuisance directions of the rotation rows at the samples `keep` alone."""
    width, out = rows.rotation.shape[1], []
    for part, q in windows_of(rows):
        begin, end = part.start // width, part.stop // width
        inside = np.flatnonzero((keep >= begin) & (keep < end))
        if len(inside):
            some = q.reshape(end - begin, width, -1)[keep[inside] - begin]
            where = slice(inside[0] * width, (inside[-1] + 1) * width)
            out.append((where, orthonormal(some.reshape(len(inside) * width, -1))))
    return out


def _in_common(base: Linearisation, rest, rows: DataRows, k: int, grid: np.ndarray) -> np.ndarray:
    """Inner products (laws, orders, 2) of `rest` with lines, cosine and sine, of an even grid."""
    h = base.run.step
    left = rest.ravel().copy()
    for part, q in windows_of(rows):
        left[part] -= q @ (left[part] @ q)
    left = left.reshape(rest.shape) * rows.rotation
    axes = axes_of(base)
    rolled = h * np.cumsum(left[::-1, 3:], axis=0)[::-1]
    every = np.broadcast_to(axes, (len(left), *axes.shape[1:]))
    turned = left[:, :3] + np.einsum("tij,ti->tj", every, rolled)
    series = h * np.cumsum(turned[::-1], axis=0)[::-1]
    series = np.sum(series * rates_of(base, k), axis=1)
    theta, passed = passing(base, k)
    block = np.exp(1j * np.outer(np.arange(TOGETHER) * (grid[1] - grid[0]), theta))
    middle = grid[np.minimum(np.arange(0, len(grid), TOGETHER) + TOGETHER // 2, len(grid) - 1)]
    begin = np.exp(1j * np.outer(theta, grid[::TOGETHER])) * np.sinc(np.outer(passed, middle))
    out = []
    for factor in factors_of(base, k):
        products = (block @ (begin * (factor * series)[:, None])).T.ravel()[: len(grid)]
        out.append(np.stack([np.real(products), np.imag(products)], axis=1))
    return np.stack(out)


def order_grid(bases: Sequence[Linearisation], k: int) -> np.ndarray:
    """Orders of wheel `k`: `LOWEST_ORDER` to half a turn of the wave a sample at a usual speed.

    Of the sparsely weighed ones, at nearly any speed: they are alike only where samples tell them.
    """
    theta = [b.motion.theta[:, k] for b in bases]  # a wave has one phase in all runs
    travel = float(max(map(np.max, theta)) - min(map(np.min, theta)))
    speed = np.abs(np.concatenate([b.motion.speed[:, k] for b in bases]))
    usual, nearly_any = np.maximum(np.quantile(speed, (USUAL_SPEED, FAST_SPEED)), SLOWEST_WHEEL)
    step = 2 * np.pi / max(travel, 2 * np.pi) / GRID
    half = np.pi / min(b.run.step for b in bases)  # what the fastest sampled run tells
    top = min(
        half / usual,
        max(LOWEST_ORDER + DENSE * step, half / nearly_any),
        LOWEST_ORDER + MOST_ORDERS * step,
    )
    return np.arange(LOWEST_ORDER, max(top, LOWEST_ORDER + FEWEST_ORDERS * step), step)


def _dense(grid: np.ndarray) -> int:
    """How many orders of a grid, the lowest ones, are weighed each."""
    return DENSE if len(grid) > DENSE + SPARSE else len(grid)


def promising(
    grid: np.ndarray, gains: np.ndarray, apart: float, count: int = WEIGHED
) -> list[float]:
    """`count` orders by estimated gains: half of them of those that are weighed sparsely, if any.

    Estimates of these are less sure: samples `THINNED` apart may take a high line for a slow one,
    of next to no size, and all of them would stand above the right line of a low order.
    """
    dense = _dense(grid)
    if dense == len(grid):
        return peaks(grid, gains, count, apart)
    parts = slice(None, dense), slice(dense, None)
    return [x for part in parts for x in peaks(grid[part], gains[part], count // 2, apart)]


def peaks(orders: np.ndarray, gains: np.ndarray, count: int, apart: float) -> list[float]:
    """The `count` best orders that lie `apart`."""
    kept: list[float] = []
    for j in np.argsort(gains)[::-1]:
        if all(abs(orders[j] - other) > apart for other in kept):
            kept.append(float(orders[j]))
        if len(kept) == count:
            break
    return kept
