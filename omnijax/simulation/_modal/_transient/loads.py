"""Least margins of contact and grip over the blocks of a run."""

import functools
from collections.abc import Iterable, Sequence

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._poles import PolePairs
from ..arithmetic import Pair, across, materialised, rows, summed
from ..system import Layout
from .blocks import BlockTables, ForcedPart, parts_of, shown_by
from .edges import at_piece, of_sinusoids
from .walk import WalkState

FEWEST = 8  # samples that one loop over designs works out beside each other at least


class Loads:
    """Normal and drive forces of a group's wheels, and what they do not exceed in a block."""

    def __init__(self, m: PolePairs, preload, friction, parts: ForcedPart, layout: Layout, span):
        """`span` (s): how long a block lasts at most."""
        n = layout.wheels
        self.preload, self.friction, self.layout = preload, friction, layout
        self.shown = shown = shown_by(range(3, 3 + 2 * n), m, parts, layout)
        self.complex = m.kind > 0
        k, c0, c1 = shown.kind > 0, jnp.abs(shown.c0), jnp.abs(shown.c1)
        row, self.pair = _beside(shown.live[:n])
        each = np.concatenate([np.asarray(pairs, int) for pairs in shown.live])
        grown0, grown1 = (rows(_grown(x * span), each) for x in (m.l0, m.l1))
        sizes = (
            jnp.where(k, jnp.sqrt(c0 * c0 + c1 * c1), c0) * grown0,
            jnp.where(k, 0.0, c1 * grown1),
        )
        self.pair_size = [_picked(x, row) for x in sizes]
        row, self.wave = _beside(shown.waves)
        self.wave_size = _picked(jnp.sqrt(shown.cosine**2 + shown.sine**2), row)

    def bounds(self, s: WalkState) -> tuple[Array, Array]:
        """Bounds from below of N and mu N - |f| of all wheels over a block, (n, c) each.

        A pair of poles that decays shows no more than at the block's begin, one that grows (as a
        user's law may make it) no more than at its end.
        """
        z0, z1 = s.free
        z0 = jnp.where(self.complex, jnp.sqrt(z0 * z0 + z1 * z1), jnp.abs(z0))
        z0, z1 = (_picked(z, self.pair) for z in (z0, jnp.abs(z1)))
        of = self.layout.signal_of[self.wave]
        piece = of_sinusoids(s.piece, of.ravel(), jnp.zeros_like(s.done))
        wave = summed(at_piece(self.wave_size, piece.reshape(*of.shape, -1)), 1)
        n = self.layout.wheels
        swing = summed(self.pair_size[0] * z0 + self.pair_size[1] * z1, 1) + wave[:n]
        normal = self.preload - swing
        return normal, self.friction * normal - wave[n:]

    def lowest(self, low, s: WalkState, t: BlockTables, turn):
        """The least margins so far: by the bounds where those say enough, else sample by sample.

        Margins (N) of N and, imaginary, of mu N - |f|.  Nothing more is asked of a design that has
        lifted off, nor of the grip of one that has slipped.
        """
        some = s.count > 0
        normal, slip = (jnp.where(some, across(jnp.minimum, b), jnp.inf) for b in self.bounds(s))
        open_ = (normal <= 0) | ((slip < 0) & (low.imag >= 0))
        return jax.lax.cond(
            jnp.any(open_ & (low.real > 0)),
            lambda low, s, t, turn: _lower([_parts(low), _parts(self._sampled(s, t, turn))]),
            lambda low, *_: _lower([_parts(low), (normal, slip)]),
            low,
            s._replace(carried=()),
            t,
            turn,
        )

    def _sampled(self, s: WalkState, t: BlockTables, turn):
        """The least margins of all wheels over the samples of a block."""
        n, shown, layout = self.layout.wheels, self.shown, self.layout
        weights = shown.weights(s.free, s.piece, turn, layout)
        together = max(FEWEST, *(shown.together((i, n + i), layout) for i in range(n)))

        def lower(i, low, w, t, count, like):
            """With the margins of wheel i, which shows what the wheel `like` shows."""
            each: list[Sequence[Array]] = [_parts(low)]
            for number, part in parts_of(t, together):
                normal = shown.samples(w, part, layout, like, i) + self.preload[i]
                drive = shown.samples(w, part, layout, n + like, n + i)
                margins = normal, self.friction[i] * normal - jnp.abs(drive)
                each.append([jnp.where(number < count, x, jnp.inf) for x in margins])
            return _lower(each)

        each = list(zip(shown.live, shown.waves, strict=True))
        low = jnp.full((together, len(s.count)), jnp.inf)
        low = jax.lax.complex(low, low)
        if len(set(each[:n])) == len(set(each[n:])) == 1:  # one wheel's program does for all
            low = jax.lax.fori_loop(0, n, lambda i, low: lower(i, low, weights, t, s.count, 0), low)
        else:
            for i in range(n):
                low = materialised(lambda *x, i=i: lower(i, *x, like=i), low, weights, t, s.count)
        return jax.lax.complex(*(across(jnp.minimum, x) for x in _parts(low)))


def _grown(exponent):
    """How many times as large a free part has become, at least 1; without overflow."""
    return jnp.exp(jnp.clip(exponent, 0.0, 300.0))


def _parts(x) -> Pair:
    return x.real, x.imag


def _lower(each: Iterable[Sequence[Array]]):
    """The least of both margins, as a complex number."""
    both = zip(*each, strict=True)
    return jax.lax.complex(*(functools.reduce(jnp.minimum, x) for x in both))


def _beside(shown: Sequence[Sequence[int]]) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of the parts of each output and what they are parts of, (outputs, most parts); -1."""
    most, first = max(1, *map(len, shown)), np.cumsum([0, *map(len, shown)])
    part, number = np.full((2, len(shown), most), -1)
    for o, each in enumerate(shown):
        part[o, : len(each)] = np.arange(first[o], first[o + 1])
        number[o, : len(each)] = each
    return part, number


def _picked(x: Float[Array, "r ..."], index: np.ndarray) -> Array:
    """Rows of x in the shape of their numbers, zeros for -1."""
    if np.any(index < 0):
        x = jnp.concatenate([x, jnp.zeros((1, *x.shape[1:]))])
    return rows(x, index.ravel() % len(x)).reshape(*index.shape, *x.shape[1:])
