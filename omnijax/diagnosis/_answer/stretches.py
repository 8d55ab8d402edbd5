"""Stretches of a held-out run that lie farther off than any noise of their channel."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.special import erfc
from scipy.stats import false_discovery_control

from .._settings import SETTINGS
from .evidence import AbstractEvidence

Columns = list[dict[str, np.ndarray]]  # by held-out run and channel, in assumed sigma

DISCOVERY_RATE = SETTINGS.where.discovery_rate
FEWEST_SAMPLES = SETTINGS.stretches.fewest_samples


class Stretch(NamedTuple):
    """Neighbouring samples of one channel of a run, all off to one side.

    `first` and `last` in s; `largest` in units of the channel's RMS residual in that run; `off` the
    same in the channel's `unit`, by the assumed noise.  `closed` is the share of the stretch's
    power that the named effects have removed (0 if none is named).
    """

    run: str
    channel: str
    samples: int
    first: float
    last: float
    largest: float
    off: float
    unit: str
    closed: float

    def __str__(self) -> str:
        size = f"{self.largest:.1f} sigma (about {self.off:.2g} {self.unit})"
        span = f"from {self.first:.3f} to {self.last:.3f} s"
        return f"{self.channel} up to {size} off in {self.run}, for {self.samples} samples {span}"


def stretches(evidence: AbstractEvidence, before: Columns, after: Columns) -> list[Stretch]:
    """Of held-out residuals by run and channel, in assumed sigma: the farthest off comes first.

    `before` are the residuals without the named effects, `after` those with them.  The noise of a
    channel is taken as high as its RMS residual.  A sample is off where a normal law of that level
    does not reach it, at the false-discovery rate over all samples, runs and channels; the
    samples may depend on each other in any way, so noise may have any colour (Benjamini and
    Yekutieli, 2001).  Stretches of one or two samples count as a shock or a bad reading.
    Empty where the evidence does not say what its runs are called.
    """
    runs = evidence.recorded()
    left = [
        (k, c, x, before[k][c])
        for k, run in enumerate(after[: len(runs)])
        for c, x in run.items() if np.nan_to_num(x).any()
    ]  # fmt: skip
    sigma = [float(np.sqrt(np.nanmean(x**2))) for *_, x, _ in left]
    sides = _sides([x / rms for (*_, x, _), rms in zip(left, sigma, strict=True)])
    out = []
    for (k, c, x, bare), rms, side in zip(left, sigma, sides, strict=True):
        name, time = runs[k]
        for here in np.split(np.arange(len(x)), np.flatnonzero(np.diff(side)) + 1):
            if side[here[0]] and len(here) >= FEWEST_SAMPLES:
                most = float(np.abs(x[here]).max())
                closed = 1 - float(x[here] @ x[here]) / max(float(bare[here] @ bare[here]), 1e-300)
                out.append(
                    Stretch(name, c, len(here), float(time[here[0]]), float(time[here[-1]]),
                            most / rms, most * evidence.sigma(c, "held-out", k),
                            evidence.assumed(c)["unit"], closed)
                )  # fmt: skip
    return sorted(out, key=lambda s: -s.largest)


def _sides(left: Sequence[np.ndarray]) -> list[np.ndarray]:
    """To which side each sample of some series is off, in sigma: -1 or 1; 0 where it is not."""
    if not left:
        return []
    known = [np.isfinite(z) for z in left]
    chances = [erfc(np.abs(z[k]) / np.sqrt(2)) for z, k in zip(left, known, strict=True)]
    stands = false_discovery_control(np.concatenate(chances), method="by") <= DISCOVERY_RATE
    out = [np.zeros(len(z), int) for z in left]
    for side, z, k, part in zip(
        out, left, known, np.split(stands, np.cumsum([len(x) for x in chances])[:-1]), strict=True
    ):
        side[k] = part * np.sign(z[k])
    return out
