"""What a sensor's white noise makes of a balance: rows of a blue colour, weighed by it.

Two differences of a position raise its noise with the fourth power of the frequency, so that slow
rows say far more than quick ones.  Beside that noise stands what no law explains, white in the
acceleration.  The covariance of the rows of a run is

    C = s^2 (D + r I),  D = Toeplitz(R / R_0),

with R the autocovariance of the rows under white position noise of 1-sigma 1, and r by maximum
likelihood; rows are whitened by the inverse of its banded Cholesky factor (Aitken 1935).
"""

import abc
import copy
import dataclasses
from collections.abc import Sequence

import numpy as np
from scipy.linalg import cholesky_banded, solve_banded

from ..._search import AbstractModel, Fit, Point, refit
from ..._settings import SETTINGS
from .._rows import Balance, Measured, smoothed
from .floor import inflation

# r: of the rows' variance that is no sensor noise
SHARES = np.logspace(*SETTINGS.free_colour.decades, SETTINGS.free_colour.powers)
LEAST_COVARIANCE = SETTINGS.free_colour.least_covariance
ROUNDS = SETTINGS.free_colour.rounds
SPAN = SETTINGS.free_colour.span
RELATIVE = SETTINGS.free_colour.relative
FEWEST_ROWS = SETTINGS.free_colour.fewest_rows


@dataclasses.dataclass(frozen=True)
class Colour:
    """Covariance of the rows: `lags` (b,) of the sensor's part over its variance, `share` r."""

    lags: np.ndarray
    share: float
    sigma: float

    def whitened(self, rows: np.ndarray) -> np.ndarray:
        """Rows (k, n) of one run as independent ones of 1-sigma 1."""
        return _whitened(self.lags, self.share, rows)[0] / self.sigma

    def resized(self, left: Sequence[np.ndarray]) -> tuple["Colour", float]:
        """The colour of the size of what is `left`, by run, and -2 log likelihood of that.

        But for a constant a row.
        """
        parts = [_whitened(self.lags, self.share, x[None]) for x in left]
        squares, count = sum(float(np.sum(x**2)) for x, _ in parts), sum(map(len, left))
        sigma = float(np.sqrt(squares / count))
        unlikely = count + 2 * (count * np.log(sigma) + sum(x for _, x in parts))
        return dataclasses.replace(self, sigma=sigma), unlikely


class AbstractColoured(AbstractModel):
    """A model of rows by run that may be weighed by the colour of their noise."""

    measured: Measured
    colour: Colour | None

    @abc.abstractmethod
    def slopes(self, point: Point) -> np.ndarray:
        """Slopes (m, n, n) of the rate at states that the runs pass."""

    @abc.abstractmethod
    def left(self, point: Point, split: str) -> list[np.ndarray]:
        """By run of a split its rows (rows,) at a point, in sigma of each row."""


def of_sensor(model: AbstractColoured, fit: Fit) -> np.ndarray:
    """Autocovariance (b,), over its first value, of a balance's rows under white position noise.

    A row is a + damping v + stiffness q, low-passed, with the typical damping (1/s) and stiffness
    (1/s^2) by which the equation answers to speed and position at a fit.
    """
    rows, slopes = model.measured.rows[0], model.slopes(fit.point)[:, 1]
    assert isinstance(rows, Balance)  # free runs have rows of the sensor's own noise
    stiffness, damping = -np.median(slopes[:, :2], axis=0)
    edge, thin = rows.edge, rows.thin
    impulse = np.zeros(2 * SPAN * max(2 * edge, FEWEST_ROWS * thin) + 1)
    impulse[len(impulse) // 2] = 1.0
    q, v, a = smoothed(impulse, rows.run.step, rows.run.cutoff)
    answer = np.convolve(a + damping * v + stiffness * q, rows.taps, "same")
    several = np.correlate(answer, answer, "full")[len(answer) - 1 :: thin]
    count = 1 + int(np.max(np.flatnonzero(np.abs(several) > LEAST_COVARIANCE * several[0])))
    return several[:count] / several[0]


def likeliest(lags: np.ndarray, left: Sequence[np.ndarray]) -> tuple[Colour, float]:
    """`Colour.resized` with the likeliest share of what is no sensor noise."""
    tried = [Colour(lags, float(share), 1.0).resized(left) for share in SHARES]
    return min(tried, key=lambda both: both[1])


@dataclasses.dataclass(frozen=True)
class Likelihood:
    """-2 log likelihood of the train rows, with the priors, and of the held-out rows.

    A constant a row is left out; `repeated` rows say as much as one.
    """

    train: float
    held: float
    repeated: float

    def above(self, other: "Likelihood") -> tuple[float, float]:
        """By how much this is above another one on the train and on the held-out rows."""
        repeated = max(self.repeated, other.repeated)
        return (self.train - other.train) / repeated, (self.held - other.held) / repeated


def in_colour(model: AbstractColoured, fit: Fit) -> Likelihood:
    """How likely a fit's laws are once all numbers are refitted, weighed by what they leave.

    The noise has the colour and size of what the fit itself leaves, on the held-out rows a size of
    their own.
    """
    lags, twin = of_sensor(model, fit), copy.copy(model)
    for _ in range(ROUNDS):
        twin.colour, _ = likeliest(lags, model.left(fit.point, "train"))
        fit = refit(twin, fit.point, relative=RELATIVE)
    left, held = (model.left(fit.point, split) for split in ("train", "held-out"))
    colour, unlikely = likeliest(lags, left)
    repeated = inflation([colour.whitened(x[None])[0] for x in left])
    return Likelihood(unlikely + fit.penalty, colour.resized(held)[1], repeated)


def _whitened(lags: np.ndarray, share: float, rows: np.ndarray) -> tuple[np.ndarray, float]:
    """(rows (k, n) less their colour, log of the determinant of the factor)."""
    n = rows.shape[1]
    bands = np.repeat(lags[: min(len(lags), n)][:, None], n, axis=1)
    bands[0] += share
    factor = cholesky_banded(bands, lower=True, check_finite=False)
    white = solve_banded((len(bands) - 1, 0), factor, rows.T, check_finite=False)
    return white.T, float(np.sum(np.log(factor[0])))
