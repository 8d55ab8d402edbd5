"""Angles that begin anew after a turn: unwrapped where that can be told surely.

A wrapped angle stays within its modulus: it leaves at one end and comes back at the other.  With
the modulus added at such a jump the angle goes on smoothly.  A column that exceeds the modulus, or
jumps by another size, is not wrapped and stays as it is.
"""

import functools
from typing import NamedTuple

import numpy as np

from ._columns import group_of
from ._grid import LATE
from ._recording import Fault, spans

TURNS = {"rad": 2 * np.pi, "deg": 360.0}  # a column without a unit may be in degrees
FAST = 1 / 3  # of the modulus; where an angle moves on faster, its way round is not known
AROUND = 8  # samples before and after a jump, by which the angle moves on as usual
USUAL = 3.0  # times the median change of speed around a jump that its own may be
NEAR = 1 / 12  # of a turn (of a counter's range), within which the angle moves on at a jump
OVER = 1.02  # of the modulus that the angle may take, with noise
BACK = 3  # samples within which a bad reading is over
OFTEN = 5  # returns within as few samples, of a wheel that rests where the angle begins anew
SEVERAL = 3  # jumps that stay, by which a modulus of other than one turn is told
NOISE = 8.0  # times the median change of speed, which noise alone makes at some of many jumps
LEAST = 20  # samples; fewer do not tell how an angle moves
BITS = range(8, 33)  # of a counter
ELSEWHERE = 4  # times a missing stretch that what turned over as long a one is asked elsewhere


class Unwound(NamedTuple):
    """An angle (t,) that was wrapped as one that goes on, NaN where its turns are not known.

    `modulus` and angle are in the unit of the column; `jumps` are the samples (t,) that begin anew.
    """

    angle: np.ndarray
    modulus: float
    jumps: np.ndarray
    lost: np.ndarray

    @property
    def words(self) -> str:
        """The modulus: `one turn`, `3 turns`, `360`."""
        return _said(self.modulus)


def unwrap(file: str, channels: dict[str, np.ndarray], time, rows: np.ndarray) -> list[Fault]:
    """Unwrap in place the angles that are wrapped, and say so."""
    faults = []
    for column, values in channels.items():
        if group_of(column) == "theta":
            faults += _unwrapped(file, column, values, np.asarray(time), rows)
    return faults


def _unwrapped(file: str, column: str, values: np.ndarray, time, rows) -> list[Fault]:
    told = unwound(values, time)
    if told is None:
        return []
    values[:] = told.angle
    n = int(told.jumps.sum())
    what = f"the angle jumps by {told.words} {n} time{'s' if n > 1 else ''} (it is wrapped)"
    faults = [Fault(file, column, spans(told.jumps, rows), "wrapped", what, "it is unwrapped")]
    if told.lost.any():
        what = "how often a wrapped angle turned in the missing stretch beside is not known"
        use = "these samples are not used"
        faults.append(Fault(file, column, spans(told.lost, rows), "wrapped", what, use))
    return faults


def unwound(values: np.ndarray, time: np.ndarray) -> Unwound | None:
    """An angle (t,), NaN where it is missing, at times (t,) in s without its turns' beginnings.

    None if it is not wrapped, or if that is uncertain.
    """
    at = np.flatnonzero(np.isfinite(values))
    if len(at) < LEAST:
        return None
    known, steps = values[at], np.diff(time[at])
    beside = steps <= LATE * np.median(steps)  # others lie across a gap
    change, width = np.diff(known), float(np.ptp(known))
    jumps = beside & (np.abs(change) > width / 2)
    if not jumps.any():
        return None
    modulus = next(
        (
            modulus
            for modulus, near in _moduli(known, change, jumps)
            if _is_wrapped(known, change, beside, jumps, modulus, near)
        ),
        None,
    )
    if modulus is None:
        return None
    turns = np.where(jumps, -np.sign(change), 0.0)
    across, sure = _across(change + modulus * turns, time[at], beside, modulus)
    known = known + modulus * np.concatenate([[0.0], np.cumsum(np.where(beside, turns, across))])
    kept = _longest(sure)
    angle, anew, lost = np.full(len(values), np.nan), *np.zeros((2, len(values)), bool)
    angle[at[kept]], anew[at[1:][jumps]], lost[at[~kept]] = known[kept], True, True
    return Unwound(angle, modulus, anew, lost)


