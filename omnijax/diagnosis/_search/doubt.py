"""What held-out runs may show of numbers that the fitted runs left open.

Runs that hardly excite a mode tell its numbers badly, and a run that excites it shows that: the
covariance of what is left there is I + J C J', not I.  chi2 with that covariance is the least of
|r + J s|^2 + s' C^-1 s over all steps s of the numbers.

Source: the normal law's predictive distribution (Gelman and others, Bayesian Data Analysis, 14.3).
"""

import numpy as np
from scipy.special import chdtri

from .._settings import SETTINGS
from .fit import Fit, tangent_rows
from .gauss_newton import FitState, bounds, numbers
from .model import AbstractModel, Point, moved

CHANCE = SETTINGS.doubt.chance
SCANNED_COST = SETTINGS.calibration.scanned_cost
ROUNDS = SETTINGS.doubt.rounds
SETTLED_SIGMAS = SETTINGS.doubt.settled_sigmas


def within_doubt(model: AbstractModel, fit: Fit) -> Point | None:
    """The point within what a `fit` leaves open that foretells held-out runs best.

    None where they ask for more than it leaves open, or where nothing is uncertain.  A fit that
    misses the fitted runs by far leaves nothing open: its numbers stand for what is missing.  The
    numbers of effects are open too: of an order, which a short run tells badly, a longer one shows
    it.  Where a number bends what is foretold, its tangents are taken anew about the point.
    """
    if fit.chi2 > SCANNED_COST * model.dof("train") or fit.covariance.size == 0:
        return None
    root = _root(_covariance(fit, fit.chi2 / model.dof("train")))
    if not np.all(np.isfinite(root)):
        return None
    state = FitState(fit.point, fit.free, fit.residual, fit.cost)
    x, (low, high), count = numbers(state), bounds(model, fit.free), len(fit.point.u)
    point, step, asked = fit.point, np.zeros(root.shape[1]), np.inf
    for _ in range(ROUNDS):
        (here,) = model.residuals([point], "held-out")
        J = tangent_rows(model, point, fit.free, here, split="held-out") @ root
        if not np.all(np.isfinite(J)):
            return None
        left, s, right = np.linalg.svd(J, full_matrices=False)
        along = left.T @ (here - J @ step)  # of the variance 1 + s^2
        asked, last = float(np.sum(along**2 / (1 + s**2))), step
        step = -right.T @ (s / (1 + s**2) * along)
        there = np.clip(x + root @ step, low, high)
        point = moved(fit.point, there[:count], fit.free, there[count:])
        if np.linalg.norm(step - last) < SETTLED_SIGMAS:
            break
    return point if asked < chdtri(len(step), CHANCE) else None


def _root(covariance: np.ndarray) -> np.ndarray:
    """A root (numbers, k) of a covariance, whatever the units of its numbers."""
    scale = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    return scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))


def _covariance(fit: Fit, spread: float) -> np.ndarray:
    """The covariance (numbers, numbers) of a fit's numbers, as sure as what it leaves allows.

    Noise that is stronger than assumed in some channel, or has a colour, moves the numbers that are
    told by it by more than the fit's own covariance says.  How far is told by the sums of tangents
    times residual over blocks of rows; never less than white noise of the mean `spread` would.
    Here in every direction of the numbers, the worst too, as a doubt is granted;
    `Fit.scaled_covariance` is that of each number by itself, as it is told.

    Source: White, A heteroskedasticity-consistent covariance matrix estimator (1980); over blocks,
    Liang, Zeger (1986).
    """
    root = _root(fit.covariance)
    sums = fit.block_sums() @ root
    more, ways = np.linalg.eigh(sums.T @ sums)
    return (root @ ways * np.maximum(more, max(1.0, spread))) @ (root @ ways).T
