"""Other calibrations that fit as well: a walk along the valley of numbers that are one to the data.

Where the runs tell only one combination of two uncertain numbers, as of the damping and the back
EMF of a servo that is always on, the priors choose where in a valley the calibration ends.  What an
effect changes may hang on that choice: friction of a loaded gear grows with the motor's torque, of
which the back EMF is a part.  With r the residual in sigma, J its tangents in prior sigmas and n
where J n = 0, a step is u + n/2, and two corrections of least norm, u - J^+ r, lead back to the
floor of the valley and leave the place along it.
"""

from collections.abc import Iterator

import numpy as np

from .._settings import SETTINGS
from .fit import Fit, tangent_rows
from .model import AbstractModel, Point, unit_bounds

OPEN_SLOPE = SETTINGS.valley.open_slope
STEP = SETTINGS.valley.step
CORRECTIONS = SETTINGS.valley.corrections
LEAST_COSINE = SETTINGS.valley.least_cosine
VALLEY_COST = SETTINGS.valley.valley_cost


def ends_of_valleys(model: AbstractModel, fit: Fit) -> list[Point]:
    """Calibrations at both ends of each valley, with the fit's effects as they are.

    None where the train runs tell all numbers.
    """
    ways = _flat(fit.jacobian[:, : len(fit.point.u)])
    walks = [list(along_valley(model, fit, sign * way)) for way in ways for sign in (1.0, -1.0)]
    return [walked[-1] for walked in walks if walked]


def _flat(J: np.ndarray) -> np.ndarray:
    """Directions (m, numbers), orthonormal, that the rows do not tell."""
    if not J.size or not np.all(np.isfinite(J)):
        return np.zeros((0, J.shape[1]))
    _, sizes, right = np.linalg.svd(J, full_matrices=False)
    return right[sizes < OPEN_SLOPE]


def along_valley(model: AbstractModel, fit: Fit, way: np.ndarray) -> Iterator[Point]:
    """Points a step apart, as far as the bounds, or as the floor of the valley can be followed."""
    point = fit.point
    for _ in range(round(2 * max(p.hard for p in model.priors) / STEP)):
        begun = point.u
        point = _moved(model, point, STEP * way)
        r, J = _rows(model, point)
        for _ in range(CORRECTIONS):
            point = _moved(model, point, -_least(J) @ r)
            r, J = _rows(model, point)
        if not float(r @ r) < VALLEY_COST * fit.chi2 or np.linalg.norm(point.u - begun) < STEP / 2:
            return
        yield point
        on = _flat(J)
        ahead = on.T @ (on @ way)
        if not np.linalg.norm(ahead) > LEAST_COSINE:
            return
        way = ahead / np.linalg.norm(ahead)


def _rows(model: AbstractModel, point: Point) -> tuple[np.ndarray, np.ndarray]:
    """(residual, its tangents along the uncertain numbers) on the train rows."""
    (residual,) = model.residuals([point], "train")
    return residual, tangent_rows(model, point, (), residual)


def _least(J: np.ndarray) -> np.ndarray:
    """The pseudo-inverse (numbers, rows) over the directions that the rows tell."""
    if not np.all(np.isfinite(J)):
        return np.zeros(J.T.shape)
    left, sizes, right = np.linalg.svd(J, full_matrices=False)
    told = sizes >= OPEN_SLOPE
    return (right[told].T / sizes[told]) @ left[:, told].T


def _moved(model: AbstractModel, point: Point, step: np.ndarray) -> Point:
    """The point moved by no more than `STEP`, within the bounds."""
    size = max(1.0, float(np.linalg.norm(step)) / STEP)
    return Point(np.clip(point.u + step / size, *unit_bounds(model.priors)), point.effects)
