"""Designs whose poles coincide, asked at points beside them.

Where two poles of a block come together their vectors do too, as at critical damping: with a gap
g the inverse of the vectors is of size 1/g, and figures made of them lose digits as 1/g, their
derivatives as 1/g^3.  Figures lose them too where a pole without damping meets the rate nu of a
sinusoid: free and forced part are of size 1/(lambda - i nu) and cancel.  Every figure itself is
smooth there,

    f(0) = (4 f(h) + 4 f(-h) - f(2 h) - f(-2 h))/6 + O(h^4)

and so are its derivatives by the arrays of a design.  h moves the rate of such a sinusoid; or it
moves A by S h, which acts on the states of the poles that coincide alone.  With Q a basis of these,
P^H Q = 1, and P^H A Q = mu + N, where N is what their poles differ by and what ties them, S = Q D
P^H with D = g^2 N^+: the poles go to mu +- g sqrt(h), whatever the units of the states are.

Source: Golub, Van Loan, Matrix Computations, 7.6 (invariant subspaces by ordered Schur forms).
"""

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Complex, Float, Int
from scipy.linalg import schur, solve_sylvester

from ..system import Layout, LinearDesign
from .poles import Eigen

CONDITION = 60.0  # of a pole: 1 where vectors are orthogonal, about 1/g at a gap g of their poles
APART = 0.03  # of their damping, by which poles that coincide are moved: g
TOGETHER = 2.0  # times that: poles that are farther apart do not coincide
TIED = 4.0  # times g, and what poles differ by: what ties them is larger
LEAD = 0.02  # rad, by which the sinusoid at the point h is ahead after a run
NEAR = 1e-4  # of the rate: poles farther off cancel little, however short the run
STEPS = np.array([1.0, -1.0, 2.0, -2.0])
WEIGHTS = np.array([4.0, 4.0, -1.0, -1.0]) / 6
NEAREST = np.array([0.5, 0.5, 0.0, 0.0])


class Coincidence(NamedTuple):
    """What comes together in each design of a batch."""

    poles: Bool[Array, " B"]  # two poles and their vectors
    slow: Float[Array, ""]  # 1/s, of a run: slower damping does not tell poles apart in it
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
        return Coincidence(poles, jnp.zeros(()), jnp.zeros_like(rate))
    least = jnp.minimum(LEAD / (2 * duration), NEAR * turns)
    re, im = value.real[:, None], value.imag[:, None]
    gap = jnp.square(re) + jnp.square(im - turns[:, :, None])  # (B, v, k)
    meet = jnp.any(gap < jnp.square(least)[:, :, None], axis=2)
    return Coincidence(poles, 1 / duration, jnp.where(meet, LEAD / duration, 0.0))


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
    layout: Layout,
    count: int,
    axis: int,
) -> Answer:
    """`ask(design, numbers)` of a batch; of those of its first `count` where anything coincides,
    what the points beside them say.

    `numbers`: of the designs in the batch, where each comes from; `axis`: that of the answer's
    designs; `layout`: the groups of states that do not move each other.
    """
    size = len(design.preload)
    answer, at = ask(design, np.arange(size))
    some = np.flatnonzero(at.designs[:count])
    if len(some) == 0:
        return answer
    answer = jax.tree.map(lambda x: np.moveaxis(np.array(x), axis, 0), answer)
    for own, moved in _beside(design, layout.blocks, at, some):
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
    design: LinearDesign,
    blocks: Sequence[tuple[int, ...]],
    at: Coincidence,
    some: Int[np.ndarray, " k"],
) -> Iterator[tuple[Int[np.ndarray, " k"], LinearDesign]]:
    """As many of some designs as have room for their points in a batch, and these points."""
    size = len(design.preload)
    room = size // len(STEPS)
    step = np.resize(STEPS, size)
    for first in range(0, len(some), room):
        own = some[first : first + room]
        numbers = _filled(own, size)
        moved, shift = jax.tree.map(lambda x, of=numbers: np.asarray(x)[of], (design, at.shift))
        A, rate = moved.system.A, moved.signals.rate
        S = np.zeros((len(own), *A.shape[1:]))
        for k in np.flatnonzero(np.asarray(at.poles)[own]):
            S[k] = apart(A[k * len(STEPS)], blocks, float(at.slow))
        A = A + step[:, None, None] * S[_filled(np.arange(len(own)), size)]
        system = moved.system._replace(A=A)
        signals = moved.signals._replace(rate=rate + step[:, None] * shift)
        yield own, moved._replace(system=system, signals=signals)


