"""Newton's method up the length of a sum of outputs of phases, each at its own time."""

import functools
import operator
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from ..arithmetic import summed
from ..lanes import ROWS
from .curves import ModalCurves, moved, values_at
from .phases import Spot

LESS = 0.25  # of a step that went too far
SMALL = 1e-3  # of a step between samples: what Newton's method still moves at the end


def unit(total):
    size = jnp.sqrt(summed(total**2))
    return total / jnp.where(size > 0, size, 1.0)


def ascended(f: ModalCurves, d, spot: Spot, step) -> Spot:
    """One step of Newton's method up d . x of each phase, d (o, 1, c)."""
    _, rise, bend = (summed(d * x) for x in values_at(f, spot, 3))
    return moved(spot, move_up(rise, bend, step))


def move_up(rise, bend, step):
    """To the maximum of a parabola in time, or up by `step` where there is none so near."""
    move = jnp.where(bend < 0, -rise / jnp.where(bend < 0, bend, -1.0), step * jnp.sign(rise))
    return jnp.clip(move, -step, step)


def risen(f: ModalCurves, signs, spot: Spot, step, rounds: int):
    """Spots and heights of the maxima of one output times `signs` (n, 1, 1), never lower than at
    first; spots and steps have a leading axis (n).
    """

    def turn(_, now):
        spot, best, move, share = now
        tried = moved(spot, share * move)
        each = jax.vmap(lambda spot: values_at(f, spot, 3))(tried)
        x, v, a = (signs * x[:, 0] for x in each)
        better = x > best
        return (
            chosen(better, tried, spot),
            jnp.where(better, x, best),
            jnp.where(better, move_up(v, a, step), move),
            jnp.where(better, 1.0, LESS * share),
        )

    still = 0.0 * spot.time
    start = spot, jnp.full(still.shape, -jnp.inf), still, still + 1.0
    spot, height, move, _ = jax.lax.fori_loop(0, rounds, turn, start)
    return _settled(spot, move, step), height


def _settled(spot: Spot, move, step) -> Spot:
    """The spot by the last step of Newton's method further, where that is a small one.

    A value tells a time to half its digits; where the slope is zero it is known to nearly all.
    """
    return moved(spot, jnp.where(jnp.abs(move) < SMALL * step, move, 0.0))


def chosen(better, tried: Spot, spot: Spot) -> Spot:
    """The spot tried where that is better."""
    return jax.tree.map(lambda x, y: jnp.where(better, x, y), tried, spot)


class _Climb(NamedTuple):
    """The highest spots so far, the sum and its square there, and the step to try next."""

    spots: list[Spot]
    total: Float[Array, "o c"]
    square: Float[Array, " c"]
    moves: list[Array]
    share: Float[Array, " c"]  # of the moves


def climbed(every: list[ModalCurves], held, spots: list[Spot], steps, rounds: int):
    """Spots, the sum of the outputs (o, c) and its square after `rounds` of Newton's method in all
    times together.

    Never lower than at first.
    """

    def turn(_, now: _Climb) -> _Climb:
        each = zip(now.spots, now.moves, strict=True)
        tried = [moved(spot, now.share * move) for spot, move in each]
        parts = [values_at(f, spot, 3) for f, spot in zip(every, tried, strict=True)]
        total = held + sum(summed(part[0], 1) for part in parts)
        square = summed(total**2)
        better = square > now.square
        moves = _newton(total, parts, steps, [_inwards(spot) for spot in tried])
        return _Climb(
            [chosen(better, x, spot) for x, spot in zip(tried, now.spots, strict=True)],
            jnp.where(better, total, now.total),
            jnp.where(better, square, now.square),
            [jnp.where(better, x, m) for x, m in zip(moves, now.moves, strict=True)],
            jnp.where(better, 1.0, LESS * now.share),
        )

    still = [0.0 * spot.time for spot in spots]
    lanes = still[0].shape[-1]
    begin = _Climb(spots, jnp.zeros((ROWS, lanes)), jnp.full(lanes, -1.0), still, jnp.ones(lanes))
    top = jax.lax.fori_loop(0, rounds, turn, begin)
    each = zip(top.spots, top.moves, steps, strict=True)
    return [_settled(*x) for x in each], top.total, top.square


