"""Stretches of a held-out run that lie farther off than any noise of their channel."""

from typing import NamedTuple

import numpy as np
from scipy.special import erfc
from scipy.stats import false_discovery_control

from .._settings import SETTINGS
from .evidence import AbstractEvidence

RATE = SETTINGS.stretches.rate
FEWEST = SETTINGS.stretches.fewest


class Stretch(NamedTuple):
    """Neighbouring samples of one channel of a run, all off to one side.

    `first` and `last` in s, `largest` in 1-sigma of all that is left of the channel in that run,
    `off` the same in the channel's `unit`, by the noise that was assumed in all held-out runs.
    """

    run: str
    channel: str
    samples: int
    first: float
    last: float
    largest: float
    off: float
    unit: str

    def __str__(self) -> str:
        size = f"{self.largest:.1f} sigma (about {self.off:.2g} {self.unit})"
        span = f"from {self.first:.3f} to {self.last:.3f} s"
        return f"{self.channel} up to {size} off in {self.run}, for {self.samples} samples {span}"


def stretches(evidence: AbstractEvidence, columns: list[dict[str, np.ndarray]]) -> list[Stretch]:
    """Of held-out residuals by run and channel, in assumed sigma: the farthest off comes first.

    What noise of a channel can be is no more than the RMS of all that is left there.  A sample is
    off where a normal law of that level has not led to it, at `RATE` of false discoveries over the
    samples of all runs and channels, however they depend on each other: noise of any colour is
    granted (Benjamini and Yekutieli, 2001).  One or two samples are a shock or a bad reading.
    Empty where the evidence does not say what its runs are called.
    """
    runs = evidence.recorded()
    left = [
        (name, time, c, x, float(np.sqrt(np.nanmean(x**2))))
        for (name, time), run in zip(runs, columns if runs else [], strict=True)
        for c, x in run.items() if np.nan_to_num(x).any()
    ]  # fmt: skip
    if not left:
        return []
    far = [(name, time, c, x / rms, rms) for name, time, c, x, rms in left]
    known = [np.isfinite(z) for *_, z, _ in far]
    chances = np.concatenate(
        [erfc(np.abs(z[k]) / np.sqrt(2)) for (*_, z, _), k in zip(far, known, strict=True)]
    )
    stands = false_discovery_control(chances, method="by") <= RATE
    parts = np.split(stands, np.cumsum([k.sum() for k in known])[:-1])
    out = []
    for (name, time, c, z, rms), k, part in zip(far, known, parts, strict=True):
        side = np.zeros(len(z), int)
        side[k] = part * np.sign(z[k])
        assumed = evidence.assumed(c) if side.any() else {}
        for here in np.split(np.arange(len(z)), np.flatnonzero(np.diff(side)) + 1):
            if side[here[0]] and len(here) >= FEWEST:
                most = float(np.abs(z[here]).max())
                off = most * rms * assumed["sigma"]
                first, last = float(time[here[0]]), float(time[here[-1]])
                out.append(Stretch(name, c, len(here), first, last, most, off, assumed["unit"]))
    return sorted(out, key=lambda s: -s.largest)
