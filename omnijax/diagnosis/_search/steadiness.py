"""Whether effects are as strong at all times and in all runs: asked of all runs at once.

A law of the library has one size for all runs.  An effect that grows or fades (as a motor warms,
say) is not such a law, even if each run alone fits well with a size of its own.  The residual of
all runs together then contains the effect's change multiplied by the time, or more of that change
in some runs than in others, beyond what constant numbers explain.
"""

import dataclasses

import numpy as np
from numpy.polynomial.legendre import legvander

from .._orthonormal import orthonormal_of_many_rows
from .._settings import SETTINGS
from .fit import Fit, tangent_rows
from .held_out import HeldOut
from .model import AbstractModel, size_keys, value_of
from .scan import chance

DEGREE = SETTINGS.steadiness.degree
OF_TIME = ("sensor-drift",)  # laws of the time itself, which noise that wanders makes unsteady
CHANCE = SETTINGS.steadiness.chance
LEAST_DIRECTION = SETTINGS.steadiness.least_direction


@dataclasses.dataclass(frozen=True)
class Unsteady:
    """An effect of which the `share` (RMS over what it changes) is not constant."""

    name: str
    share: float
    chance: float


def unsteady(model: AbstractModel, fit: Fit, alike: float) -> list[Unsteady]:
    """The effects of a fit that surely change by more than the share `alike`, the most first.

    By effect the change s of all rows with its size is multiplied by courses over the time and by
    which run it is; r' is what is left beside all constant numbers, M' likewise.  The gain of r'
    over M' is chi-square of as many degrees as M' has columns, times the spread where what is left
    has a colour; over |s|^2 it is no more than the square of the share.
    """
    fitted, others = model.moments("train"), model.moments("held-out")
    if fitted is None or others is None or not fit.point.effects:
        return []
    (run, time), J, left = fitted, fit.jacobian, fit.residual
    if not np.isin(others[0], run).any():  # a short run alone plays both roles
        (held,) = model.residuals([fit.point], "held-out")
        there = tangent_rows(model, fit.point, fit.free, held, split="held-out")
        J, left = np.concatenate([J, there]), np.concatenate([left, held])
        run, time = (np.concatenate(x) for x in zip(fitted, others, strict=True))
    if not (np.all(np.isfinite(J)) and np.all(np.isfinite(left))):
        return []
    every = orthonormal_of_many_rows(J)
    left = left - every @ (every.T @ left)
    shapes = [np.where(run == r, 1.0, 0.0) for r in np.unique(run)]
    course = legvander(2 * time / max(time.max(), 1e-300) - 1, DEGREE)[:, 1:]
    shapes = np.concatenate([np.stack(shapes, axis=1), course], axis=1)
    out, P = [], len(fit.point.u)
    for i, effect in enumerate(fit.point.effects):
        keys = size_keys(model.laws, effect)
        own = [P + k for k, f in enumerate(fit.free) if f.effect == i and f.key in keys]
        if not own or effect.id in OF_TIME:
            continue
        sizes = np.array([value_of(fit.point, fit.free[k - P]) for k in own])
        change = J[:, own] @ sizes
        size = float(change @ change)
        varied = shapes * change[:, None]
        varied = varied - every @ (every.T @ varied)
        part = orthonormal_of_many_rows(varied, LEAST_DIRECTION * float(np.linalg.norm(change)))
        d = part @ (part.T @ left)
        shown = HeldOut.of(left, left - d)
        gain = max(0.0, shown.gain) / shown.spread
        share = np.sqrt(max(0.0, shown.gain - part.shape[1] * shown.spread) / max(size, 1e-300))
        p = chance(gain, part.shape[1])
        if p < CHANCE and share > alike:
            out.append(Unsteady(effect.name, float(share), p))
    return sorted(out, key=lambda x: -x.share)
