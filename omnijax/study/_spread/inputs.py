"""Uncertain inputs of a global study, and models of them that may fail.

Every input follows from a standard one: t uniform in [0, 1] (ranges, on linear or log scale), or z
standard normal (mean at the middle of the range, which is then +-3 standard deviations).
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy.special import ndtri

from ..._compiling import quick_jit
from ..._errors import RunError
from .._batches import Order, batches, each, value_and_jacobian
from .._range import Ranges


class Input(NamedTuple):
    """One uncertain quantity: a range, `log` or linear, uniform or `normal` over it."""

    name: str
    low: float
    high: float
    log: bool = False
    normal: bool = False


class UncertainInputs:
    """Standard points (n, d) to values (n, d), differentiably."""

    def __init__(self, inputs: Sequence[Input]):
        self.inputs = tuple(inputs)
        self.names = tuple(x.name for x in inputs)
        self.normal = np.array([x.normal for x in inputs])
        self.ranges = Ranges.of(self.inputs)

    @property
    def size(self) -> int:
        """Number of inputs."""
        return len(self.inputs)

    def standard(self, unit: np.ndarray) -> np.ndarray:
        """Points of the unit cube as standard inputs: normal ones by their quantiles."""
        clipped = np.clip(unit, 1e-12, 1 - 1e-12)
        return np.where(self.normal, ndtri(clipped), unit)

    def values(self, standard: Float[Array, "... d"]) -> Float[Array, "... d"]:
        """Inputs in their units."""
        return self.ranges.value(jnp.where(self.normal, 0.5 + standard / 6, standard))

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
# Figures (n, m) of standard points (n, d), and where asked for their slopes (n, m, d)
Batch = Callable[[np.ndarray, bool], Sequence[Array | np.ndarray]]


def one_by_one(
    function: Callable[[Float[Array, " d"]], Float[Array, " m"]],
    inputs: UncertainInputs,
    order: Order = "side by side",
) -> Batch:
    """`function` of every point's inputs by one program; `order` as `each` takes it."""

    def one(s):
        return function(inputs.values(s))

    values = quick_jit(lambda rows: (each(one, [rows], order),))
    both = quick_jit(lambda rows: each(value_and_jacobian(one), [rows], order))
    return lambda standard, slopes: (both if slopes else values)(jnp.asarray(standard))


def run_all(
    batch: Batch,
    standard: np.ndarray,
    *,
    slopes: bool = False,
    report: Callable[[int, int], None] | None = None,
    store=None,
    key: str = "",
) -> Runs:
    """`batch` of all standard points, in chunks of one shape; finished ones may be stored."""
    size = min(CHUNK // (4 if slopes else 1), len(standard))
    parts = []
    for first, rows, count in batches(standard, size):
        name = f"{key}-{first}"
        stored = None if store is None else store.read(name)
        if stored is None:
            results = batch(rows, slopes)
            stored = {str(i): np.asarray(x)[:count] for i, x in enumerate(results)}
            if store is not None:
                store.write(name, stored)
        parts.append([stored[str(i)] for i in range(1 + slopes)])
        if report is not None:
            report(first + count, len(standard))
    joined = [np.concatenate(xs) for xs in zip(*parts, strict=True)]
    runs = Runs(*joined)
    if runs.failed.all():
        raise RunError("every run of this study failed, so that there is nothing to analyse.")
    return runs
