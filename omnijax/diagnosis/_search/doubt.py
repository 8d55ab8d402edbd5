"""What held-out runs may show of numbers that the fitted runs left open.

Runs that hardly excite a mode tell its numbers badly, and a run that excites it shows that: the
covariance of what is left there is I + J C J', not I.  chi2 with that covariance is the least of
|r + J s|^2 + s' C^-1 s over all steps s of the numbers.

Source: the normal law's predictive distribution (Gelman and others, Bayesian Data Analysis, 14.3).
"""

from typing import NamedTuple

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


class Foretold(NamedTuple):
    """The point within what a fit leaves open that foretells the held-out runs best.

    `cost` is |r|^2 + |s|^2 there, s the way from the fit in its own sigmas; `asked` the part of it
    along the tangents of its `numbers`.
    """

    point: Point
    cost: float
    asked: float
    numbers: int

    @property
    def granted(self) -> bool:
        """Whether held-out runs ask for no more than the fit leaves open."""
        return self.asked < float(chdtri(self.numbers, CHANCE))


def within_doubt(model: AbstractModel, fit: Fit) -> Point | None:
    """The point within what a `fit` leaves open that foretells held-out runs best.

    None where they ask for more than it leaves open, or where nothing is uncertain.
    """
    told = foretold(model, fit)
    return told.point if told is not None and told.granted else None


def shown_within_doubt(model: AbstractModel, less: Fit, fit: Fit) -> float:
    """By how much better held-out runs are foretold by a fit than by `less`, which lacks an effect.

    Each within what it leaves open.  Where the fitted runs tell an effect's numbers badly, what
    they foretell is badly told too, and no share of it says whether the effect is there.  Minus
    infinity where the fit does not foretell them.
    """
    own = foretold(model, fit)
    if own is None or not own.granted:
        return -np.inf
    other = foretold(model, less)
    (left,) = model.residuals([less.point], "held-out")
    return (float(left @ left) if other is None else other.cost) - own.cost


def foretold(model: AbstractModel, fit: Fit) -> Foretold | None:
    """What a fit foretells of held-out runs within what it leaves open.

    None where nothing is uncertain.  A fit that misses the fitted runs by far leaves nothing open:
    its numbers stand for what is missing.  The numbers of effects are open too: of an order, which
    a short run tells badly, a longer one shows it.  Where a number bends what is foretold, its
    tangents are taken anew about the point.
    """
    if fit.chi2 > SCANNED_COST * model.dof("train") or fit.covariance.size == 0:
        return None
    root = _root(_covariance(fit, fit.chi2 / model.dof("train")))
    if not np.all(np.isfinite(root)):
        return None
    state = FitState(fit.point, fit.free, fit.residual, fit.cost)
    x, (low, high), count = numbers(state), bounds(model, fit.free), len(fit.point.u)

    def at(step: np.ndarray) -> Point:
        there = np.clip(x + root @ step, low, high)
        return moved(fit.point, there[:count], fit.free, there[count:])

    kept, least, asked = np.zeros(root.shape[1]), np.inf, np.inf
    step = kept
    for _ in range(ROUNDS):
        (here,) = model.residuals([at(step)], "held-out")
        cost = float(here @ here + step @ step)
        if not cost < least:  # too far for its tangents
            step = (kept + step) / 2
            continue
        settled = np.isfinite(least) and np.linalg.norm(step - kept) < SETTLED_SIGMAS
        kept, least = step, cost
        if settled:
            break
        J = tangent_rows(model, at(step), fit.free, here, split="held-out") @ root
        if not np.all(np.isfinite(J)):
            return None
        left, s, right = np.linalg.svd(J, full_matrices=False)
        along = left.T @ (here - J @ step)  # of the variance 1 + s^2
        asked = float(np.sum(along**2 / (1 + s**2)))
        step = -right.T @ (s / (1 + s**2) * along)
    return Foretold(at(kept), least, asked, len(kept))


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
