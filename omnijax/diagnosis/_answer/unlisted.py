"""Numbers that the rig file takes for exact: which of them, off, would close a gap.

What is not listed under `[uncertainty]` is held as it is stated.  An inertia that is three per cent
off then leaves a gap that one law does not close, and several close it as no machine does.
"""

import copy
import dataclasses

import numpy as np

from ...rig import closed_numbers
from .._machine import RigModel, rig_priors
from .._search import Fit, Point, Prior, beside_taken, refits_about, taken_up
from .._settings import SETTINGS
from .evidence import Unlisted

PATHS = ("sphere.inertia", "sphere.mass", "sphere.radius", "platform.mass", "wheel.radius",
         "wheel.roundness", "wheel.inertia", "wheel.mass")  # fmt: skip
TOLERANCES = {path: getattr(SETTINGS.unlisted, path.replace(".", "_")) for path in PATHS}
STEP = SETTINGS.unlisted.step
REFITTED = SETTINGS.unlisted.refitted
FOLLOWED_SHARE = SETTINGS.unlisted.followed_share


def unlisted(model: RigModel, fit: Fit, closing: float) -> list[Unlisted]:
    """The unlisted numbers that close the share `closing` of the gap beside `fit`, the best first.

    Ranked by what they change to first order in the first fitted run, the best refitted: the runs
    prepared about each itself, for what was made of the data about a wrong set leads elsewhere.
    """
    model = RigModel(model.rig, model.machine.runs, model.noise, model.laws, model.window)
    (fit,) = refits_about(model, fit.point, 1)
    gap = fit.chi2 - model.dof("train")
    (left,) = model.residuals([fit.point], "held-out")
    before = float(left @ left) - model.dof("held-out")
    if not (gap > 0 and before > 0):
        return []
    free = {prior.name for prior in model.priors}
    opened = {path: _opened(model, path, sigma) for path, sigma in TOLERANCES.items()}
    groups = {
        path: [p for p in rig_priors(rig) if p.name not in free]
        for path, rig in opened.items() if not closed_numbers(rig)
    }  # fmt: skip
    groups = {path: priors for path, priors in groups.items() if priors}
    out = []
    for path in _promising(model, fit, groups)[:REFITTED]:
        wider = _with(model, groups[path])
        start = Point(np.concatenate([fit.point.u, np.zeros(len(groups[path]))]))
        _, refitted = refits_about(wider, start, 2)
        (rest,) = wider.residuals([refitted.point], "held-out")
        closed = 1 - (float(rest @ rest) - model.dof("held-out")) / before
        if closed >= closing:
            numbers = _numbers(model, groups[path], refitted)
            out.append(Unlisted(path, numbers, closed, refitted.cost))
    return sorted(out, key=lambda x: -x.closed)


def _opened(model: RigModel, path: str, sigma: float):
    """The rig with one number open and no other."""
    return dataclasses.replace(model.rig, uncertainty=((path, sigma),))


def _with(model: RigModel, priors: list[Prior]) -> RigModel:
    """The model with further uncertain numbers; it shares the machine."""
    wider = copy.copy(model)
    wider.priors = [*model.priors, *priors]
    return wider


def _promising(model: RigModel, fit: Fit, groups: dict[str, list[Prior]]) -> list[str]:
    """Paths whose numbers explain a worthwhile share of the first fitted run's gap, best first."""
    every = [prior for priors in groups.values() for prior in priors]
    wider, P = _with(model, every), len(fit.point.u)
    u = np.concatenate([fit.point.u, np.zeros(len(every))])
    points = [Point(u + STEP * row) for row in np.eye(len(u))[P:]]
    with model.aside():
        before, *after = wider.residuals([Point(u), *points], model.ranking)
    columns = np.stack([(x - before) / STEP for x in after], axis=1)
    taken = taken_up(fit.jacobian[: len(before), :P], P)
    left = beside_taken(before, taken, fit.point.u)
    top = taken[: len(before)]
    columns = columns - top @ (top.T @ columns)
    gap, at, gains = float(left @ left) - len(left), 0, {}
    for path, priors in groups.items():
        own = columns[:, at : at + len(priors)]
        shift = np.linalg.lstsq(own, -left, rcond=None)[0]
        gains[path] = float(left @ left) - float(np.sum((left + own @ shift) ** 2))
        at += len(priors)
    worth = [path for path, gain in gains.items() if gain > FOLLOWED_SHARE * gap]
    return sorted(worth, key=lambda path: -gains[path])


def _numbers(
    model: RigModel, priors: list[Prior], refitted: Fit
) -> dict[str, tuple[float, float, float]]:
    """(stated, refitted, 1-sigma) of the further numbers."""
    P = len(model.priors)
    sigma = np.sqrt(np.diag(refitted.scaled_covariance(model.dof("train")))[P:])
    values = refitted.point.u[P:]
    return {
        p.name: (p.value, p.at(u), abs(p.slope(u)) * s)
        for p, u, s in zip(priors, values, sigma, strict=True)
    }
