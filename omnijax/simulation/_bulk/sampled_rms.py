"""Mean square of bulk figures in closed form, for gradients without the samples' loop.

With the state z of a contact's modes at a sample, the sum of x_k^2 from there on is a quadratic
form, because for pole pairs E_m, E_n

    sum_{k<N} (z_m E_m^k)(z_n E_n^k) = (z_m z_n - z_m' z_n') / (1 - E_m E_n),   z' = z E^N

in the algebra of both pairs' units (four real numbers).  So the sum over a run is the form at its
first sample, less that after its last, and at every edge the form behind it less that before it:

    Q(b) - Q(a) = (b - a)' M (b + a),

of which only the Gram sums of b - a and b + a over the edges meet the matrix M.  The sinusoid of a
gap is one more pole pair; its own square, which never dies away, telescopes by itself.
"""

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .contact import Poles
from .design import Layout, Wheel
from .gradient import Orbit
from .materialise import branch
from .pole_pair import Pair, plus, scaled, stored_exponential, stored_sincos, times
from .product import Product, gram_form, product_inverse

WRITTEN_OUT = 24  # terms of a sum at most

Gaps = tuple[int, int]  # begins and ends of gaps that a wheel can meet in the run
Gram = list[list[Array]]  # by components u, v of either factor: (modes, modes, p, c)


class Marks(NamedTuple):
    """Samples at which the form counts, k of each wheel: behind its edges, or the run's ends."""

    near: Float[Array, "k p c"]  # s, from the last edge to the sample
    number: Float[Array, "k p c"]  # of the sample, from 0
    weight: Float[Array, "k p c"]  # 1; 0 for an edge outside the run; -1 at the run's end
    wave: Float[Array, "k p c"]  # the sinusoid there over that of its gap; 0 without


class Vectors(NamedTuple):
    """What the Gram sums are of, (modes, k, p, c), and the sinusoid in its unit, (1, k, p, c)."""

    jump: Pair  # b - a
    both: Pair  # b + a
    beside: Pair  # twice the state that has the sinusoid
    sinusoid: Pair


def count_edges(wheel: Wheel, moving, duration: float) -> Gaps:
    """Edges of a wheel in the run, the most of any wheel and design."""
    enter, leave = (
        np.where(moving, np.floor((duration * (1 + 1e-9) - first) / wheel.period) + 1, 0)
        for first in _first_edges(wheel, np)
    )
    return max(0, int(enter.max())), max(0, int(leave.max()))


def _first_edges(wheel: Wheel, xp):
    """Times of the first begin and the first end of a gap after the start."""
    back = wheel.passage - wheel.since
    return wheel.period - wheel.since, xp.where(back > 0, back, back + wheel.period)


def _edge_marks(wheel: Wheel, first, count: int, wave: float, layout: Layout):
    """Marks behind edges that come once a period, and the time of the last one in the run."""
    h = layout.step
    time = first + np.arange(count)[:, None, None] * wheel.period
    number = jnp.maximum(jnp.ceil(jax.lax.stop_gradient(time) / h) - 1, 0.0)
    weight = jnp.where(number < layout.samples, 1.0, 0.0)
    near = jnp.where(weight > 0, (number + 1) * h - time, 0.0)
    last = first + (jnp.sum(weight, axis=0) - 1) * wheel.period
    return Marks(near, number * weight, weight, wave * weight), last


def _end_marks(wheel: Wheel, last, layout: Layout) -> Marks:
    """The run's first sample and the one after its last, reckoned from the edges before them."""
    h, n = layout.step, layout.samples
    inside = wheel.since < wheel.passage
    start = h + jnp.where(inside, wheel.since, wheel.since - wheel.passage)
    late = jax.lax.stop_gradient(last[0]) >= jax.lax.stop_gradient(last[1])
    near = jnp.stack([start, (n + 1) * h - jnp.where(late, *last)])
    sign = jnp.broadcast_to(np.array([1.0, -1.0])[:, None, None], near.shape)
    number = jnp.broadcast_to(np.array([0.0, n])[:, None, None], near.shape)
    return Marks(near, number, sign, jnp.where(jnp.stack([inside, late]), 1.0, 0.0))


