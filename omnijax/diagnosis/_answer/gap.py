"""The gap: what is left between measured and predicted, by output group, against the noise."""

import numpy as np

from .evidence import AbstractEvidence
from .named_effect import OutputGap
from .shown import Shown, by_group
from .verdict import Columns, squares

UNITS = {"dR": "m", "theta": "rad", "Omega": "rad/s", "a": "m/s^2"}


def gaps(evidence: AbstractEvidence, shown: Shown, before: Columns, after: Columns):
    """`Gap` of every group on the held-out runs, RMS over its channels; the noise is as shown.

    Where what is shown is an upper bound, so is what is left: the noise is no more than either.
    """
    first, last = (squares(in_units(evidence, runs)) for runs in (before, after))
    out = {}
    for group, channels in by_group([c for c in first if c in last]).items():
        floor = [shown.sigma(evidence, c, "held-out") for c in channels]
        start, end = (
            [np.sqrt(part[c][0] / part[c][1]) for c in channels] for part in (first, last)
        )
        floor = [
            min(f, *left) if c in shown.bounded else f
            for c, f, *left in zip(channels, floor, start, end, strict=True)
        ]
        out[group] = OutputGap(_rms(floor), _rms(start), _rms(end), evidence.unit_of(group))
    return out


def in_units(evidence: AbstractEvidence, held_out: Columns) -> Columns:
    """Columns of the held-out runs in their units: each run has a sigma of its own."""
    return [
        {c: evidence.sigma(c, "held-out", k) * x for c, x in run.items()}
        for k, run in enumerate(held_out)
    ]


def _rms(values: list[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))
