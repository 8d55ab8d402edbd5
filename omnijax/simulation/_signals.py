"""Signals in time: piecewise linear with jumps, with their integral in closed form."""

from collections.abc import Sequence
from types import ModuleType
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Float
from numpy.typing import ArrayLike

from .._arrays import on_device
from ..rig import check_real

Vector = (
    Sequence[float | Array] | np.ndarray | Array
)  # one number each of some directions or wheels


class Signal(eqx.Module):
    """A vector in time: on [knot, next knot) value + slope (t - knot); constant before and after.

    Constants, steps, ramps and tables are all of this form; `a + b` adds two signals.

    `knots` (k,) in s, `values` and `slopes` (k, d) in the quantity's unit and per s.
    """

    knots: Float[Array, " k"]  # s, increasing
    values: Float[Array, "k d"]  # at each knot, from the right
    slopes: Float[Array, "k d"]  # per s; the last is 0

    def _piece(self, time):
        return jnp.clip(
            jnp.searchsorted(self.knots, time, side="right") - 1, 0, len(self.knots) - 1
        )

    def __call__(self, time: Float[Array, ""]) -> Float[Array, " d"]:
        """Value at `time` (s)."""
        i = self._piece(time)
        return self.values[i] + self.slopes[i] * jnp.maximum(time - self.knots[i], 0.0)

    def rate(self, time: Float[Array, ""]) -> Float[Array, " d"]:
        """Slope at `time`, per s; jumps are left out."""
        return jnp.where(time < self.knots[0], 0.0, self.slopes[self._piece(time)])

    def integral(self, time: Float[Array, ""]) -> Float[Array, " d"]:
        """Integral from the first knot to `time` (negative before it)."""
        i = self._piece(time)
        since = time - self.knots[i]
        whole = self._integrals()[i]
        quadratic = jnp.where(since > 0, 0.5 * self.slopes[i] * since**2, 0.0)
        return whole + self.values[i] * since + quadratic

    def _integrals(self) -> Float[Array, "k d"]:
        width = jnp.diff(self.knots)[:, None]
        pieces = self.values[:-1] * width + 0.5 * self.slopes[:-1] * width**2
        zero = jnp.zeros((1, self.values.shape[1]))
        return jnp.concatenate([zero, jnp.cumsum(pieces, axis=0)])

    def jumps(self) -> Float[Array, " k"]:
        """Last times before the value jumps, s, one a knot; inf at the others.

        One floating-point number early, because a solver's last stage may round up to the time
        it was told to stop before.
        """
        before = self._before()
        tolerance = 1e-9 * jnp.max(jnp.abs(self.values))
        jump = jnp.any(jnp.abs(self.values[1:] - before) > tolerance, axis=1)
        before_knot = jnp.nextafter(self.knots, -jnp.inf)
        return jnp.where(jnp.concatenate([jnp.zeros(1, bool), jump]), before_knot, jnp.inf)

    def _before(self, xp: ModuleType = jnp) -> Any:
        """Values (m, d) just before every knot but the first, m = k - 1 of them."""
        knots, values, slopes = map(xp.asarray, (self.knots, self.values, self.slopes))
        return values[:-1] + slopes[:-1] * xp.diff(knots)[:, None]

    def around_knots(self) -> Any:
        """Values (m, d) on both sides of the knots: those at all times lie between them.

        Of known numbers by numpy, which compiles nothing.
        """
        xp = jnp if is_traced(self) else np
        return xp.concatenate([xp.asarray(self.values), self._before(xp)])

    def kinks(self) -> Float[Array, " k"]:
        """Times of the knots without a jump, s; inf at the others."""
        return jnp.where(jnp.isfinite(self.jumps()), jnp.inf, self.knots)

    def later(self, by: float) -> "Signal":
        """The same `by` s later."""
        return Signal(self.knots + by, self.values, self.slopes)

    @property
    def size(self) -> int:
        """Length of the vector."""
        return self.values.shape[1]

    def __add__(self, other: "Signal") -> "Signal":
        knots = jnp.unique(jnp.concatenate([self.knots, other.knots]))
        values = jax.vmap(lambda t: self(t) + other(t))(knots)
        slopes = jax.vmap(lambda t: self.rate(t) + other.rate(t))(knots)
        return Signal(knots, values, slopes)


def constant(value: Vector) -> Signal:
    """The same `value` at all times."""
    if is_traced(value):
        values = jnp.atleast_1d(jnp.asarray(value, float))[None, :]
        return Signal(jnp.zeros(1), values, jnp.zeros_like(values))
    known = np.atleast_1d(np.asarray(value, float))[None, :]
    return Signal(*(on_device(x) for x in (np.zeros(1), known, np.zeros_like(known))))


def table(time: ArrayLike, values: ArrayLike) -> Signal:
    """Linear between samples `values` (k, d) at `time` (k,), s; held before and after.

    A time given twice is a jump.  Raises `ValueError` where time decreases, shapes differ or values
    are not real.
    """
    check_real("values", values, "SI")
    t, v = np.asarray(time, float), np.asarray(values, float)
    if v.ndim == 1:
        v = v[:, None]
    if t.ndim != 1 or len(t) != len(v) or len(t) == 0:
        raise ValueError(f"a table needs one row a time, but has {len(t)} times, {len(v)} rows.")
    if np.any(np.diff(t) < 0):
        row = int(np.argmax(np.diff(t) < 0)) + 1
        raise ValueError(f"`time` must not decrease, but does at row {row} ({t[row]:g} s).")
    width = np.diff(t)[:, None]
    slopes = np.where(width > 0, np.diff(v, axis=0) / np.where(width > 0, width, 1.0), 0.0)
    slopes = np.concatenate([slopes, np.zeros((1, v.shape[1]))])
    keep = np.flatnonzero(np.append(np.diff(t) > 0, True))  # of a doubled time the later row counts
    return Signal(*(on_device(x[keep]) for x in (t, v, slopes)))


def step(time: float, before: ArrayLike, after: ArrayLike) -> Signal:
    """`before` until `time` (s), `after` from then on."""
    first, last = _vectors(before, after)
    start = min(time, 0.0) - 1.0
    return table([start, time, time], np.stack([first, first, last]))


def ramp(start: float, end: float, before: ArrayLike, after: ArrayLike) -> Signal:
    """`before` (d,) until `start` (s), linear to `after` (d,) at `end`, held then.

    Raises `ValueError` where it does not end after it starts.
    """
    if not end > start:
        raise ValueError(f"a ramp must end after it starts, but runs {start:g} s to {end:g} s.")
    return table([start, end], np.stack(_vectors(before, after)))


def is_traced(tree: Any) -> bool:
    """Whether some value of a tree is not known while this runs."""
    return any(isinstance(x, Tracer) for x in jax.tree.leaves(tree))


def is_constant(signal: Signal) -> bool:
    """Whether a signal is known to hold one value for all times."""
    if len(signal.knots) == 1:
        return True
    if is_traced(signal):
        return False
    values, slopes = np.asarray(signal.values), np.asarray(signal.slopes)
    return bool(np.all(values == values[0]) and np.all(slopes == 0))


def _vectors(*values: ArrayLike) -> list[np.ndarray]:
    for value in values:
        check_real("values", value, "SI")
    return [np.atleast_1d(np.asarray(value, float)) for value in values]
