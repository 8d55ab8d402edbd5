"""What held-out runs say of a refit: whether the change that it foretold is there."""

import dataclasses

import numpy as np

from .fit import Fit
from .model import Effect

SURE = 4.0  # standard deviations by which held-out runs must confirm a predicted change
SHARE = 1.5  # factor by which a change on held-out runs may be off the predicted one


@dataclasses.dataclass(frozen=True)
class HeldOut:
    """What the held-out runs say of a change d of the prediction, r the residual before it.

    d was fitted elsewhere, so without an effect d.r/|d| is standard normal: one test, no multiple.
    With the effect r = d + noise, so the multiplier d.r/d.d is 1; a change that stands for
    something else, or for noise, has another one, below 1/2 where it makes the residual larger.
    """

    gain: float  # fall of chi2, |r|^2 - |r - d|^2
    size: float  # d.d

    @staticmethod
    def of(before: np.ndarray, after: np.ndarray) -> "HeldOut":
        """From the residuals before and after."""
        d = before - after
        return HeldOut(float(d @ (before + after)), float(d @ d))

    @property
    def multiplier(self) -> float:
        """Share of the predicted change that is there."""
        return 0.5 * (self.gain / self.size + 1) if self.size > 0 else 0.0

    @property
    def sure(self) -> float:
        """Standard deviations of the multiplier from zero."""
        return self.multiplier * float(np.sqrt(self.size))

    def confirms(self, gain: float) -> bool:
        """Whether it is the effect that gained `gain` on the train runs."""
        if not np.isfinite(self.gain):
            return False
        spread = np.sqrt(1 / max(self.size, 1e-300) + 1 / max(gain, 1e-300))
        slack = min(3 * spread, 0.15)
        same = 1 / SHARE - slack < self.multiplier < SHARE + slack
        return same and self.sure > SURE


@dataclasses.dataclass(frozen=True)
class Trial:
    """A refitted rival: the effect, its fit, its gain on the train runs, and the held-out runs."""

    effect: Effect
    fit: Fit
    gain: float
    held: HeldOut

    @property
    def accepted(self) -> bool:
        """Whether held-out runs confirm what the train runs gained."""
        return self.held.confirms(self.gain)
