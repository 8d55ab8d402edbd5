"""Stamps of date and time of day as seconds from the first."""

import datetime
import re
from collections.abc import Sequence

import numpy as np

STAMP = re.compile(
    r"(?:(?P<y>\d{4})[-/.](?P<m>\d\d?)[-/.](?P<d>\d\d?)|(?P<d2>\d\d?)[-/.](?P<m2>\d\d?)[-/.](?P<y2>\d{4}))?"
    r"[T ]*(?P<H>\d\d?):(?P<M>\d\d):(?P<S>\d\d(?:[.,]\d+)?)\s*(?P<late>[AaPp][Mm])?"
    r"\s*(?:Z|UTC|[+-]\d\d:?\d\d)?\Z"
)
DAY = 86400.0  # s


def is_stamp(text: str) -> bool:
    """Whether a cell is a date with a time of day, or a time of day."""
    return STAMP.match(text.strip().strip("\"'")) is not None


def seconds_of(texts: Sequence[str]) -> np.ndarray:
    """Seconds (t,) from the first stamp; NaN where there is none.

    A time of day alone goes on over midnight.  Of 3/4/2026 either may be the month: the order is
    that which gives dates in all rows, and of two the shorter log.
    """
    matches = [STAMP.match(text.strip().strip("\"'")) for text in texts]
    good = np.array([m is not None for m in matches])
    out = np.full(len(texts), np.nan)
    if not good.any():
        return out
    stamps = [m for m in matches if m is not None]
    second = np.array([_second(m) for m in stamps])
    days = [np.array([_day(m, swapped) for m in stamps]) for swapped in (False, True)]
    lengths = [np.inf if np.isnan(d).any() else float(np.ptp(d)) for d in days]
    day = days[int(lengths[1] < lengths[0])]
    since = DAY * (day - day[0]) + (second - second[0])
    if np.all(day == 0):
        since += DAY * np.cumsum(np.diff(since, prepend=0.0) < -DAY / 2)
    out[good] = since
    return out


def seconds_from(stamps: np.ndarray) -> np.ndarray:
    """Seconds (t,) from the first of numpy's dates or durations."""
    since = stamps - stamps[0] if stamps.dtype.kind == "M" else stamps
    out = since.astype("timedelta64[ns]").astype(float) * 1e-9
    out[np.isnat(since)] = np.nan
    return out


def _second(match: re.Match) -> float:
    """Seconds of a stamp's day."""
    hour, late = int(match["H"]), (match["late"] or "").lower()
    hour = hour % 12 + 12 * (late == "pm") if late else hour
    return 3600 * hour + 60 * int(match["M"]) + float(match["S"].replace(",", "."))


def _day(match: re.Match, swapped: bool) -> float:
    """Number of a stamp's day; 0 where it has none, NaN where there is no such day."""
    year, month, day = (match[k] or match[f"{k}2"] for k in "ymd")
    if year is None:
        return 0.0
    if swapped and match["y2"]:
        month, day = day, month
    try:
        return float(datetime.date(int(year), int(month), int(day)).toordinal())
    except ValueError:
        return np.nan
