"""Runs that hold the same samples: one file is a copy, or a part, of the other."""

import dataclasses
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Generic, NamedTuple, TypeVar

import numpy as np

from ._recording import Recording

T = TypeVar("T")
DIGITS = 1e-5  # of a channel's largest value: six digits are printed, and rounded
OFF = 0.01  # of a step, by which times may differ
LARGE = 0.2  # share of a held-out run that a fitted one may not hold: it would confirm itself
PIECES = 10  # of a run, looked for one by one: twice as many as there are large shares in it
FEW = 8  # places where a piece may stand, from which each is looked at in full
SPREAD = (5**0.5 - 1) / 2  # multiples of the golden ratio are spread over 0 to 1


class RunSamples(NamedTuple):
    """What was measured (t,) and imposed at times in s, by channel."""

    time: np.ndarray
    measured: Mapping[str, np.ndarray]
    imposed: Mapping[str, np.ndarray]

    @property
    def columns(self) -> dict[str, np.ndarray]:
        """All channels."""
        return {**self.measured, **self.imposed}

    @property
    def step(self) -> float:
        """The usual step, s."""
        return float(np.median(np.diff(self.time)))

    def later(self, by: float) -> "RunSamples":
        """The same `by` s later."""
        return self._replace(time=self.time + by)


@dataclasses.dataclass(frozen=True)
class Copy(Generic[T]):
    """A run of which a `share` of the samples stands in another one."""

    run: T
    other: T
    share: float

    def said(self, name: str) -> str:
        """What it has of the other one, of that `name`, after its own name in a sentence."""
        if self.share == 1:
            return f"holds the same samples as {name}"
        return f"shares {100 * self.share:.0f} % of its samples with {name}"


def share_of_recording(run: Recording, whole: Recording) -> float:
    """Share of the samples of `run` that stand in `whole`, whatever their clocks say."""
    return share_in(_samples(run), _samples(whole))


def without_copies(
    runs: Sequence[T], is_held_out: Callable[[T], bool], share: Callable[[T, T], float]
) -> tuple[list[T], list[Copy[T]]]:
    """The runs that can be used together, and those left out with what they copy.

    Left out are fitted runs that stand in another one as a whole, the later of two equal ones, and
    held-out runs of which a `LARGE` share was fitted.  `share(run, other)` is that of `run`.
    """
    copies: dict[int, Copy[T]] = {}

    def look(k: int, others: Sequence[int], least: float) -> None:
        shares = {i: share(runs[k], runs[i]) for i in others if i != k and i not in copies}
        most = max(shares, key=shares.__getitem__, default=None)
        if most is not None and shares[most] >= least:
            copies[k] = Copy(runs[k], runs[most], shares[most])

    held = [k for k, run in enumerate(runs) if is_held_out(run)]
    train = [k for k in range(len(runs)) if k not in held]
    for k in reversed(train):
        look(k, train, 1.0)
    for k in held:
        look(k, train, LARGE)
    kept = [run for k, run in enumerate(runs) if k not in copies]
    return kept, [copies[k] for k in sorted(copies)]


def _samples(run: Recording) -> RunSamples:
    measured = {c for group in run.groups for c in run.channels if c.rpartition("_")[0] == group}
    sides = ({c: x for c, x in run.channels.items() if (c in measured) == own} for own in (1, 0))
    return RunSamples(run.time, *sides)


def share_in(run: RunSamples, whole: RunSamples) -> float:
    """Share of the samples of `run` that stand in `whole`, at the shift of its clock of the most.

    There the two agree, in the digits that files print, wherever both have a sample, and move.
    """
    if len(run.time) < 2 or len(whole.time) < 2:
        return 0.0
    return max(_shared(run.later(by), whole) for by in _shifts(run, whole))


def _shared(run: RunSamples, whole: RunSamples) -> float:
    """Share of the samples of `run` that stand in `whole` at their time; 0 where one differs."""
    step = whole.step
    at = np.searchsorted(whole.time, run.time - step / 2)
    at = np.clip(at, 0, len(whole.time) - 1)
    both = np.abs(whole.time[at] - run.time) <= OFF * step
    if not (_moves(run, both) and _moves(whole, at[both])):
        return 0.0
    pairs = _pairs(run, whole)
    alike = all(np.all(_alike(x[both], y[at[both]], _digits(x[both]))) for x, y in pairs)
    return float(np.mean(both)) if alike else 0.0


def _shifts(run: RunSamples, whole: RunSamples) -> Iterator[float]:
    """Times in s by which `run` may be earlier than its samples in `whole`.

    None, from both starts, and those of its pieces that stand there.
    """
    yield from (0.0, float(whole.time[0] - run.time[0]))
    every = max(1, round(run.step / whole.step))
    for piece in np.array_split(np.arange(len(run.time)), PIECES):
        if _moves(run, piece):
            for at in _places(run, piece, whole, every):
                yield float(whole.time[at] - run.time[piece[0]])


def _places(run: RunSamples, piece: np.ndarray, whole: RunSamples, every: int) -> np.ndarray:
    """Samples (k,) of `whole` at which a `piece` of `run`, its numbers (p,), may begin.

    One sample of the piece after the other is held against every `every`th of `whole`, in an order
    that is spread over the piece.
    """
    pairs = [(x, y, _digits(x)) for x, y in _pairs(run, whole)]
    at = np.arange(len(whole.time) - every * (len(piece) - 1))
    for k in np.argsort(SPREAD * np.arange(len(piece)) % 1):
        for x, y, off in pairs:
            at = at[_alike(x[piece[k]], y[at + every * k], off)]
        if len(at) <= FEW:
            break
    return at


def _pairs(run: RunSamples, whole: RunSamples) -> list[tuple[np.ndarray, np.ndarray]]:
    """The channels that both have, what was measured first."""
    theirs = whole.columns
    return [(x, theirs[c]) for c, x in run.columns.items() if c in theirs]


def _moves(run: RunSamples, which: np.ndarray) -> bool:
    """Whether a measured channel changes in some of the samples, their numbers or a mask."""
    return any(len(np.unique(x[which][np.isfinite(x[which])])) > 1 for x in run.measured.values())


def _digits(values: np.ndarray) -> float:
    """By how much two prints of a channel (t,) may differ."""
    return DIGITS * float(np.abs(values[np.isfinite(values)]).max(initial=0.0))


def _alike(values, others: np.ndarray, off: float) -> np.ndarray:
    """Whether values agree (t,); where one of them is missing, they are not asked."""
    return ~(np.abs(values - others) > off)