def apart(
    A: Float[np.ndarray, "m m"], blocks: Sequence[tuple[int, ...]], slow: float
) -> Float[np.ndarray, "m m"]:
    """S, by which A moves so that poles of a block that coincide do not; 0 where none do.

    `slow` (1/s): see `Coincidence`.
    """
    S = np.zeros_like(A)
    for block in blocks:
        own = np.array([i for i in block if i >= 0])
        S[np.ix_(own, own)] += _apart(A[np.ix_(own, own)], slow)
    return S


def _apart(A: Float[np.ndarray, "m m"], slow: float) -> Float[np.ndarray, "m m"]:
    value = np.linalg.eigvals(A)
    S = np.zeros_like(A)
    for some in _clusters(value, slow):
        mu, rest = value[some].mean(), np.delete(value, some)
        if mu.imag < -1e-9 * abs(mu):  # its conjugate counts for both
            continue
        radius = np.abs(value[some] - mu).max()
        if len(rest):
            radius = (radius + np.abs(rest - mu).min()) / 2
        form: Any = schur(A, output="complex", sort=lambda z, m=mu, r=radius: abs(z - m) <= r)
        T, Z, k = form
        if k != len(some):
            continue
        X = solve_sylvester(T[:k, :k], -T[k:, k:], T[:k, k:])
        left = np.concatenate([np.eye(k), X], axis=1) @ Z.conj().T
        moved = Z[:, :k] @ _untied(T[:k, :k], _split(mu, slow)) @ left
        S += (2 if mu.imag > radius else 1) * moved.real
    return S


def _split(mu: complex, slow: float) -> float:
    """g of poles at mu, 1/s."""
    return APART * (abs(mu.real) + slow)


def _clusters(value: Complex[np.ndarray, " m"], slow: float) -> list[list[int]]:
    """Which poles coincide, two or more of them each."""
    damping = np.maximum(-np.real(value), 0.0)
    most = TOGETHER * APART * (np.minimum.outer(damping, damping) + slow)
    near = np.abs(np.subtract.outer(value, value)) < most
    clusters, left = [], set(range(len(value)))
    while left:
        new = cluster = {left.pop()}
        while new := {int(j) for i in new for j in np.flatnonzero(near[i])} - cluster:
            cluster = cluster | new
        left -= cluster
        if len(cluster) > 1:
            clusters.append(sorted(cluster))
    return clusters


def _untied(T: Complex[np.ndarray, "k k"], g: float) -> Complex[np.ndarray, "k k"]:
    """D of poles with the Schur form T: g^2 N^+ of what ties them."""
    N = T - np.eye(len(T)) * np.trace(T) / len(T)
    gap = np.abs(np.diag(N)).max()
    U, size, V = np.linalg.svd(N)
    inverse = np.where(size > TIED * max(gap, g), 1 / np.maximum(size, 1e-300), 0.0)
    square = max(g * g, 4 * gap * gap)  # so that no point h moves poles together
    return square * (V.conj().T * inverse) @ U.conj().T


def _put(
    x: np.ndarray, y: np.ndarray, own: Int[np.ndarray, " k"], weights: Float[np.ndarray, "4"]
) -> None:
    """What points y say of a batch's `own` designs in x, where it is a number."""
    each = y[: len(own) * len(STEPS)].reshape(len(own), len(STEPS), *y.shape[1:])
    with np.errstate(invalid="ignore"):  # of a rig that nothing holds
        mean = np.tensordot(weights, each, (0, 1))
    x[own] = np.where(np.isfinite(mean), mean, x[own])
