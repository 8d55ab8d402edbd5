"""Designs whose poles coincide, asked at points beside them.

Where two poles of a block come together their vectors do too, as at critical damping: with a gap
g the inverse of the vectors is of size 1/g, and figures made of them lose digits as 1/g, their
derivatives as 1/g^3.  Figures lose them too where a pole without damping meets the rate nu of a
sinusoid: free and forced part are of size 1/(lambda - i nu) and cancel.  Every figure itself is
smooth there,

    f(0) = (4 f(h) + 4 f(-h) - f(2 h) - f(-2 h))/6 + O(h^4)

and so are its derivatives by the arrays of a design.  h moves the diagonal of A, which is what
damps, by its h-th part, or the rate of such a sinusoid.
"""

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from .poles import Eigen
from .system import LinearDesign

CONDITION = 60.0  # of a pole: 1 where vectors are orthogonal, about 1/g at a gap g of their poles
DAMPING = 5e-4  # h of the diagonal: poles that coincide are then 3 % of their size apart
LEAD = 0.02  # rad, by which the sinusoid at the point h is ahead after a run
NEAR = 1e-4  # of the rate: poles farther off cancel little, however short the run
STEPS = np.array([1.0, -1.0, 2.0, -2.0])
WEIGHTS = np.array([4.0, 4.0, -1.0, -1.0]) / 6
NEAREST = np.array([0.5, 0.5, 0.0, 0.0])


class Coincidence(NamedTuple):
    """What comes together in each design of a batch."""

    poles: Bool[Array, " B"]  # two poles and their vectors
    shift: Float[Array, "B v"]  # rad/s, of the sinusoids that meet a pole: what h moves them by

    @property
    def designs(self) -> Bool[np.ndarray, " B"]:
        """The designs where anything does."""
        return np.asarray(self.poles) | np.asarray(self.shift).any(axis=1)


class Answer(NamedTuple):
    """What designs are asked for, all of it with one axis of designs."""

    smooth: Any  # figures and derivatives
    bounds: Any = None  # of the sign of what they are bounds of, if no more


def coincidence(
    pairs: Eigen, rate: Float[Array, "B v"], duration: Float[Array, ""] | None = None
) -> Coincidence:
    """Of designs whose sinusoids have that `rate` (rad/s), in runs of a `duration` (s).

    Without it no free part is beside what the sinusoids force.
    """
    value, turns = pairs.value, jnp.abs(rate)
    number = jnp.isfinite(value.real).all(axis=1)
    poles = number & ~(condition(pairs) < CONDITION).all(axis=1)
    if duration is None:
        return Coincidence(poles, jnp.zeros_like(rate))
    least = jnp.minimum(LEAD / (2 * duration), NEAR * turns)
    re, im = value.real[:, None], value.imag[:, None]
    gap = jnp.square(re) + jnp.square(im - turns[:, :, None])  # (B, v, k)
    meet = jnp.any(gap < jnp.square(least)[:, :, None], axis=2)
    return Coincidence(poles, jnp.where(meet, LEAD / duration, 0.0))


def condition(pairs: Eigen) -> Float[Array, "c k"]:
    """|v| |w|/|w . v| of the right and left vectors of each pole, less at its conjugate."""
    upper = pairs.value.imag > 0  # see `Eigen`: the other part of its vectors comes next

    def square(x):
        return x + jnp.where(upper, jnp.roll(x, -1, axis=1), 0.0)

    right = square(jnp.sum(jnp.square(pairs.vector), axis=1))
    left = square(jnp.sum(jnp.square(pairs.inverse), axis=2))
    return jnp.sqrt(right * left) * jnp.where(upper, 0.5, 1.0)


def answered(
    ask: Callable[[LinearDesign, Int[np.ndarray, " B"]], tuple[Answer, Coincidence]],
    design: LinearDesign,
    count: int,
    axis: int,
) -> Answer:
    """`ask(design, numbers)` of a batch; of those of its first `count` where anything coincides,
    what the points beside them say.

    `numbers`: of the designs in the batch, where each comes from; `axis`: that of the answer's
    designs.
    """
    size = len(design.preload)
    answer, at = ask(design, np.arange(size))
    some = np.flatnonzero(at.designs[:count])
    if len(some) == 0:
        return answer
    answer = jax.tree.map(lambda x: np.moveaxis(np.array(x), axis, 0), answer)
    for own, moved in _beside(design, at, some):
        points = jax.tree.map(
            lambda x: np.moveaxis(np.asarray(x), axis, 0), ask(moved, _filled(own, size))[0]
        )
        for mine, theirs, weights in zip(answer, points, (WEIGHTS, NEAREST), strict=True):
            jax.tree.map(partial(_put, own=own, weights=weights), mine, theirs)
    return jax.tree.map(lambda x: np.moveaxis(x, 0, axis), answer)


def _filled(own: Int[np.ndarray, " k"], size: int) -> Int[np.ndarray, " B"]:
    """Numbers of the designs at all points, those of each together; the last one fills up."""
    numbers = np.repeat(own, len(STEPS))
    return np.pad(numbers, (0, size - len(numbers)), mode="edge")


def _beside(
    design: LinearDesign, at: Coincidence, some: Int[np.ndarray, " k"]
) -> Iterator[tuple[Int[np.ndarray, " k"], LinearDesign]]:
    """As many of some designs as have room for their points in a batch, and these points."""
    size = len(design.preload)
    room = size // len(STEPS)
    step = np.resize(STEPS, size)
    for first in range(0, len(some), room):
        own = some[first : first + room]
        numbers = _filled(own, size)
        moved, poles, shift = jax.tree.map(lambda x, of=numbers: np.asarray(x)[of], (design, *at))
        A, rate = moved.system.A, moved.signals.rate
        more = np.where(poles, DAMPING * step, 0.0)[:, None] * np.diagonal(A, axis1=1, axis2=2)
        A = A + more[:, :, None] * np.eye(A.shape[1])
        system = moved.system._replace(A=A)
        signals = moved.signals._replace(rate=rate + step[:, None] * shift)
        yield own, moved._replace(system=system, signals=signals)


def _put(
    x: np.ndarray, y: np.ndarray, own: Int[np.ndarray, " k"], weights: Float[np.ndarray, "4"]
) -> None:
    """What points y say of a batch's `own` designs in x, where it is a number."""
    each = y[: len(own) * len(STEPS)].reshape(len(own), len(STEPS), *y.shape[1:])
    with np.errstate(invalid="ignore"):  # of a rig that nothing holds
        mean = np.tensordot(weights, each, (0, 1))
    x[own] = np.where(np.isfinite(mean), mean, x[own])
