"""What held-out runs say of a refit: whether the change that it foretold is there."""

import dataclasses

import numpy as np

from .._settings import SETTINGS, SearchSettings
from .fit import Fit
from .model import Effect

BLOCKS = SETTINGS.held_out.blocks
MULTIPLIER_ERRORS = SETTINGS.held_out.multiplier_errors


@dataclasses.dataclass(frozen=True)
class HeldOut:
    """What the held-out runs say of a change d of the prediction, r the residual before it.

    d was fitted elsewhere, so without an effect d.r/|d| is standard normal: one test, no multiple.
    With the effect r = d + noise, so the multiplier d.r/d.d is 1; a change that stands for
    something else, or for noise, has another one, below 1/2 where it makes the residual larger.
    """

    gain: float  # fall of chi2, |r|^2 - |r - d|^2
    size: float  # d.d
    spread: float = 1.0  # variance of d.(r - m d) over that of white noise of the assumed level

    @staticmethod
    def of(before: np.ndarray, after: np.ndarray) -> "HeldOut":
        """From the residuals before and after.

        What is left of r may be larger than the noise, or have a colour: the variance of its inner
        product with d is that of its blocks.
        """
        d = before - after
        size, gain = float(d @ d), float(d @ (before + after))
        if not 0 < size < np.inf:
            return HeldOut(gain, size)
        left = d * (before - 0.5 * (gain / size + 1) * d)
        starts = np.unique(np.linspace(0, len(d), BLOCKS, endpoint=False).astype(int))
        blocks = np.add.reduceat(left, starts)
        return HeldOut(gain, size, max(1.0, float(blocks @ blocks) / size))

    @property
    def multiplier(self) -> float:
        """Share of the predicted change that is there."""
        return 0.5 * (self.gain / self.size + 1) if self.size > 0 else 0.0

    @property
    def there(self) -> float:
        """Fall of chi2 by the change at the size that it has there, m^2 d.d."""
        return self.multiplier**2 * self.size

    @property
    def sure(self) -> float:
        """Standard deviations of the multiplier from zero."""
        return self.multiplier * float(np.sqrt(self.size / self.spread))

    def error(self, gain: float) -> float:
        """1-sigma of the multiplier, the change having gained `gain` on the train runs."""
        return float(np.sqrt(sum(self.spread / max(x, 1e-300) for x in (self.size, gain))))

    def tells(self, settings: SearchSettings = SETTINGS.search) -> bool:
        """Whether the whole change, were it there, would stand out enough to be confirmed."""
        return bool(self.size > settings.sure_sigmas**2 * self.spread)

    def confirms(self, gain: float, settings: SearchSettings = SETTINGS.search) -> bool:
        """Whether it is the effect that gained `gain` on the train runs."""
        if not np.isfinite(self.gain):
            return False
        slack = min(MULTIPLIER_ERRORS * self.error(gain), settings.size_noise)
        same = 1 / settings.size_factor - slack < self.multiplier < settings.size_factor + slack
        return same and self.sure > settings.sure_sigmas


@dataclasses.dataclass(frozen=True)
class Trial:
    """A refitted rival: the effect, its fit, its gain on the train runs, and the held-out runs."""

    effect: Effect
    fit: Fit
    gain: float
    held: HeldOut
    settings: SearchSettings = SETTINGS.search

    @property
    def light(self) -> "Trial":
        """The same without the tangents of its fit, which nobody asks for once it is ranked."""
        fit = dataclasses.replace(self.fit, jacobian=np.zeros((0, self.fit.jacobian.shape[1])))
        return dataclasses.replace(self, fit=fit)

    @property
    def accepted(self) -> bool:
        """Whether held-out runs confirm what the train runs gained."""
        return self.held.confirms(self.gain, self.settings)
