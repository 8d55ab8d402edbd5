"""Uncertain inputs of a global study, and models of them that may fail.

Every input follows from a standard one: t uniform in [0, 1] (ranges, on linear or log scale), or z
standard normal (mean at the middle of the range, which is then +-3 standard deviations).
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy.stats import norm

from ..._errors import RunError


class Input(NamedTuple):
    """One uncertain quantity: a range, `log` or linear, uniform or `normal` over it."""

    name: str
    low: float
    high: float
    log: bool = False
    normal: bool = False


class Inputs:
    """Standard points (n, d) to values (n, d), differentiably."""

    def __init__(self, inputs: Sequence[Input]):
        self.inputs = tuple(inputs)
        self.names = tuple(x.name for x in inputs)
        self.log = np.array([x.log for x in inputs])
        self.normal = np.array([x.normal for x in inputs])
        ends = np.array([[x.low, x.high] for x in inputs], float)
        ends = np.where(self.log[:, None], np.log(np.where(self.log[:, None], ends, 1.0)), ends)
        self.low, self.span = ends[:, 0], ends[:, 1] - ends[:, 0]

    @property
    def size(self) -> int:
        """Number of inputs."""
        return len(self.inputs)

    def standard(self, unit: np.ndarray) -> np.ndarray:
        """Points of the unit cube as standard inputs: normal ones by their quantiles."""
        clipped = np.clip(unit, 1e-12, 1 - 1e-12)
        return np.where(self.normal, norm.ppf(clipped), unit)

    def values(self, standard: Float[Array, "... d"]) -> Float[Array, "... d"]:
        """Inputs in their units."""
        share = jnp.where(self.normal, 0.5 + standard / 6, standard)
        y = self.low + self.span * share
        return jnp.where(self.log, jnp.exp(jnp.where(self.log, y, 0.0)), y)

    @property
    def poincare(self) -> np.ndarray:
        """C in total index <= C E[(df/d standard)^2] / V: 1/pi^2 uniform, 1 normal."""
        return np.where(self.normal, 1.0, 1 / np.pi**2)


class Runs(NamedTuple):
    """Figures of many points; `failed` marks rows that are not finite."""

    values: np.ndarray  # (n, m)
    slopes: np.ndarray | None = None  # (n, m, d), over the standard inputs

    @property
    def failed(self) -> np.ndarray:
        """Which points have no figures."""
        good = np.isfinite(self.values).all(axis=1)
        if self.slopes is not None:
            good = good & np.isfinite(self.slopes).all(axis=(1, 2))
        return np.logical_not(good)


CHUNK = 256


def run_all(
    function: Callable[[Float[Array, " d"]], Float[Array, " m"]],
    inputs: Inputs,
    standard: np.ndarray,
    *,
    slopes: bool = False,
    report: Callable[[int, int], None] | None = None,
    store=None,
    key: str = "",
) -> Runs:
    """`function` of every point, in chunks of one compiled shape; finished ones may be stored."""

    def one(s):
        return function(inputs.values(s))

    def with_slopes(s):
        def push(tangent):
            return jax.jvp(one, (s,), (tangent,))

        value, columns = jax.vmap(push)(jnp.eye(inputs.size))
        return value[0], columns.T

    size = min(CHUNK // (4 if slopes else 1), len(standard))
    batched = jax.jit(jax.vmap(with_slopes if slopes else one))
    parts = []
    for first in range(0, len(standard), size):
        name, count = f"{key}-{first}", min(size, len(standard) - first)
        stored = None if store is None else store.read(name)
        if stored is None:
            index = np.minimum(np.arange(first, first + size), len(standard) - 1)
            found = batched(jnp.asarray(standard[index]))
            found = found if slopes else (found,)
            stored = {str(i): np.asarray(x)[:count] for i, x in enumerate(found)}
            if store is not None:
                store.write(name, stored)
        parts.append([stored[str(i)] for i in range(1 + slopes)])
        if report is not None:
            report(min(first + size, len(standard)), len(standard))
    joined = [np.concatenate(xs) for xs in zip(*parts, strict=True)]
    runs = Runs(*joined)
    if runs.failed.all():
        raise RunError("every run of this study failed, so that there is nothing to analyse.")
    return runs
