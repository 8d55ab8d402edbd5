"""What the uncertain numbers of a machine may change on held-out runs that no train run decides.

A limit that the train runs never reach, a spring that they hardly bend: held-out runs that do say
nothing of an effect by it.  With S the covariance of the numbers after the train runs and H their
tangents on the held-out rows these have the covariance I + H S H', and are whitened by it.
"""

from typing import TYPE_CHECKING

import numpy as np

from .._search import Point

if TYPE_CHECKING:
    from .model import OdeModel

STEP = 1e-3  # prior sigmas, of a difference
LEAST = 0.1  # 1-sigma over the noise, from which a direction counts


def undecided(model: "OdeModel", point: Point) -> tuple[np.ndarray, np.ndarray] | None:
    """(directions (rows, m) of the held-out rows, orthonormal; the part of each to be taken off).

    None where there are none.
    """
    ways = np.eye(len(point.u))
    if not len(ways) or not model.splits["held-out"]:
        return None
    J = model.tangents(point, ())
    points = [point, *(Point(point.u + STEP * way, point.effects) for way in ways)]
    thetas = np.stack([model.numbers.vector(p) for p in points])
    rows = model.whitened(model.raw(thetas, model.splits["held-out"]), "held-out")
    changed = (rows[1:] - rows[0]) / STEP
    if not np.all(np.abs(changed) < 1e100) or not np.all(np.abs(J) < 1e100):
        return None
    root = np.linalg.cholesky(np.linalg.inv(J.T @ J + ways))
    left, sizes, _ = np.linalg.svd(changed.T @ root, full_matrices=False)
    open_ = sizes > LEAST
    return (left[:, open_], 1 - 1 / np.sqrt(1 + sizes[open_] ** 2)) if open_.any() else None
