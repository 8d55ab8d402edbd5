"""An elastic run between its samples: what a logger reads whose clock is off.

Wheels ring on their mounts faster than half of many sampling rates, so no spline through samples
knows their course in between.  The modes' states at the samples and the finer inputs do.
"""

import functools
import math
from collections.abc import Callable, Mapping

import numpy as np

from ..runs import Run
from .elastic import OUTPUTS
from .modes import (
    KEPT,
    OutputModes,
    acts,
    direct,
    forced,
    hold_weights,
    observe,
    propagate,
    real_pairs,
    real_rows,
    weighted,
)


def finer(late: Callable[[float], np.ndarray], step: float, parts: int) -> np.ndarray:
    """Values at `parts` points a sample, of what gives them (t, c) so many s `late`."""
    now = late(0.0)
    out = np.empty((parts * (len(now) - 1) + 1, now.shape[1]))
    out[::parts] = now
    for k in range(1, parts):
        out[parts - k :: parts] = late(k * step / parts)[1:]
    return out


def late_outputs(
    m: OutputModes, run: Run, z: np.ndarray, inputs: Mapping[str, np.ndarray], late: float
) -> np.ndarray:
    """dR and a (samples, 6) `late` s, of either sign, before every sample; `z` (samples, k).

    `inputs` by name (points, c) are linear between their points, a whole number of them a sample.
    Before the start all is as at the first sample; behind the end inputs go on evenly.
    """
    back, part, count = behind(run, late)
    inputs = {k: continued(values, run.samples - 1, count) for k, values in inputs.items()}
    z = _led_on(m, run, z, inputs, count)
    out = observe(m, z, OUTPUTS, part * run.step)
    for name, values in inputs.items():
        if acts(values):
            points = (len(values) - 1) // count
            out += weighted(values, count, _shown_within(m, name, run.step, points, part))
    first = np.repeat(_first(m, z, inputs), back, axis=0) if back > 0 else out[:0]
    return np.concatenate([first, out[max(0, -back) :]])[: run.samples]


def behind(run: Run, late: float) -> tuple[int, float, int]:
    """Where `late` s before a sample is: so many samples back, and a part of one on from there.

    And how many intervals of the run, led on behind its end where need be, hold such places.
    """
    back = math.ceil(late / run.step)
    return back, back - late / run.step, run.samples - 1 + max(0, 1 - back)


def continued(values: np.ndarray, intervals: int, count: int) -> np.ndarray:
    """An input (points, c) over `intervals` samples led on evenly to `count`."""
    more = (len(values) - 1) // intervals * (count - intervals)
    if not more:
        return values
    slope = values[-1] - values[-2]
    return np.concatenate([values, values[-1] + slope * np.arange(1, more + 1)[:, None]])


def _led_on(m: OutputModes, run: Run, z, inputs, count: int) -> np.ndarray:
    """The states (count, k) at the samples that begin an interval."""
    more = count - len(z)
    if more <= 0:
        return z[:count]
    last = {k: v[-1 - (more + 1) * ((len(v) - 1) // count) :] for k, v in inputs.items()}
    last = {k: v[: 1 + more * ((len(v) - 1) // (more + 1))] for k, v in last.items()}
    return np.concatenate([z, propagate(m, run.step, forced(m, run.step, more, **last), z[-1])[1:]])


@functools.lru_cache(KEPT)
def _shown_within(m: OutputModes, name: str, step: float, points: int, part: float) -> np.ndarray:
    """Weights (near points, c, 6) of an input's points: what it changes in dR and a at `part`.

    By what it pushes until then, and directly.  Not to be written to.
    """
    at, share = _place(part, points)
    out = _pushes(m, name, step, points, part) @ real_rows(m, OUTPUTS)
    D = m.out(OUTPUTS)[1][:, m.inputs[name]].T
    out[at] += (1 - share) * D
    out[at + 1] += share * D
    return out


def pushed_within(m: OutputModes, name: str, values, step: float, count: int, part: float):
    """What an input (points, c) pushes (count, 2 k) over the first `part` of every sample.

    Exact for inputs that are linear between their points, as `forced` is over whole samples.
    """
    return weighted(values, count, _pushes(m, name, step, (len(values) - 1) // count, part))


def _pushes(m: OutputModes, name: str, step: float, points: int, part: float) -> np.ndarray:
    """Weights (near points, c, 2 k) of an input's points over the first `part` of a sample."""
    weights = part_weights(m.rates, step, points, part)
    return real_pairs(weights[:, None] * m.gains[:, m.inputs[name]].T)


def part_weights(rates: np.ndarray, step: float, points: int, part: float) -> np.ndarray:
    """Weights (near points, k) of an input's `points` a sample over the first `part` of a sample.

    As `hold_weights` are those over whole ones.
    """
    whole, share = _place(part, points)
    weights = np.zeros((whole + 2, len(rates)), complex)
    rest = share * step / points  # s, of the span in which the part ends
    if whole:
        inside = hold_weights(rates, whole * step / points, whole)
        weights[: whole + 1] = np.exp(rates * rest) * inside
    begin, end = hold_weights(rates, rest, 1)
    weights[whole] += begin + (1 - share) * end
    weights[whole + 1] += share * end
    return weights


def _place(part: float, points: int) -> tuple[int, float]:
    """(whole spans, share of the next one) in a part of a sample of so many points."""
    whole = min(int(part * points), points - 1)
    return whole, part * points - whole


def between(values: np.ndarray, count: int, part: float) -> np.ndarray:
    """An input (points, c) at a part of a sample behind each of `count` samples."""
    points = (len(values) - 1) // count
    at, share = _place(part, points)
    before, after = values[at::points][:count], values[at + 1 :: points][:count]
    return before + share * (after - before)


def _first(m: OutputModes, z, inputs) -> np.ndarray:
    """dR and a (1, 6) at the first sample."""
    out = observe(m, z[:1], OUTPUTS)
    for name, values in inputs.items():
        out = out + direct(m, OUTPUTS, name, lambda begin=values[:1]: begin)
    return out
