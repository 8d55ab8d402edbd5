"""A design problem: variables with bounds, an objective and limits, as one pure function.

    minimise  max_k f_k(x)  or  mean_k f_k(x)     subject to  g_j(x) <= limit_j,  low <= x <= high

The search runs over z with x = low + (high - low) s, s = (1 - cos z)/2, or the same on log scale.
Unlike a sigmoid this reaches the bounds at finite z, so that an optimum on a bound is found as fast
as one inside.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._errors import InputError
from ._batches import Order
from ._range import Ranges


class Variable(NamedTuple):
    """A quantity that the search may choose; `whole` ones take whole numbers."""

    name: str
    low: float
    high: float
    log: bool = False
    whole: bool = False
    unit: str = "1"
    start: float | None = None

    def quantile(self, share: np.ndarray) -> np.ndarray:
        """Values at shares in [0, 1] of the range, whole ones where the variable is."""
        values = Ranges.of([self]).value(np.asarray(share)[..., None])[..., 0]
        return np.round(values) if self.whole else values


class Limit(NamedTuple):
    """g <= bound, `scale` the size of g that matters; `sense` -1 where the user's form is >=.

    A scale of 0 stands for the size that g has where searches start: a bound of 0 says none.
    """

    name: str
    bound: float
    scale: float
    unit: str = "1"
    sense: int = 1

    @property
    def text(self) -> str:
        """The constraint as the user wrote it."""
        sign = "<=" if self.sense > 0 else ">="
        return f"{self.name} {sign} {self.sense * self.bound:.6g} {self.unit}".removesuffix(" 1")


class FigureRows(NamedTuple):
    """Figures of n designs, a tree of arrays (n, ...), and their slopes (n, ..., d) if asked."""

    values: Any
    slopes: Any = None


Many = Callable[[np.ndarray, bool], FigureRows]  # of designs (n, d), with slopes or without


class Problem(NamedTuple):
    """`figures(x, extra)` gives f (k,) and g (c,); `worst` says how the f_k combine.

    `many(x, gradient)` gives the same figures of many designs x (n, d), f (n, k) and g (n, c), and
    their slopes, where there is a faster way than `figures`.
    `extra` is data that `draw(key)` may replace (tolerances drawn anew), for stochastic searches.
    `costly`: every figure is an integrated run, so that fewer are spent and programs kept small.
    `order`: how many evaluations are made (`_batches.each`).
    `floor`: what rounding leaves of an objective that is 0, or of each figure of a front.
    """

    variables: tuple[Variable, ...]
    figures: Callable[[Float[Array, " d"], Any], tuple[Array, Array]]
    limits: tuple[Limit, ...] = ()
    worst: bool = False
    cases: tuple[str, ...] = ("",)
    name: str = "objective"
    unit: str = "1"
    extra: Any = None
    draw: Callable[[Array], Any] | None = None
    costly: bool = False
    order: Order = "in turn"
    many: Many | None = None
    floor: float | tuple[float, ...] = 0.0

    @property
    def epigraph(self) -> bool:
        """Whether the worst of several cases counts, so that all of them are held below it."""
        return self.worst and len(self.cases) > 1


def check_variables(variables: tuple[Variable, ...]) -> None:
    """`InputError` with every problem of the bounds and starts."""
    problems = []
    for v in variables:
        if not v.low < v.high:
            problems.append(
                f"`{v.name}` has crossed bounds: low {v.low:g} is not below high {v.high:g}."
            )
        elif v.log and v.low <= 0:
            problems.append(f"`{v.name}` on log scale needs low above 0, but it is {v.low:g}.")
        elif v.start is not None and not v.low <= v.start <= v.high:
            problems.append(
                f"`{v.name}` starts outside its bounds: {v.start:g} is not in "
                f"[{v.low:g}, {v.high:g}]."
            )
        elif v.whole and np.floor(v.high) < np.ceil(v.low):
            problems.append(f"`{v.name}` has no whole number in [{v.low:g}, {v.high:g}].")
    names = [v.name for v in variables]
    problems += [f"`{n}` is a variable twice." for n in dict.fromkeys(names) if names.count(n) > 1]
    problems += [] if variables else ["a design needs at least one variable."]
    if problems:
        raise InputError(problems)


@jax.jit
def from_angle(z):
    """s = (1 - cos z)/2."""
    return 0.5 * (1 - jnp.cos(z))


@jax.jit
def to_angle(share):
    """z in [0, pi] of s."""
    return jnp.arccos(1 - 2 * jnp.clip(share, 0.0, 1.0))