def _kernel(E: Pair, D, F: Pair, G) -> Product:
    """1/(1 - E F) for E over D and F over G."""
    p, q = Pair(1 - E.u * F.u, -E.v * F.u), Pair(-E.u * F.v, -E.v * F.v)
    return product_inverse(p, q, D, G)


def _kernels(lam: Poles, step: Pair, wave: Pair, rate):
    """1/(1 - E E') of every two of a contact's modes, and of each mode and the sinusoid."""
    E, D, G = [Pair(step.u[i], step.v[i]) for i in (0, 1)], lam.D, -(rate**2)
    own = [_kernel(E[i], D[i], E[k], D[k]) for i, k in ((0, 0), (0, 1), (1, 1))]
    return own, [_kernel(E[i], D[i], wave, G) for i in (0, 1)]


def _vectors(kind: str, o: Orbit, marks: Marks, near: Pair, late: Pair, turn) -> Vectors:
    """The states behind and before each mark, and the sinusoid that one of them has."""
    count, marks = marks.near.shape[0], jax.lax.stop_gradient(marks)
    D, fa, fb, rate = (_spread(x, count) for x in (o.lam.D, *o.forced, o.rate))
    gap, roller, rest, *through = (
        Pair(_spread(z.u, count), _spread(z.v, count))
        for z in (o.gap, o.roller, o.rest, *(Pair(o.through.u[i], o.through.v[i]) for i in (0, 1)))
    )
    decaying, nothing = times(rest, late, D), Pair(0.0 * D, 0.0 * D)
    if kind == "enter":
        behind, before = gap, times(roller, through[1], D)
    elif kind == "leave":
        behind, before = roller, times(gap, through[0], D)
    else:
        inside = marks.wave != 0
        behind = Pair(*(jnp.where(inside, a, b) for a, b in zip(gap, roller, strict=True)))
        before = nothing
    here, there = times(behind, near, D), scaled(-1.0, times(before, near, D))
    end = kind == "end"
    jump = plus(plus(here, there), decaying if end else nothing)
    both = plus(plus(here, scaled(-1.0, there)), scaled(1.0 if end else 2.0, decaying))
    beside = plus(jump, scaled(-1.0 if kind == "leave" else 1.0, both))
    s, c = turn
    wave = Pair(rate * (fa * c - fb * s) * marks.wave, (fa * s + fb * c) * marks.wave)
    weighted = [scaled(marks.weight, z) for z in (jump, beside)]
    return Vectors(weighted[0], both, weighted[1], Pair(wave.u[None], wave.v[None]))


def _grams(vectors: Vectors, marks: Marks, side: float):
    """Gram sums over the marks: free, beside the sinusoid, the sinusoid's own, and its samples."""
    v, marks = vectors, jax.lax.stop_gradient(marks)
    weight = jnp.where(marks.wave != 0, marks.weight * side, 0.0)
    free = [[_gram(a, b) for b in v.both] for a in v.jump]
    mixed = [[_gram(a, b) for b in v.sinusoid] for a in v.beside]
    own = [_gram(a * weight, v.sinusoid.v)[0, 0] for a in v.sinusoid]
    return free, mixed, own, _sum(weight * marks.number)


def _form(grams, kernels, forced, rate, turn):
    """The forms of all contacts by their kernels; `turn` is sine and cosine of rate h."""
    (free, mixed, waves, count), (own, cross), (s, c) = grams, kernels, turn
    total = 0.0
    for m, n, kernel in ((0, 0, own[0]), (0, 1, own[1]), (1, 1, own[2])):
        gram = [[free[a][b][m, n] for b in (0, 1)] for a in (0, 1)]
        if m != n:
            gram = [[gram[a][b] + free[b][a][n, m] for b in (0, 1)] for a in (0, 1)]
        total = total + gram_form(gram, kernel)
    for m in (0, 1):
        gram = [[mixed[a][b][m, 0] for b in (0, 1)] for a in (0, 1)]
        total = total + gram_form(gram, cross[m])
    # the sinusoid's own square: sums of cos and sin of 2 phi telescope, half a step before
    below = jnp.where(jnp.abs(s) > 1e-12, 2 * s, 1.0)
    total = total + (c * waves[0] / rate + s * waves[1]) / below
    return jnp.sum(total - 0.5 * count * (forced[0] ** 2 + forced[1] ** 2), axis=0)


