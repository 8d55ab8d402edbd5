"""The calibration of the uncertain parameters before any effect is known."""

import numpy as np

from ..._errors import InputError
from .._settings import SETTINGS
from .fit import Fit, refit
from .model import AbstractModel, Point, unit_bounds
from .waves import scanned

CAUGHT_COST = SETTINGS.calibration.caught_cost
SCANNED_COST = SETTINGS.calibration.scanned_cost
RELATIVE = SETTINGS.calibration.relative
BOUND_SHARE = SETTINGS.calibration.bound_share
SEED = 20


def check_foretold(model: AbstractModel, point: Point, split: str, source: object) -> None:
    """Raise `InputError` where what `point` foretells of the runs of `split` is not finite."""
    try:
        held = bool(np.isfinite(model.residuals([point], split)[0]).all())
    except FloatingPointError:  # a model that cannot be prepared about such a motion
        held = False
    if not held:
        which = "the held-out runs" if split == "held-out" else "the runs to learn from"
        raise InputError(
            f"the machine as described runs away under the inputs of {which}: what it foretells is "
            "not finite. A law that drives or softens may be too strong, or a number in another "
            "unit.",
            source,
        )


def calibrated(model: AbstractModel, start: Point) -> Fit:
    """The refit from `start`, or the best of others where that one is caught.

    Numbers in which the prediction is wavy are scanned over their range, about the end of the first
    refit and about `start`, where more is left than noise, or where a parameter ends at its bound:
    of a noise that nobody declared, what a wrong calibration leaves passes for it.  A resonance
    beside a line of the excitation makes the cost wavy too: a fit may end on the wrong side of it,
    with many parameters at their bounds.  An effect that is missing bends a few of them.  So where
    a share of `settings.caught_share` is at its bounds, up to `settings.restarts` others begin
    where the priors' sigmas draw them (with a fixed seed); the first that lies far below ends the
    trials.
    """
    best = first = refit(model, start, relative=RELATIVE)
    for about in (first.point, start):
        if first.cost < SCANNED_COST * model.dof("train") and not _at_bounds(model, first):
            break
        waves = scanned(model, about)
        if waves is None:
            break
        other = refit(model, waves, relative=RELATIVE)
        best = first = other if other.cost < first.cost else first
    if not caught(model, first):
        return first
    rng = np.random.default_rng(SEED)
    low, high = unit_bounds(model.priors)
    for k in range(model.settings.restarts):
        model.tell(f"calibrating from other numbers, start {k + 1}")
        u = np.clip(rng.normal(size=len(low)), low, high)
        other = refit(model, Point(u), relative=RELATIVE)
        best = other if other.cost < best.cost else best
        if best.cost < first.cost / CAUGHT_COST:
            break
    return best


def caught(model: AbstractModel, fit: Fit) -> bool:
    """Whether a misfit is left while many parameters are at their bounds."""
    if fit.cost < CAUGHT_COST * model.dof("train"):
        return False
    ends = _at_bounds(model, fit)
    return ends > 1 and ends >= model.settings.caught_share * len(model.priors)


def _at_bounds(model: AbstractModel, fit: Fit) -> int:
    """How many parameters are at their bounds."""
    hard = np.array([prior.hard for prior in model.priors])
    return int(np.sum(np.abs(fit.point.u) > BOUND_SHARE * hard))