def _moduli(known: np.ndarray, change: np.ndarray, jumps: np.ndarray) -> list[tuple[float, float]]:
    """What the angle may be wrapped at, and how near to it jumps are then.

    Bad readings, which are soon over, do not count.  One jump that stays is enough to tell a single
    turn; several turns, or a counter's range, need some jumps, and an angle that fills the range.
    """
    at, size = np.flatnonzero(jumps), float(np.median(np.abs(change[jumps])))
    soon = (np.diff(at) <= BACK) & (np.sign(change[at[1:]]) != np.sign(change[at[:-1]]))
    stays = len(at) - int((np.append(soon, False) | np.append(False, soon)).sum())
    if not stays and soon.sum() < OFTEN:
        return []
    moduli = [(turn, NEAR * turn) for turn in TURNS.values()]
    values = size * np.unique(np.round(known / size, 9))
    gaps = np.diff(values)
    if stays < SEVERAL or gaps.max() > FAST * size:
        return moduli
    moduli += [(turn * np.ceil(np.ptp(known) / turn), NEAR * turn) for turn in TURNS.values()]
    count = float(np.median(gaps[gaps < 1.5 * gaps.min()]))  # one of a counter
    count = gaps.sum() / np.rint(gaps / count).sum()
    if np.abs(gaps / count - np.rint(gaps / count)).max() < 0.05:
        moduli += [(count * 2.0**bits, NEAR * count * 2.0**bits) for bits in BITS]
    return moduli


def _is_wrapped(known, change, beside, jumps, modulus: float, near: float) -> bool:
    """Whether the angle, once the modulus is added at its jumps, moves on there as around them."""
    if len(np.unique(known)) < LEAST / 2 or np.ptp(known) > OVER * modulus:
        return False
    if np.abs(change[beside & ~jumps]).max() > FAST * modulus:
        return False
    on = change - np.where(jumps, np.sign(change) * modulus, 0.0)
    if np.abs(on[jumps]).max() > FAST * modulus:
        return False
    bends, own = np.abs(np.diff(on)), jumps[1:] | jumps[:-1]
    usable = beside[1:] & beside[:-1]
    calm = usable & ~own
    if calm.sum() < LEAST / 2:
        return False
    count = np.abs(change[beside & ~jumps])  # a rotary encoder's moves by whole ones
    count = float(np.min(count[count > 1e-8 * modulus], initial=FAST * modulus))
    # noise about the end of the range makes many jumps, and fewer small changes between them
    median = min(np.median(bends[usable]), 2 * np.median(bends[calm]))
    slack = NOISE * float(median) + USUAL * count + 1e-7 * modulus
    for k in np.flatnonzero(usable & own):
        around = slice(max(k - AROUND, 0), k + AROUND + 1)
        beside_it = bends[around][calm[around]]
        usual = float(np.median(beside_it)) if len(beside_it) else 0.0
        if bends[k] > min(USUAL * usual + slack, near):
            return False
    return True


def _across(on: np.ndarray, time: np.ndarray, beside: np.ndarray, modulus: float):
    """Turns to be added over missing stretches, and where they are sure.

    Over a short gap the angle moves by less than `FAST`, as between neighbours.  The turns in a
    longer gap follow from the speeds on both sides, if that prediction holds over equally long
    stretches elsewhere in the record.
    """
    turns, sure = np.zeros(len(on)), beside.copy()
    angle = np.concatenate([[0.0], np.cumsum(np.where(beside, on, 0.0))])
    piece = np.concatenate([[0], np.cumsum(~beside)])
    wide = np.rint(np.diff(time) / np.median(np.diff(time))).astype(int)
    most = np.abs(on[beside]).max()

    @functools.cache
    def error(samples: int) -> float:
        """The largest error elsewhere in the record; infinite with too few stretches to compare."""
        begin = np.arange(AROUND, len(time) - AROUND - samples)
        begin = begin[piece[begin - AROUND] == piece[begin + samples + AROUND]]
        if len(begin) < ELSEWHERE * samples:
            return np.inf
        end = begin + samples
        return float(np.abs(_told(angle, time, begin, end) - angle[end] + angle[begin]).max())

    for k in np.flatnonzero(~beside):
        if most * wide[k] < FAST * modulus:
            turns[k], sure[k] = -np.rint(on[k] / modulus), True
            continue
        whole = AROUND <= k < len(time) - 1 - AROUND and (
            piece[k - AROUND] == piece[k] and piece[k + 1] == piece[k + 1 + AROUND]
        )
        if whole and error(int(wide[k])) < modulus / 8:
            turned = float(_told(angle, time, k, k + 1))
            turns[k] = np.rint((turned - on[k]) / modulus)
            sure[k] = abs(on[k] + turns[k] * modulus - turned) < modulus / 4
    return turns, sure


def _told(angle: np.ndarray, time: np.ndarray, begin, end):
    """The turn from each `begin` to its `end`, at the mean of the speeds before and after."""
    before = (angle[begin] - angle[begin - AROUND]) / (time[begin] - time[begin - AROUND])
    after = (angle[end + AROUND] - angle[end]) / (time[end + AROUND] - time[end])
    return (before + after) / 2 * (time[end] - time[begin])


def _longest(sure: np.ndarray) -> np.ndarray:
    """Mask of the samples of the longest piece that hang together."""
    piece = np.concatenate([[0], np.cumsum(~sure)])
    return piece == np.argmax(np.bincount(piece))


def _said(modulus: float) -> str:
    for unit, turn in TURNS.items():
        count = modulus / turn
        if abs(count - round(count)) < 1e-9 and count >= 1:
            turns = "one turn" if round(count) == 1 else f"{round(count)} turns"
            return turns if unit == "rad" else f"{modulus:g}"
    return f"{modulus:g} rad"