def mean_square(o: Orbit, layout: Layout, gaps: Gaps):
    """Mean of |dR|^2 over the samples, (c,); every direction has its own wheel (no coupling)."""
    h, fall = layout.step, -1.0 if layout.half_turn else 1.0  # cosine of the phase at a gap's end
    first = _first_edges(o.wheel, jnp)
    (enter, last), (leave, left) = (
        _edge_marks(o.wheel, *x, layout) for x in zip(first, gaps, (1.0, fall), strict=True)
    )
    kinds = {"enter": enter, "leave": leave, "end": _end_marks(o.wheel, (last, left), layout)}
    late = [jnp.where(m.weight != 0, (m.number + 1) * h, 0.0) for m in kinds.values()]
    near = [*(m.near for m in kinds.values()), jnp.full_like(o.rate, h)[None]]
    E, F = _exponentials(o.lam, near), _exponentials(o.lam, late)
    s, c = (_split(x, near) for x in stored_sincos(o.rate * jnp.concatenate(near)))
    step, turn = Pair(E[-1].u[:, 0], E[-1].v[:, 0]), (s[-1][0], c[-1][0])
    kernels = branch(_kernels)(o.lam, step, Pair(turn[1], turn[0] / o.rate), o.rate)
    parts = []
    for k, (kind, marks) in enumerate(kinds.items()):
        if len(marks.near):
            vectors = branch(functools.partial(_vectors, kind))(o, marks, E[k], F[k], (s[k], c[k]))
            grams = functools.partial(_grams, side=-1.0 if kind == "leave" else 1.0)
            parts.append(branch(grams)(vectors, marks))
    grams = jax.tree.map(lambda *x: functools.reduce(jnp.add, x), *parts)
    return branch(_form)(grams, kernels, o.forced, o.rate, turn) / layout.samples


def _split(x, like: list) -> list:
    """Rows of x, whose axis is the third from the last, as many as each of `like` has."""
    return jnp.split(x, np.cumsum([len(y) for y in like])[:-1], axis=-3)


def _exponentials(lam: Poles, near: list) -> list[Pair]:
    """E(t) of the modes at times (k, p, c), all in one pass: (2, k, p, c) each."""
    E = stored_exponential(
        *jnp.broadcast_arrays(lam.u[:, None], lam.D[:, None], jnp.concatenate(near))
    )
    return [Pair(*x) for x in zip(_split(E.u, near), _split(E.v, near), strict=True)]


# Sums and their derivatives are written out below: XLA makes no vectors of reductions.


def _sum(x):
    """Sum over marks, the third axis from the last."""
    if x.shape[-3] > WRITTEN_OUT:
        return jnp.sum(x, axis=-3)
    return functools.reduce(jnp.add, (x[..., k, :, :] for k in range(x.shape[-3])))


def _spread(x, count: int):
    """x (..., p, c) at each of `count` marks."""

    @jax.custom_vjp
    def spread(x):
        return jnp.broadcast_to(x[..., None, :, :], (*x.shape[:-2], count, *x.shape[-2:]))

    spread.defvjp(lambda x: (spread(x), None), lambda _, bar: (_sum(bar),))
    return spread(x)


@jax.custom_vjp
def _gram(a, b):
    """Sums of a[m] b[n] over the marks; (m, n, p, c)."""
    return _sum(a[:, None] * b[None])


def _gram_back(saved, bar):
    a, b = saved
    a_bar = functools.reduce(jnp.add, (bar[:, n, None] * b[n] for n in range(len(b))))
    return a_bar, functools.reduce(jnp.add, (bar[m, :, None] * a[m] for m in range(len(a))))


_gram.defvjp(lambda a, b: (_gram(a, b), (a, b)), _gram_back)
