"""Runs that hold the same samples: one file is a copy, or a part, of the other."""

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple, TypeVar

import numpy as np

from ._recording import Recording

T = TypeVar("T")
DIGITS = 1e-5  # of a channel's largest value: six digits are printed, and rounded
OFF = 0.01  # of a step, by which times may differ


class RunSamples(NamedTuple):
    """What was measured (t,) and imposed at times in s, by channel."""

    time: np.ndarray
    measured: Mapping[str, np.ndarray]
    imposed: Mapping[str, np.ndarray]

    @property
    def columns(self) -> dict[str, np.ndarray]:
        """All channels."""
        return {**self.imposed, **self.measured}

    def later(self, by: float) -> "RunSamples":
        """The same `by` s later."""
        return self._replace(time=self.time + by)


def is_part(run: Recording, whole: Recording) -> bool:
    """Whether every sample of `run` stands in `whole`: at its time, or counted from both starts."""
    one, other = _samples(run), _samples(whole)
    return stands_in(one, other) or stands_in(one.later(-run.time[0]), other.later(-whole.time[0]))


def without_copies(
    runs: Sequence[T], is_held_out: Callable[[T], bool], is_copy: Callable[[T, T], bool]
) -> tuple[list[T], list[tuple[T, T]]]:
    """The runs without those held out that copy another one, and these with what they copy."""
    train, kept, copies = [run for run in runs if not is_held_out(run)], [], []
    for run in runs:
        held = is_held_out(run)
        copied = next((other for other in train if held and is_copy(run, other)), None)
        if copied is None:
            kept.append(run)
        else:
            copies.append((run, copied))
    return kept, copies


def _samples(run: Recording) -> RunSamples:
    measured = {c for group in run.groups for c in run.channels if c.rpartition("_")[0] == group}
    sides = ({c: x for c, x in run.channels.items() if (c in measured) == own} for own in (1, 0))
    return RunSamples(run.time, *sides)


def stands_in(run: RunSamples, whole: RunSamples) -> bool:
    """Whether `whole` has at the times of `run` what `run` has, in the digits that files print."""
    if len(run.time) > len(whole.time) or len(whole.time) < 2:
        return False
    step = float(np.median(np.diff(whole.time)))
    at = np.searchsorted(whole.time, run.time - step / 2)
    at = np.clip(at, 0, len(whole.time) - 1)
    if np.any(np.abs(whole.time[at] - run.time) > OFF * step):
        return False
    ours, theirs = run.columns, whole.columns
    moves = [c for c in run.measured if c in whole.measured and np.nanstd(ours[c]) > 0]
    return bool(moves) and all(_alike(ours[c], theirs[c][at]) for c in ours if c in theirs)


def _alike(values: np.ndarray, others: np.ndarray) -> bool:
    """Whether two columns agree; where one has no value, they are not asked."""
    known = np.isfinite(values) & np.isfinite(others)
    size = np.abs(values[known]).max(initial=0.0)
    return bool(np.all(np.abs(values[known] - others[known]) <= DIGITS * size))
