"""What the experiments on measured machines share: candidates, search, and an untouched test.

All choices are made on a split of the training data.  Model errors are far above the sensors'
floor, so nearly everything is significant; what stops the search is the gain on held-out data.
"""

from collections.abc import Callable

import numpy as np

from omnijax.diagnosis import Search, SmallModel, refit
from omnijax.laws import EFFECTS, GENERIC


def laws_at(*ports: str) -> dict:
    """The whole library at these ports; a sensor's crosstalk needs the three channels of dR."""
    library = {**EFFECTS, **GENERIC}
    return {k: v for k, v in library.items() if v.port in ports and v.places != ("dR",)}


def rms(model: SmallModel, point, split: str) -> float:
    """RMS of a point's residual in sigma."""
    (r,) = model.residuals([point], split)
    return float(np.sqrt(np.mean(r**2)))


def floor(x: np.ndarray) -> float:
    """1-sigma of white noise with the power of the top tenth of a signal's spectrum."""
    power = np.abs(np.fft.rfft((x - x.mean()) * np.hanning(len(x)))) ** 2
    return float(np.sqrt(np.median(power[-(len(power) // 10) :]) / np.log(2) * 8 / 3 / len(x)))


def search(model: SmallModel, tell: Callable[[str], None]):
    """(baseline point, found point, ids in the order accepted), refitted on the `whole` training.

    `model` has the splits `train` and `held-out`, both of the training data, and `whole`.
    """
    found = Search(model, tell).run()
    points = [refit_on(model, f.point, "whole") for f in (found.baseline, found.fit)]
    order = [t[0].effect.id for t in found.trials if t]
    tell(f"accepted in this order: {', '.join(order[: len(found.fit.point.effects)])}")
    return (*points, order[: len(found.fit.point.effects)])


def refit_on(model: SmallModel, point, split: str):
    """The point refitted on another split."""

    def residual(values, laws, _split):
        return model.residual(values, laws, split)

    same = SmallModel(residual, model.priors, model.laws, model.place, model.constants)
    return refit(same, point).point


def describe(model: SmallModel, point, tell: Callable[[str], None]) -> None:
    """Parameters and effects in words."""
    for prior, u in zip(model.priors, point.u, strict=True):
        tell(f"{prior.name} = {prior.at(float(u)):.5g} {prior.unit}")
    for effect in point.effects:
        tell(f"{effect.name}: {effect.values}")
