"""One varied quantity: `wheel.roundness=0.1:0.6:50`, `log:5e4:1e6:40`, `1,2,3`, `low:high`."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from .._errors import InputError
from ..rig import as_number
from ._range import Ranges

FORMS = "low:high:count, log:low:high:count, a list a,b,c, or low:high for lhs and sobol"


@dataclasses.dataclass(frozen=True)
class SweepAxis:
    """A path, its unit and either levels (`values`, or `count` from `low` to `high`) or a range."""

    path: str
    unit: str
    low: float
    high: float
    count: int | None = None
    log: bool = False
    values: tuple[float, ...] | None = None

    def level(self, k) -> np.ndarray:
        """Values at the levels `k`, 0-based."""
        k = np.asarray(k)
        if self.values is not None:
            return np.asarray(self.values)[k]
        last = max((self.count or 1) - 1, 1)
        return np.where(k == last, self.high, self._between(np.asarray(k / last)))

    def quantile(self, share) -> np.ndarray:
        """Values at `share` in [0, 1) of the range, or of the list."""
        share = np.asarray(share)
        if self.values is not None:
            return np.asarray(self.values)[(share * len(self.values)).astype(int)]
        return self._between(share)

    def _between(self, share) -> np.ndarray:
        return Ranges.of([self]).value(share[..., None])[..., 0]

    def levels(self) -> np.ndarray:
        """Every level of an axis that has them."""
        return self.level(np.arange(self.count or 0))

    @property
    def text(self) -> str:
        """The axis as it is written behind `path=`, in SI units, without loss."""
        if self.values is not None:
            return ",".join(repr(v) for v in self.values)
        count = [] if self.count is None else [str(self.count)]
        return ":".join([*(["log"] if self.log else []), repr(self.low), repr(self.high), *count])


def split_vary(vary: Any) -> dict[str, Any]:
    """`{path: range}` from a mapping or from texts `path=range`; `InputError` for other texts."""
    if isinstance(vary, Mapping):
        return {str(path): given for path, given in vary.items()}  # of NumPy's words too
    ranges: dict[str, Any] = {}
    for text in [vary] if isinstance(vary, str) else vary:
        path, sign, rest = str(text).partition("=")
        if not sign or not path.strip() or not rest.strip():
            raise InputError(
                f"`vary` must read path=range with a range of {FORMS}, but is {text!r}."
            )
        if path.strip() in ranges:
            raise InputError(f"`{path.strip()}` is varied twice.")
        ranges[path.strip()] = rest.strip()
    return ranges


def read_axis(path: str, given: Any, unit: str) -> SweepAxis:
    """The axis that `given` asks for, in SI `unit`: text of `FORMS`, a level, or a list of them.

    A tuple is a list too: `(low, high, count)` are three levels.
    """
    try:
        if isinstance(given, str):
            return _from_text(path, given, unit)
        values = [given] if np.ndim(given) == 0 else list(given)
        return _from_list(path, [as_number(_plain(v), unit) for v in values], unit)
    except InputError:
        raise
    except ValueError as error:
        raise InputError(f"`{path}` {error}") from None


def _plain(value: Any) -> Any:
    return value.item() if isinstance(value, np.generic) or hasattr(value, "item") else value


def read_number(text: str, unit: str) -> float:
    """A number in SI from text, with or without a unit; `ValueError` as half a sentence."""
    try:
        value = float(text)
    except ValueError:
        return as_number(text, unit)
    return as_number(value, unit)


def _from_list(path: str, values: Sequence[float], unit: str) -> SweepAxis:
    if not values:
        raise InputError(f"`{path}` has an empty list of values.")
    if len(set(values)) < len(values):
        raise InputError(f"`{path}` lists a value twice.")
    return SweepAxis(path, unit, min(values), max(values), len(values), values=tuple(values))


def _from_text(path: str, text: str, unit: str) -> SweepAxis:
    parts = [part.strip() for part in text.split(":")]
    log = parts[0] == "log"
    parts = parts[1:] if log else parts
    if len(parts) == 1 and not log:
        return _from_list(path, [read_number(part, unit) for part in text.split(",")], unit)
    if len(parts) not in {2, 3}:
        raise InputError(f"`{path}` must be {FORMS}, but is {text!r}.")
    low, high = read_number(parts[0], unit), read_number(parts[1], unit)
    if not low < high:
        kind = "an empty" if low == high else "a reversed"
        raise InputError(f"`{path}` has {kind} range: {text!r} does not go from low to high.")
    if log and low <= 0:
        raise InputError(f"`{path}` must start above 0 on a log range, but starts at {low:g}.")
    count = None if len(parts) == 2 else _count(path, parts[2])
    return SweepAxis(path, unit, low, high, count, log)


def _count(path: str, text: str) -> int:
    if not text.isdigit() or int(text) < 2:
        raise InputError(
            f"`{path}` needs at least 2 levels, a whole number, but has {text!r}; "
            "one value is written without colons."
        )
    return int(text)
