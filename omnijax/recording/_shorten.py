"""Less of a run: one sample in so many, or its first seconds."""

import dataclasses

import numpy as np
from scipy.interpolate import make_lsq_spline
from scipy.ndimage import maximum_filter1d

from .._errors import InputError
from ._columns import INPUTS, group_of
from ._recording import Fault, Recording


def thinned(run: Recording, every: int) -> Recording:
    """One sample in `every` of a run's grid.

    Outputs stay as they were measured: a filter would smear what a model predicts at one moment.
    Inputs become the broken line through the kept times that is nearest to the measured one (least
    squares), so that no impulse is lost.

    Raises `InputError` where `every` is below 1 or leaves less than two samples.
    """
    if every == 1:
        return run
    even = run.filled()
    kept = np.flatnonzero((np.arange(len(even)) % max(every, 1) == 0) & (even.rows > 0))
    if every < 1 or len(kept) < 2:
        raise InputError(
            f"{run.path.name}: one sample in {every} cannot be kept: 1 to {len(even) - 1} is "
            "allowed."
        )
    grid = (even.time - even.time[0])[: kept[-1] + 1]
    knots = grid[::every]
    knots = np.concatenate([knots[:1], knots, knots[-1:]])

    def column(name: str, values: np.ndarray) -> np.ndarray:
        if group_of(name) not in INPUTS:
            return values[kept]
        return make_lsq_spline(grid, values[: len(grid)], knots, k=1)(grid[kept])

    what = f"{len(run)} samples at {1 / run.step:g} Hz"
    use = f"one in {every} is compared; the inputs between are averaged"
    return dataclasses.replace(
        _part(even, kept, Fault(run.path.name, "", (), "thinned", what, use)),
        channels={name: column(name, values) for name, values in even.channels.items()},
        lost=maximum_filter1d(even.lost, 2 * every - 1)[kept],  # of the inputs between them too
    )


def first(run: Recording, seconds: float) -> Recording:
    """The first `seconds` of a run.

    Raises `InputError` where less than two samples lie in them.
    """
    kept = np.flatnonzero(run.time - run.time[0] <= seconds * (1 + 1e-9))
    if len(kept) == len(run):
        return run
    if len(kept) < 2:
        raise InputError(
            f"{run.path.name}: the first {seconds:g} s hold no two samples: more than "
            f"{run.step:g} s are needed."
        )
    what, use = f"{run.duration:g} s long", f"its first {seconds:g} s are used"
    return _part(run, kept, Fault(run.path.name, "", (), "first part", what, use))


def _part(run: Recording, kept: np.ndarray, said: Fault) -> Recording:
    """The samples `kept` of a run, and what is to be said of it."""
    return dataclasses.replace(
        run, time=run.time[kept], rows=run.rows[kept], lost=run.lost[kept],
        channels={name: values[kept] for name, values in run.channels.items()},
        faults=[*run.faults, said],
    )  # fmt: skip
