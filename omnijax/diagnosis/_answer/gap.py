"""The gap: what is left between measured and predicted, by output group, against the noise."""

import numpy as np

from .evidence import AbstractEvidence
from .named_effect import OutputGap
from .shown import Shown, by_group
from .verdict import Columns, squares

UNITS = {"dR": "m", "theta": "rad", "Omega": "rad/s", "a": "m/s^2"}


def gaps(evidence: AbstractEvidence, shown: Shown, before: Columns, after: Columns):
    """`Gap` of every group on the held-out runs, RMS over its channels; the noise is as shown."""
    first, last = squares(before), squares(after)
    out = {}
    for group, channels in by_group([c for c in first if c in last]).items():
        sigma = {c: evidence.assumed(c)["sigma"] for c in channels}
        floor = [sigma[c] * shown.ratio(c, "held-out") for c in channels]
        start = [sigma[c] * np.sqrt(first[c][0] / first[c][1]) for c in channels]
        end = [sigma[c] * np.sqrt(last[c][0] / last[c][1]) for c in channels]
        out[group] = OutputGap(_rms(floor), _rms(start), _rms(end), evidence.unit_of(group))
    return out


def _rms(values: list[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))
