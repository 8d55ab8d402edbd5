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
BLOCKS = SETTINGS.held_out.blocks


def within_doubt(model: AbstractModel, fit: Fit) -> Point | None:
    """The point that the calibration of a `fit` leaves open and that foretells held-out runs best.

    None where they ask for more than it leaves open, or where nothing is uncertain.  A fit that
    misses the fitted runs by far leaves nothing open: its numbers stand for what is missing.
    """
    count = len(model.priors)
    if fit.chi2 > MISFIT * model.dof("train"):
        return None
    if not count:
        return None
    values, vectors = np.linalg.eigh(
        _covariance(fit, fit.chi2 / model.dof("train"))[:count, :count]
    )
    if not np.all(np.isfinite(values)):
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


def _covariance(fit: Fit, spread: float) -> np.ndarray:
    """The covariance (numbers, numbers) of a fit's numbers, as sure as what it leaves allows.

    Noise that is stronger than assumed in some channel, or has a colour, moves the numbers that are
    told by it by more than the fit's own covariance says.  How far is told by the sums of tangents
    times residual over blocks of rows; never less than white noise of the mean `spread` would.

    Source: White, A heteroskedasticity-consistent covariance matrix estimator (1980); over blocks,
    Liang, Zeger (1986).
    """
    values, vectors = np.linalg.eigh(fit.covariance)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    starts = np.linspace(0, len(fit.residual), BLOCKS, endpoint=False).astype(int)
    sums = np.add.reduceat(fit.jacobian * fit.residual[:, None], np.unique(starts), axis=0) @ root
    more, ways = np.linalg.eigh(sums.T @ sums)
    return (root @ ways * np.maximum(more, max(1.0, spread))) @ (root @ ways).T
