"""A run as tables: `run.summary()`, `run.to_dataframe()`."""

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from .._html import html_table
from .._text import scaled
from .._time_mean import time_mean
from ._run import AbstractRun


class ChannelRange(NamedTuple):
    """Least, largest and RMS of one channel over the samples that are finite, SI."""

    channel: str
    unit: str
    least: float
    largest: float
    rms: float

    def cells(self) -> tuple[str, ...]:
        """The numbers in a unit that reads well, and that unit."""
        factor, unit = scaled(max(abs(self.least), abs(self.largest)), self.unit)
        values = (f"{factor * x:.4g}" for x in (self.least, self.largest, self.rms))
        return (self.channel, *values, unit)


class RunSummary(NamedTuple):
    """How a run ended and the range of every channel; prints as a table."""

    message: str
    channels: tuple[ChannelRange, ...]

    HEADER = ("channel", "least", "largest", "RMS", "unit")

    def __repr__(self) -> str:
        rows = [self.HEADER, *(row.cells() for row in self.channels)]
        widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
        lines = (
            "  ".join(
                [f"{row[0]:{widths[0]}}", *map("{:>{}}".format, row[1:4], widths[1:4]), row[4]]
            )
            for row in rows
        )
        return "\n".join([self.message, *(line.rstrip() for line in lines)])

    def _repr_html_(self) -> str:
        return html_table(self.message, [row.cells() for row in self.channels], self.HEADER)


def summary(run: AbstractRun) -> RunSummary:
    """The range of every channel and column of `run`."""
    ranges, t = [], np.asarray(run.t)
    for name, values in columns(run):
        good = np.isfinite(values)
        finite = values[good]
        if len(finite):
            square = time_mean(t[good], finite**2, np)
            figures = (finite.min(), finite.max(), np.sqrt(square))
            ranges.append(ChannelRange(name, run.unit(name), *map(float, figures)))
    return RunSummary(run.message(), tuple(ranges))


def columns(run: AbstractRun) -> Iterator[tuple[str, np.ndarray]]:
    """Every column of every channel: dR_x, theta_1, as recordings name them, and `distance`."""
    for channel in run.UNITS:
        values = np.asarray(getattr(run, channel))
        for i, end in enumerate(() if values.ndim == 1 else run.ends(channel)):
            yield f"{channel}_{end}", values[:, i]
    yield "distance", np.asarray(run.distance)


def to_dataframe(run: AbstractRun) -> Any:
    """A `pandas.DataFrame` with the time as index."""
    import pandas

    return pandas.DataFrame(dict(columns(run)), index=pandas.Index(np.asarray(run.t), name="t"))
