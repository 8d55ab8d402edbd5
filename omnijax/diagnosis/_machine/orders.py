"""Orders of a wheel's angle that stand out in what is left of the rotation: a fine scan.

A line of order N in the torque on shaft k turns the sphere by the integral of its response times
exp(i N theta_k); a line in the current is one times the commanded torque.
"""

from collections.abc import Sequence

import numpy as np

from .data_vector import Rows
from .linearisation import THIN, Base
from .runs import FINE

GRID = 4  # orders tried within one resolution of the travel: at most 4 % of a line lost between
CLOSER = 2  # times as many about the best
PEAKS = 3
MOST = 1200  # orders of a wheel
LOWEST = 1.0  # windows take off what is slower
FAST = 0.9  # quantile of the speed at which lines may not alias
TOGETHER = 64  # orders computed at a time
LAWS = ("motor-ripple", "current-ripple")

Orders = dict[str, list[tuple[list[float], int]]]  # by law and wheel: orders, and of how many


def strongest_orders(
    bases: Sequence[Base], rests: Sequence[np.ndarray], rows: Sequence[Rows]
) -> Orders:
    """The orders of the strongest lines, and how many there were to choose from.

    `rests` are the whitened rotation rows (samples, 3 + n) left in each base's run.  Lines are
    compared by what they would explain of these rows alone.
    """
    out: Orders = {law: [] for law in LAWS}
    for k in range(bases[0].rig.size):
        grid = _grid(bases, k)
        for law, found in out.items():
            gains = _gains(bases, rests, rows, law, k, grid)
            step = grid[1] - grid[0]
            closer = np.arange(-CLOSER, CLOSER + 1) * step / CLOSER
            best = []
            for n in _peaks(grid, gains):
                near = np.maximum(n + closer, LOWEST)
                best.append(float(near[np.argmax(_gains(bases, rests, rows, law, k, near))]))
            found.append((best, max(1, len(grid) // GRID)))
    return out


def _gains(bases, rests, rows, law: str, k: int, orders: np.ndarray) -> np.ndarray:
    """Fall of chi-square by a line of each order, its cosine and sine free."""
    gram, right = np.zeros((len(orders), 2, 2)), np.zeros((len(orders), 2))
    for base, rest, r in zip(bases, rests, rows, strict=True):
        for first in range(0, len(orders), TOGETHER):
            part = slice(first, first + TOGETHER)
            waves = _waves(base, r, law, k, orders[part])
            gram[part] += np.einsum("nar,nbr->nab", waves, waves)
            right[part] += waves @ rest.ravel()
    gram += 1e-9 * np.trace(gram, axis1=1, axis2=2)[:, None, None] * np.eye(2) + 1e-300 * np.eye(2)
    return np.einsum("na,na->n", right, np.linalg.solve(gram, right[:, :, None])[:, :, 0])


def _waves(base: Base, rows: Rows, law: str, k: int, orders: np.ndarray) -> np.ndarray:
    """Whitened rotation rows (orders, 2, ..) of cosine and sine in the torque of wheel `k`."""
    h, parts, axes = base.run.step, FINE // THIN, base.response.axes
    axes = axes if len(axes) == 1 else axes[::parts]
    wave = np.exp(1j * orders[:, None] * base.motion.theta[::FINE, k])
    if law == "current-ripple":
        wave = wave * base.torque[::FINE, k]
    turned = h * np.cumsum(wave[:, :, None] * base.response.rates[::parts, k], axis=1)
    fixed = len(axes) == 1
    rolled = turned @ axes[0].T if fixed else np.einsum("tij,ntj->nti", axes, turned)
    table = np.concatenate([turned, h * np.cumsum(rolled, axis=1)], axis=2) * rows.rotation
    flat = table.reshape(len(orders), -1)
    out, first = np.stack([flat.real, flat.imag], axis=1), rows.elastic.size
    for part, q in rows.nuisance:
        if part.start >= first:
            where = slice(part.start - first, part.stop - first)
            out[:, :, where] -= (out[:, :, where] @ q) @ q.T
    return out


def _grid(bases: Sequence[Base], k: int) -> np.ndarray:
    """Orders of wheel `k`: from `LOWEST` to half a sample at a high speed."""
    travel = max(float(np.ptp(b.motion.theta[:, k])) for b in bases)
    speed = np.quantile(np.abs(np.concatenate([b.motion.speed[:, k] for b in bases])), FAST)
    step = 2 * np.pi / max(travel, 2 * np.pi) / GRID
    top = np.pi / bases[0].run.step / max(float(speed), 1e-6)
    top = min(top, LOWEST + MOST * step)
    return np.arange(LOWEST, max(top, LOWEST + 4 * step), step)


def _peaks(grid: np.ndarray, gains: np.ndarray) -> list[float]:
    """The highest orders that lie a resolution apart."""
    kept: list[int] = []
    for j in np.argsort(gains)[::-1]:
        if all(abs(j - other) > GRID for other in kept):
            kept.append(int(j))
        if len(kept) == PEAKS:
            break
    return [float(grid[j]) for j in kept]