def _inwards(spot: Spot):
    """The sense in which a spot at an edge may move, -1 or 1; else 0."""
    return jnp.where(spot.time >= spot.end, -1.0, jnp.where(spot.time <= spot.begin, 1.0, 0.0))


def following(every: list[ModalCurves], spots: list[Spot], total) -> Float[Array, "s o o c"]:
    """Matrices F beside each phase at a maximum of the sum: how the others follow a change.

    When it changes by d and all others go to their new maximum, the square of the sum u grows by
    u . F u beyond that of u itself, to second order; F total is zero.
    """
    parts = [values_at(f, spot, 3) for f, spot in zip(every, spots, strict=True)]
    *_, over = _slopes(total, parts, [_inwards(spot) for spot in spots])
    each = [v[:, None] * v * w for (_, v, _), w in zip(parts, over, strict=True)]
    own = jnp.moveaxis(jnp.concatenate(each, axis=2), 2, 0)
    still = jnp.eye(ROWS)[:, :, None]

    def beside(own):
        inverse, peak = _inverted(still + whole - own)
        return jnp.where(peak, inverse - still, 0.0)

    whole = jnp.sum(own, axis=0)
    return jax.vmap(beside)(own)


def _slopes(total, parts: list[list[Array]], inwards: list[Array]):
    """x . v and x . a of each phase (s, c), and 1/(x . a) of those that are free at a maximum."""
    t = total[:, None]
    rise = [summed(t * v) for _, v, _ in parts]
    bend = [summed(t * a) for *_, a in parts]
    free = [side * r >= 0 for side, r in zip(inwards, rise, strict=True)]
    over = [
        jnp.where((b < 0) & yes, 1 / jnp.where(b < 0, b, -1.0), 0.0)
        for b, yes in zip(bend, free, strict=True)
    ]
    return rise, bend, over


def _newton(total, parts: list[list[Array]], steps, inwards: list[Array]):
    """Steps of all times towards the maximum of |x|^2/2, x the sum of all phases' parts.

    Those that would go beyond an edge stay.

    The second derivatives are diag(x . a) + V^T V of rates V and accelerations a, and are solved
    by Woodbury's identity; phase by phase where they are not those of a maximum.
    """
    rise, bend, over = _slopes(total, parts, inwards)
    alone = [move_up(r, b, h) for r, b, h in zip(rise, bend, steps, strict=True)]

    def gathered(terms):
        return functools.reduce(operator.add, (summed(x, x.ndim - 2) for x in terms))

    rates = [v for _, v, _ in parts]  # (o, s, c)
    S = gathered([v[:, None] * v * w for v, w in zip(rates, over, strict=True)])  # (o, o, c)
    S = S + jnp.eye(ROWS)[:, :, None]
    r = gathered([v * w * x for v, w, x in zip(rates, over, rise, strict=True)])  # (o, c)
    inverse, peak = _inverted(S)
    y = summed(inverse * r, 1)
    moves = []
    for v, w, x, b, h, own in zip(rates, over, rise, bend, steps, alone, strict=True):
        joint = jnp.clip(-w * (x - summed(v * y[:, None])), -h, h)
        moves.append(jnp.where(peak & (b < 0), joint, own))
    return moves


def _inverted(S: Float[Array, "3 3 c"]) -> tuple[Float[Array, "3 3 c"], Bool[Array, " c"]]:
    """The inverses of symmetric matrices, and which of them are positive definite.

    `dynamics._small.inverse` by cofactors once more, but of many matrices along the last axis: a
    `vmap` of that would move the lanes to the front.  The cofactors also tell the definiteness.
    """
    cofactor = jnp.stack([jnp.cross(S[1], S[2], axis=0), jnp.cross(S[2], S[0], axis=0),
                          jnp.cross(S[0], S[1], axis=0)])  # fmt: skip
    det = summed(S[0] * cofactor[0])
    positive = (S[0, 0] > 0) & (cofactor[2, 2] > 0) & (det > 0)
    return cofactor / jnp.where(positive, det, 1.0), positive
