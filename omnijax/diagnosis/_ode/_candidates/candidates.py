"""Candidates of a machine: every law at every place, shape constants over the data's scales."""

import dataclasses
import itertools
import math
from collections.abc import Mapping, Sequence

import numpy as np

from ....machine import Axis, PlacedLaw
from ..._search import Candidate, strengths, unit_laws
from ..._settings import SETTINGS
from .._rows import OdeRun, smoothed, states

SCALE_SHARES = SETTINGS.free_candidates.scale_shares
BELOW_LIMIT = SETTINGS.free_candidates.below_limit
SLOW_TIMES = SETTINGS.free_candidates.slow_times
LIMIT_SEEN = SETTINGS.free_candidates.limit_seen
LAGS = SETTINGS.free_candidates.lags
DELAYS = SETTINGS.free_candidates.delays
ANY_VALUES = SETTINGS.free_candidates.any_values
MOVED_TIME = SETTINGS.free_candidates.moved_time
VALUES_BETWEEN = SETTINGS.candidates.values_between


@dataclasses.dataclass(frozen=True)
class Scales:
    """Typical sizes of the data, for the ladders of shape constants."""

    speed: float
    twist: float  # of what a spring of the drive, or the one that holds the axis, is bent by
    step: float  # the least
    # sizes of the commanded torque below which it is for `BELOW_LIMIT`, `LIMIT_SEEN`
    torques: np.ndarray
    reach: float  # the largest that was measured

    @staticmethod
    def of(machine, runs: Sequence[OdeRun], cutoff: float) -> "Scales":
        """RMS of speed and of the springs' twist, sizes of the torque, largest value."""
        parts = [smoothed(r.outputs["position"], r.step, cutoff) for r in runs]
        speed = np.sqrt(np.mean(np.concatenate([v**2 for _, v, _ in parts])))
        twists = [_twist(machine, q, v, r.step) for r, (q, v, _) in zip(runs, parts, strict=True)]
        twist = np.sqrt(np.mean(np.concatenate([(x - x.mean()) ** 2 for x in twists])))
        torque = np.concatenate([
            np.abs(commanded(machine, q, v, r.inputs))
            for r, (q, v, _) in zip(runs, parts, strict=True)
        ])  # fmt: skip
        torques = np.quantile(torque, (*BELOW_LIMIT, LIMIT_SEEN))
        reach = max(float(np.max(np.abs(r.shown))) for r in runs)
        step = min(r.step for r in runs)
        return Scales(float(speed), float(twist), step, torques, reach)

    def ladder(self, port: str, key: str, parameter) -> list[float]:
        """Values to try of a shape constant of a law at a port."""
        limits = list(self.torques[:-1]) if port == "actuator" else [self.reach]
        known = {
            "width": [x * self.speed for x in SCALE_SHARES],
            "speed": [x * self.speed for x in SCALE_SHARES],
            "gap": [x * self.twist for x in SCALE_SHARES], "limit": limits,
            "tau": self._times(LAGS), "delay": self._times(DELAYS),
        }  # fmt: skip
        if key in known:
            return known[key]
        if math.isfinite(parameter.low) and math.isfinite(parameter.high):
            return list(np.linspace(parameter.low, parameter.high, VALUES_BETWEEN + 2)[1:-1])
        return list(ANY_VALUES)

    def _times(self, samples: Sequence[float]) -> list[float]:
        """Times to try, s: some samples, and longer ones of `SLOW_TIMES`."""
        short = [self.step * x for x in samples]
        return short + [t for t in SLOW_TIMES if t > 2 * short[-1]]


def _twist(machine, q, v, step) -> np.ndarray:
    """Deflection (t,) of the drive to a second inertia, as the stated axis has it; else q."""
    if not isinstance(machine, Axis) or machine.second_inertia is None:
        return q
    return q - np.asarray(states(machine, q, v, step))[:, 2]


def commanded(machine, q, v, inputs) -> np.ndarray:
    """Torque (t,) that the motor of an axis is to deliver; else the input as it is."""
    return np.asarray(machine.motor(q, v, inputs) if isinstance(machine, Axis) else inputs["input"])


def machine_candidates(
    model, scales: Scales, orders: Mapping[tuple[str, str], Sequence[float]]
) -> list:
    """Every candidate; `orders` gives by port and place the orders that stand out."""
    out = []
    for id, place in model.places:
        law = model.laws[id]
        out += _of_law(law, place, scales, orders.get((law.port, place), ()))
    return out


def _of_law(law, place, scales: Scales, orders) -> list[Candidate]:
    fields = law.__dataclass_fields__
    shapes = [
        k for k, p in law.parameters.items()
        if not p.linear and k not in ("phase", "order") and (
            k == "width" or fields[k].default is dataclasses.MISSING)
    ]  # fmt: skip
    ladders = [scales.ladder(law.port, k, law.parameters[k]) for k in shapes]
    ladders += [list(orders)] if "order" in law.parameters else []
    keys = [*shapes, *(["order"] if "order" in law.parameters else [])]
    out = []
    for values in itertools.product(*ladders):
        fixed = dict(zip(keys, map(float, values), strict=True))
        units, decode = unit_laws(law, fixed)
        columns = tuple(PlacedLaw(unit, place) for unit in units)
        note = ", ".join(f"{k} {v:.3g}" for k, v in fixed.items())
        trials = len(orders) if "order" in fixed else 1
        if not strengths(law) and shapes in (["tau"], ["delay"]):
            decode = _time_of(shapes[0], fixed[shapes[0]])
        out.append(Candidate(law.id, place, columns, decode, note, max(1, trials)))
    return out


def _time_of(key: str, tried: float):
    """A time from its column at the one that was tried: what it changes grows with it."""
    return lambda c: {key: tried * min(max(float(c[0]), MOVED_TIME), 1 / MOVED_TIME)}
