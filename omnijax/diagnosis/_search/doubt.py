"""What held-out runs may show of a calibration that the fitted runs left open.

Runs that hardly excite a mode tell its numbers badly, and a run that excites it shows that: the
covariance of what is left there is I + J C J', not I.  chi2 with that covariance is the least of
|r + J s|^2 + s' C^-1 s over all steps s of the calibration.

Source: the normal law's predictive distribution (Gelman and others, Bayesian Data Analysis, 14.3).
"""

import numpy as np
from scipy.stats import chi2

from .._settings import SETTINGS
from .fit import Fit, tangent_rows
from .model import AbstractModel, Point, unit_bounds

CHANCE = SETTINGS.doubt.chance
MISFIT = SETTINGS.calibration.misfit


def within_doubt(model: AbstractModel, fit: Fit) -> Point | None:
    """The point that the calibration of a `fit` leaves open and that foretells held-out runs best.

    None where they ask for more than it leaves open, or where nothing is uncertain.  A fit that
    misses the fitted runs by far leaves nothing open: its numbers stand for what is missing.
    """
    count = len(model.priors)
    if fit.chi2 > MISFIT * model.dof("train"):
        return None
    spread = max(1.0, fit.chi2 / model.dof("train"))
    values, vectors = np.linalg.eigh(fit.covariance[:count, :count] * spread)
    if not count or not np.all(np.isfinite(values)):
        return None
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    u, effects = fit.point.u, fit.point.effects
    (here,) = model.residuals([fit.point], "held-out")
    J = tangent_rows(model, fit.point, (), here, split="held-out") @ root
    if not np.all(np.isfinite(J)):
        return None
    left, s, right = np.linalg.svd(J, full_matrices=False)
    along = left.T @ here  # of the variance 1 + s^2
    if np.sum(along**2 / (1 + s**2)) > chi2.isf(CHANCE, len(s)):
        return None
    step = -root @ (right.T @ (s / (1 + s**2) * along))
    return Point(np.clip(u + step, *unit_bounds(model.priors)), effects)
