"""Newton's method up the length of a sum of outputs of phases, each at its own time."""

import functools
import operator
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .curves import Curves, values_at
from .gradient import ROWS

ROUNDS = 6
LESS = 0.25  # of a step that went too far


def unit(total):
    size = jnp.sqrt(jnp.sum(total**2, axis=0))
    return total / jnp.where(size > 0, size, 1.0)


def together(every: list[Curves], held, times):
    """dR (o, c)."""
    return held + sum(
        jnp.sum(values_at(f, t)[0], axis=1) for f, t in zip(every, times, strict=True)
    )


def ascended(f: Curves, d, time, step):
    """One step of Newton's method up d . x of each phase, d (o, 1, c)."""
    _, rise, bend = (jnp.sum(d * x, axis=0) for x in values_at(f, time, 3))
    return time + _move(rise, bend, step)


def _move(rise, bend, step):
    move = jnp.where(bend < 0, -rise / jnp.where(bend < 0, bend, -1.0), step * jnp.sign(rise))
    return jnp.clip(move, -step, step)


class _Climb(NamedTuple):
    """The highest times so far, |dR|^2 there, and the step to try next."""

    times: list[Array]
    square: Float[Array, " c"]
    moves: list[Array]
    share: Float[Array, " c"]  # of the moves


def climbed(every: list[Curves], held, times, steps):
    """Times and |dR|^2 after Newton's method in all times together, never lower than at first."""

    def turn(_, now: _Climb) -> _Climb:
        tried = [t + now.share * move for t, move in zip(now.times, now.moves, strict=True)]
        parts = [values_at(f, t, 3) for f, t in zip(every, tried, strict=True)]
        total = held + sum(jnp.sum(part[0], axis=1) for part in parts)
        square = jnp.sum(total**2, axis=0)
        better = square > now.square
        moves = _newton(total, parts, steps)
        return _Climb(
            [jnp.where(better, x, t) for x, t in zip(tried, now.times, strict=True)],
            jnp.where(better, square, now.square),
            [jnp.where(better, x, m) for x, m in zip(moves, now.moves, strict=True)],
            jnp.where(better, 1.0, LESS * now.share),
        )

    still = [0.0 * t for t in times]
    lanes = times[0].shape[-1]
    begin = _Climb(times, jnp.full(lanes, -1.0), still, jnp.ones(lanes))
    found = jax.lax.fori_loop(0, ROUNDS, turn, begin)
    return found.times, found.square


def _newton(total, parts: list[list[Array]], steps):
    """Steps of all times towards the maximum of |x|^2/2, x the sum of all phases' parts.

    The second derivatives are diag(x . a) + V^T V of rates V and accelerations a, and are solved
    by Woodbury's identity; phase by phase where they are not those of a maximum.
    """
    t = total[:, None]
    rise = [jnp.sum(t * v, axis=0) for _, v, _ in parts]  # (s, c)
    bend = [jnp.sum(t * a, axis=0) for *_, a in parts]
    alone = [_move(r, b, h) for r, b, h in zip(rise, bend, steps, strict=True)]
    over = [jnp.where(b < 0, 1 / jnp.where(b < 0, b, -1.0), 0.0) for b in bend]

    def summed(terms):
        return functools.reduce(operator.add, (jnp.sum(x, axis=-2) for x in terms))

    rates = [v for _, v, _ in parts]  # (o, s, c)
    S = summed([v[:, None] * v * w for v, w in zip(rates, over, strict=True)])  # (o, o, c)
    S = S + jnp.eye(ROWS)[:, :, None]
    r = summed([v * w * x for v, w, x in zip(rates, over, rise, strict=True)])  # (o, c)
    cofactor = jnp.stack([jnp.cross(S[1], S[2], axis=0), jnp.cross(S[2], S[0], axis=0),
                          jnp.cross(S[0], S[1], axis=0)])  # fmt: skip
    det = jnp.sum(S[0] * cofactor[0], axis=0)
    peak = (S[0, 0] > 0) & (cofactor[2, 2] > 0) & (det > 0)
    y = jnp.sum(cofactor * r, axis=1) / jnp.where(peak, det, 1.0)
    moves = []
    for v, w, x, b, h, own in zip(rates, over, rise, bend, steps, alone, strict=True):
        joint = jnp.clip(-w * (x - jnp.sum(v * y[:, None], axis=0)), -h, h)
        moves.append(jnp.where(peak & (b < 0), joint, own))
    return moves
