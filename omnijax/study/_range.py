"""A range of one quantity, `low` to `high`, on linear or log scale: share of it <-> value."""

from collections.abc import Sequence
from typing import NamedTuple, Protocol

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float


class Range(Protocol):
    """Anything with bounds and a scale."""

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
        """Whether shares are equal ratios instead of equal steps."""
        ...


class Ranges(NamedTuple):
    """Bounds of d quantities as arrays, on the scale of each; the one map of shares to values."""

    low: Float[np.ndarray, " d"]
    span: Float[np.ndarray, " d"]
    log: np.ndarray

    @classmethod
    def of(cls, ranges: Sequence[Range]) -> "Ranges":
        """The arrays of `ranges`."""
        log = np.array([x.log for x in ranges], bool)
        bounds = np.array([[x.low, x.high] for x in ranges], float).reshape(-1, 2)
        bounds = np.where(log[:, None], np.log(np.where(log[:, None], bounds, 1.0)), bounds)
        return cls(bounds[:, 0], bounds[:, 1] - bounds[:, 0], log)

    def value(self, share: Float[Array, "... d"]) -> Float[Array, "... d"]:
        """Values at shares in [0, 1]: low + span s, or its exponential; differentiable."""
        y = self.low + self.span * share
        return jnp.where(self.log, jnp.exp(jnp.where(self.log, y, 0.0)), y)

    def share(self, value: Float[Array, "... d"]) -> Float[Array, "... d"]:
        """Shares at values."""
        y = jnp.where(self.log, jnp.log(jnp.where(self.log, value, 1.0)), value)
        return (y - self.low) / self.span
