"""What the experiments on measured machines share: candidates, search, and an untouched test.

All choices are made on a split of the training data.  Model errors are far above the sensors'
floor, so nearly everything is significant; what stops the search is the gain on held-out data.
"""

from collections.abc import Callable

import numpy as np

from omnijax.diagnosis import Search, SmallModel, refit
from omnijax.laws import EFFECTS, GENERIC

NEGLIGIBLE = 0.01  # growth of the RMS without an effect, below which it is not worth a name


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
    """(baseline point, found point, ids by weight), refitted on the `whole` training data.

    An effect's weight is the growth of the RMS where it is left out and all else is refitted.
    What weighs less than `NEGLIGIBLE` is left out, the least first.  `model` has the splits `train`
    and `held-out`, both of the training data, and `whole`.
    """
    found = Search(model, tell).run()
    baseline, point = (refit_on(model, f.point, "whole") for f in (found.baseline, found.fit))
    while point.effects:
        weights, without = weigh(model, point)
        least = int(np.argmin(weights))
        if weights[least] >= NEGLIGIBLE:
            break
        tell(f"left out: {point.effects[least].name}, which lowers the RMS by a factor of "
             f"{1 + weights[least]:.4f} only")  # fmt: skip
        point = without[least]
    else:
        return baseline, point, []
    order = [int(k) for k in np.argsort(-weights)]
    tell("by weight: " + ", ".join(f"{point.effects[k].id} ({weights[k]:.3g})" for k in order))
    return baseline, point, [point.effects[k].id for k in order]


def weigh(model: SmallModel, point) -> tuple[np.ndarray, list]:
    """Growth of the RMS (0: none) where each effect is left out, and the points without it."""
    full, without = rms(model, point, "whole"), []
    for k in range(len(point.effects)):
        fewer = point.with_effects(*point.effects[:k], *point.effects[k + 1 :])
        without.append(refit_on(model, fewer, "whole"))
    return np.array([rms(model, p, "whole") for p in without]) / full - 1, without


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
