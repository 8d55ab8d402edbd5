"""What the uncertain numbers of a machine may change on held-out runs that no train run decides.

A limit that the train runs never reach, a spring that they hardly bend: held-out runs that do say
nothing of an effect by it.  With S the covariance of the numbers after the train runs and H their
tangents on the held-out rows these have the covariance I + H S H', and are whitened by it.
"""

import numpy as np

from .._settings import SETTINGS

LEAST_SIGMA = SETTINGS.free_undecided.least_sigma


def undecided(train: np.ndarray, held_out: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """(directions (rows, m) of the held-out rows, orthonormal; the part of each to be taken off).

    `train` and `held_out` (rows, numbers) are the tangents of rows in sigma along the numbers in
    their prior sigmas.  None where there are no such directions, or tangents are not finite.
    """
    if not np.all(np.abs(held_out) < 1e100) or not np.all(np.abs(train) < 1e100):
        return None
    # S = (T'T + I)^-1 = R^-1 R^-T: squares of tangents that span decades would lose what is small
    upper = np.linalg.qr(np.concatenate([train, np.eye(train.shape[1])]), mode="r")
    root = np.linalg.inv(upper)
    left, sizes, _ = np.linalg.svd(held_out @ root, full_matrices=False)
    open_ = sizes > LEAST_SIGMA
    return (left[:, open_], 1 - 1 / np.sqrt(1 + sizes[open_] ** 2)) if open_.any() else None
