"""Newton's method up the length of a sum of outputs of phases, each at its own time."""

import functools
import operator
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .arithmetic import summed
from .curves import ModalCurves, values_at
from .gradient import ROWS

LESS = 0.25  # of a step that went too far


def unit(total):
    size = jnp.sqrt(summed(total**2))
    return total / jnp.where(size > 0, size, 1.0)


def ascended(f: ModalCurves, d, time, step):
    """One step of Newton's method up d . x of each phase, d (o, 1, c)."""
    _, rise, bend = (summed(d * x) for x in values_at(f, time, 3))
    return time + move_up(rise, bend, step)


def move_up(rise, bend, step):
    """To the maximum of a parabola in time, or up by `step` where there is none so near."""
    move = jnp.where(bend < 0, -rise / jnp.where(bend < 0, bend, -1.0), step * jnp.sign(rise))
    return jnp.clip(move, -step, step)


def risen(f: ModalCurves, signs, time: Float[Array, "n s c"], step, rounds: int):
    """Times and heights of the maxima of one output times `signs` (n, 1, 1), never lower than at
    first.
    """

    def turn(_, now):
        time, best, move, share = now
        tried = time + share * move
        x, v, a = (signs * x[:, 0] for x in _at_each(f, tried, 3))
        better = x > best
        return (
            jnp.where(better, tried, time),
            jnp.where(better, x, best),
            jnp.where(better, move_up(v, a, step), move),
            jnp.where(better, 1.0, LESS * share),
        )

    start = time, jnp.full(time.shape, -jnp.inf), 0.0 * time, 0.0 * time + 1.0
    return jax.lax.fori_loop(0, rounds, turn, start)[:2]


def _at_each(f: ModalCurves, time, orders: int) -> list[Array]:
    """`values_at` of rows of times (n, s, c), (n, r, s, c)."""
    return jax.vmap(lambda time: values_at(f, time, orders))(time)


class _Climb(NamedTuple):
    """The highest times so far, dR and |dR|^2 there, and the step to try next."""

    times: list[Array]
    total: Float[Array, "o c"]
    square: Float[Array, " c"]
    moves: list[Array]
    share: Float[Array, " c"]  # of the moves


def climbed(every: list[ModalCurves], held, times, steps, rounds: int):
    """Times, dR (o, c) and |dR|^2 after `rounds` of Newton's method in all times together.

    Never lower than at first.
    """

    def turn(_, now: _Climb) -> _Climb:
        tried = [t + now.share * move for t, move in zip(now.times, now.moves, strict=True)]
        parts = [values_at(f, t, 3) for f, t in zip(every, tried, strict=True)]
        total = held + sum(summed(part[0], 1) for part in parts)
        square = summed(total**2)
        better = square > now.square
        moves = _newton(total, parts, steps)
        return _Climb(
            [jnp.where(better, x, t) for x, t in zip(tried, now.times, strict=True)],
            jnp.where(better, total, now.total),
            jnp.where(better, square, now.square),
            [jnp.where(better, x, m) for x, m in zip(moves, now.moves, strict=True)],
            jnp.where(better, 1.0, LESS * now.share),
        )

    still = [0.0 * t for t in times]
    lanes = times[0].shape[-1]
    begin = _Climb(times, jnp.zeros((ROWS, lanes)), jnp.full(lanes, -1.0), still, jnp.ones(lanes))
    top = jax.lax.fori_loop(0, rounds, turn, begin)
    return top.times, top.total, top.square


def _newton(total, parts: list[list[Array]], steps):
    """Steps of all times towards the maximum of |x|^2/2, x the sum of all phases' parts.

    The second derivatives are diag(x . a) + V^T V of rates V and accelerations a, and are solved
    by Woodbury's identity; phase by phase where they are not those of a maximum.
    """
    t = total[:, None]
    rise = [summed(t * v) for _, v, _ in parts]  # (s, c)
    bend = [summed(t * a) for *_, a in parts]
    alone = [move_up(r, b, h) for r, b, h in zip(rise, bend, steps, strict=True)]
    over = [jnp.where(b < 0, 1 / jnp.where(b < 0, b, -1.0), 0.0) for b in bend]

    def gathered(terms):
        return functools.reduce(operator.add, (summed(x, x.ndim - 2) for x in terms))

    rates = [v for _, v, _ in parts]  # (o, s, c)
    S = gathered([v[:, None] * v * w for v, w in zip(rates, over, strict=True)])  # (o, o, c)
    S = S + jnp.eye(ROWS)[:, :, None]
    r = gathered([v * w * x for v, w, x in zip(rates, over, rise, strict=True)])  # (o, c)
    cofactor = jnp.stack([jnp.cross(S[1], S[2], axis=0), jnp.cross(S[2], S[0], axis=0),
                          jnp.cross(S[0], S[1], axis=0)])  # fmt: skip
    det = summed(S[0] * cofactor[0])
    peak = (S[0, 0] > 0) & (cofactor[2, 2] > 0) & (det > 0)
    y = summed(cofactor * r, 1) / jnp.where(peak, det, 1.0)
    moves = []
    for v, w, x, b, h, own in zip(rates, over, rise, bend, steps, alone, strict=True):
        joint = jnp.clip(-w * (x - summed(v * y[:, None])), -h, h)
        moves.append(jnp.where(peak & (b < 0), joint, own))
    return moves
