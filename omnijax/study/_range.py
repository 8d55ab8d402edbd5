"""A range of one quantity, `low` to `high`, on linear or log scale: share of it <-> value.

x = low + (high - low) s         or         x = low (high/low)^s,        s in [0, 1]
"""

from collections.abc import Sequence
from typing import Any, NamedTuple, Protocol, runtime_checkable

import jax
import jax.numpy as jnp
import numpy as np


@runtime_checkable
class Range(Protocol):
    """Anything with bounds and a scale: an axis of a sweep, a variable, an uncertain input."""

    @property
    def low(self) -> float:
        """Least value."""
        ...

    @property
    def high(self) -> float:
        """Greatest value."""
        ...

    @property
    def log(self) -> bool:
        """Whether equal shares are equal ratios instead of equal steps."""
        ...


class Ranges(NamedTuple):
    """Bounds of d quantities as arrays (d,); the one map from shares to values and back.

    NumPy arrays stay NumPy arrays, JAX arrays may be traced and differentiated.
    """

    low: np.ndarray
    span: np.ndarray  # high - low, or ln(high/low)
    log: np.ndarray

    @classmethod
    def of(cls, ranges: Sequence[Range]) -> "Ranges":
        """The arrays of `ranges`."""
        low, high, log = (np.array([getattr(x, k) for x in ranges]) for k in ("low", "high", "log"))
        ratio = np.where(log, high, 1.0) / np.where(log, low, 1.0)
        return cls(low.astype(float), np.where(log, np.log(ratio), high - low), log.astype(bool))

    def value(self, share: Any) -> Any:
        """Values (..., d) at shares (..., d)."""
        xp = jnp if isinstance(share, jax.Array) else np
        step = self.span * share
        factor = xp.exp(xp.where(self.log, step, 0.0))
        return xp.where(self.log, self.low * factor, self.low + step)

    def share(self, value: Any) -> Any:
        """Shares (..., d) at values (..., d)."""
        xp = jnp if isinstance(value, jax.Array) else np
        ratio = xp.where(self.log, value, 1.0) / np.where(self.log, self.low, 1.0)
        return xp.where(self.log, xp.log(ratio), value - self.low) / self.span
