"""Gradients of bulk figures without differentiating the samples' loop.

Peak: by the envelope theorem the derivative of |x(t)|^2 at the peak's own sample, from the closed
form at one time.  RMS: between two edges the sum of x_k^2 over the samples is a difference of one
quadratic form at both ends, because for pole pairs E_m, E_n

    sum_{k<N} (z_m E_m^k)(z_n E_n^k) = (z_m z_n - z_m' z_n') / (1 - E_m E_n),   z' = z E^N

taken in the algebra of both pairs' units (four real numbers).  Both are differentiated in reverse.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ._bulk_design import Design, Layout, Wheel
from ._bulk_modes import Modes, modes, onto_directions
from ._contact import Poles
from ._product import Product, form, product_inverse
from ._ring import Pair, inverse, plus, scaled, stored_exponential, stored_sincos, times
from ._rows import rows_of
from ._stage import stage

LEAST_DECAY = 1e-9  # of the pole's size, where the sum of squares of an undamped mode would diverge


class Orbit(NamedTuple):
    """The periodic motion per pair, and what dies away per direction."""

    gap: Pair  # (2, p, c): free state at the gap's start
    roller: Pair  # (2, p, c): at the gap's end
    rest: Pair  # (2, a, c): decays from the run's start
    through: Pair  # (2, 2, p, c): exponentials over the gap, and from its end to the next one
    lam: Poles  # (2, p, c)
    roots: Poles  # (2, a, c)
    forced: tuple[Array, Array]  # (p, c)
    rate: Float[Array, "p c"]
    wheel: Wheel  # (p, c)


def _exponential(lam: Poles, t) -> Pair:
    return stored_exponential(*jnp.broadcast_arrays(lam.u, lam.D, t))


def _orbit_of(J: Pair, initial: Pair, lam: Poles, E: Pair, wheel: Wheel, layout: Layout):
    """gap = J (f E(P - tau) - 1)/(1 - E(P)), roller = J (f - E(tau))/(1 - E(P)), f = cos(span)."""
    fall = -1.0 if layout.half_turn else 1.0
    through, over, since = (Pair(E.u[i], E.v[i]) for i in range(3))
    whole = times(through, over, lam.D)
    factor = times(J, inverse(Pair(1 - whole.u, -whole.v), lam.D), lam.D)
    gap = times(factor, Pair(fall * over.u - 1, fall * over.v), lam.D)
    roller = times(factor, Pair(fall - through.u, -through.v), lam.D)
    inside = wheel.since < wheel.passage
    local = Pair(*(jnp.where(inside, a, b) for a, b in zip(gap, roller, strict=True)))
    local = onto_directions(times(local, since, lam.D), layout)
    return gap, roller, plus(initial, scaled(-1.0, local))


def stored_modes(design: Design, layout: Layout) -> Modes:
    """`modes`, computed once and stored."""
    return stage(lambda d: modes(d, layout))(design)


def orbit(m: Modes, wheel: Wheel, layout: Layout) -> Orbit:
    """The closed form that holds for all times."""
    pair, sets = np.array(layout.wheel), np.array(layout.sets)
    row = sets[np.array(layout.axis)]
    roots = m.roots._replace(u=jnp.minimum(m.roots.u, -LEAST_DECAY * jnp.sqrt(jnp.abs(m.roots.D))))
    lam = Poles(rows_of(roots.u, row), rows_of(roots.D, row))
    wheel = Wheel(*(rows_of(x, pair) for x in wheel))
    inside = wheel.since < wheel.passage
    since = jnp.where(inside, wheel.since, wheel.since - wheel.passage)
    when = jnp.stack([wheel.passage, wheel.period - wheel.passage, since])
    E = _exponential(lam, when[:, None])

    def states(J: Pair, initial: Pair, lam: Poles, E: Pair, wheel: Wheel):
        return _orbit_of(J, initial, lam, E, wheel, layout)

    gap, roller, rest = stage(states)(m.J, m.initial, lam, E, wheel)
    roots = Poles(rows_of(roots.u, sets), rows_of(roots.D, sets))
    through = Pair(E.u[:2], E.v[:2])
    return Orbit(gap, roller, rest, through, lam, roots, m.forced, rows_of(m.rate, pair), wheel)


def square_at(o: Orbit, layout: Layout, time, gram=None):
    """|dR|^2 at one time (s, from the start) per design; (c,)."""
    angle = time + o.wheel.since
    local = angle - jax.lax.stop_gradient(jnp.floor(angle / o.wheel.period)) * o.wheel.period
    inside = local < o.wheel.passage
    E = _exponential(o.lam, jnp.where(inside, local, local - o.wheel.passage))
    late = _exponential(o.roots, time)
    s, c = stored_sincos(o.rate * local)

    def total(o: Orbit, E: Pair, late: Pair, s, c, inside, gram):
        start = Pair(*(jnp.where(inside, a, b) for a, b in zip(o.gap, o.roller, strict=True)))
        wave = jnp.where(inside, o.forced[0] * s + o.forced[1] * c, 0.0)
        pairs = jnp.sum(times(start, E, o.lam.D).v, axis=0) + wave
        free = jnp.sum(times(o.rest, late, o.roots.D).v, axis=0)
        x = [free[a] for a in range(layout.directions)]
        for p, a in enumerate(layout.axis):
            x[a] = x[a] + pairs[p]
        if gram is None:
            return sum(v * v for v in x)
        return sum(gram[a, b] * x[a] * x[b] for a in range(len(x)) for b in range(len(x)))

    return total(o, E, late, s, c, inside, gram)


def _kernel(E: Pair, D, F: Pair, G) -> Product:
    """1/(1 - E F) for E over D and F over G."""
    p, q = Pair(1 - E.u * F.u, -E.v * F.u), Pair(-E.u * F.v, -E.v * F.v)
    return product_inverse(p, q, D, G)


def _at(z: Pair, mode: int) -> Pair:
    return Pair(z.u[mode], z.v[mode])


def _kernels(lam: Poles, step: Pair, wave: Pair, rate):
    """1/(1 - E E') for every two of a contact's modes and its forced sinusoid."""
    E, D, G = [_at(step, i) for i in (0, 1)], lam.D, -(rate**2)
    own = [_kernel(E[i], D[i], E[k], D[k]) for i, k in ((0, 0), (0, 1), (1, 1))]
    return own, [_kernel(E[i], D[i], wave, G) for i in (0, 1)]


class Edges(NamedTuple):
    """Where gaps begin and end on the samples; g the gaps of all wheels, two edges each."""

    number: Float[Array, "2 g c"]  # first sample after the edge
    time: Float[Array, "2 g c"]  # s
    counts: Array  # (2, g, c): whether the edge lies in the run


def _edges(wheel: Wheel, which: np.ndarray, count: np.ndarray, layout: Layout) -> Edges:
    P, tau, since = (x[which] for x in (wheel.period, wheel.passage, wheel.since))
    enter = jnp.asarray(count, float)[:, None] * P - since
    time = jnp.stack([enter, enter + tau])
    number = jnp.ceil(jax.lax.stop_gradient(time) / layout.step) - 1
    counts = (jax.lax.stop_gradient(time) > 0) & (number < layout.samples)
    return Edges(jnp.clip(number, 0.0, layout.samples), time, counts)


class Ends(NamedTuple):
    """Both ends of the run: in a gap or not, and since when; (2, j, c)."""

    inside: Array
    since: Array  # s since the last edge, at the first sample and at the one after the last
    time: Array  # s since the start, the same


def _ends(wheel: Wheel, edges: Edges, gaps: tuple[int, ...], layout: Layout) -> Ends:
    """The run's ends, from the last edge before each of them."""
    first = np.cumsum((0, *gaps[:-1]))
    before = [-wheel.since, wheel.passage - wheel.since]
    before[1] = jnp.where(before[1] > 0, before[1] - wheel.period, before[1])
    last = [
        jnp.stack(
            [
                _latest(edges, kind, g, n, early[j])
                for j, (g, n) in enumerate(zip(first, gaps, strict=True))
            ]
        )
        for kind, early in enumerate(before)
    ]
    times = jnp.stack(
        [jnp.full_like(wheel.period, (n + 1) * layout.step) for n in (0, layout.samples)]
    )
    edge = [jnp.stack([a, b]) for a, b in zip(before, last, strict=True)]  # kind: (2, j, c)
    inside = jax.lax.stop_gradient(edge[0]) >= jax.lax.stop_gradient(edge[1])
    return Ends(inside, times - jnp.where(inside, edge[0], edge[1]), times)


def _latest(edges: Edges, kind: int, start: int, count: int, early):
    """Time of the last edge of one kind and wheel in the run; `early` where none is."""
    rows = slice(start, start + count)
    times = jnp.where(edges.counts[kind, rows], edges.time[kind, rows], -jnp.inf)
    return jnp.maximum(jnp.max(times, axis=0), early)


class Sums(NamedTuple):
    """Kernels of one wheel's sums over samples, and its forced sinusoid."""

    own: list  # of each two modes
    mixed: list  # of each mode and the sinusoid
    fa: Array
    fb: Array
    rate: Array
    s: Array  # sine and cosine of rate h
    c: Array


def mean_square(o: Orbit, layout: Layout, gaps: tuple[int, ...]):
    """Mean of |dR|^2 over the samples, (c,); every direction has its own wheel (no coupling).

    Between edges the sum is a quadratic form at the span's start less that at its end, so in all
    what each edge changes in the form, and the form at the run's ends.  `gaps` is the number of
    gaps of each wheel that the samples can see.
    """
    h, lam = layout.step, o.lam
    s, c = stored_sincos(o.rate * h)
    own, mixed = stage(_kernels)(lam, _exponential(lam, h), Pair(c, s / o.rate), o.rate)
    sums = Sums(own, mixed, *o.forced, o.rate, s, c)
    which = np.repeat(np.arange(len(gaps)), gaps)
    edges = _edges(o.wheel, which, np.concatenate([np.arange(n) for n in gaps]), layout)
    many = Poles(lam.u[:, which], lam.D[:, which])
    into = jnp.where(edges.counts, (edges.number + 1) * h - edges.time, 0.0)
    near = _exponential(many, into[:, None])
    late = _exponential(many, jnp.where(edges.counts, edges.time + into, 0.0)[:, None])
    waves = stored_sincos(o.rate[which] * into)
    ends = _ends(o.wheel, edges, gaps, layout)
    start, stop = (_exponential(lam, x[:, None]) for x in (ends.since, ends.time))
    turns = stored_sincos(o.rate * ends.since)
    fall = -1.0 if layout.half_turn else 1.0
    states = (o.gap, o.roller, o.rest)

    def edge_sum(states, lam, sums, through, edges, near, late, waves):
        return _edge_sum(states, lam, sums, through, edges, near, late, waves, which, fall)

    total = stage(edge_sum)(states, lam, sums, o.through, edges, near, late, waves)
    total = total + stage(_end_sum)(states, lam, sums, ends, start, stop, turns)
    return total / layout.samples


def _free_form(z: Pair, own):
    a, b = _at(z, 0), _at(z, 1)
    return form(a, a, own[0]) + 2 * form(a, b, own[1]) + form(b, b, own[2])


def _wave_form(z: Pair, sums: Sums, S, C, number):
    """The part of the form that the sinusoid adds, S and C its phase's at the sample `number`."""
    fa, fb, s, c = sums.fa, sums.fb, sums.s, sums.c
    f = Pair(sums.rate * (fa * C - fb * S), fa * S + fb * C)
    cross = 2 * (form(_at(z, 0), f, sums.mixed[0]) + form(_at(z, 1), f, sums.mixed[1]))
    # sums of cos(2 phi), sin(2 phi) over samples telescope with phi shifted half a step
    double_s, double_c = 2 * S * C, C * C - S * S
    low_s, low_c = double_s * c - double_c * s, double_c * c + double_s * s
    below = jnp.where(jnp.abs(s) > 1e-12, 2 * s, 1.0)
    square = (0.5 * (fb**2 - fa**2) * low_s - fa * fb * low_c) / below
    return cross - square - 0.5 * number * (fa**2 + fb**2)


def _edge_sum(
    states, lam: Poles, sums: Sums, through, edges: Edges, near, late, waves, which, fall
):
    """What the edges change in the form: the form after each less the form before it."""
    gap, roller, rest = states
    ended = [times(z, Pair(through.u[i], through.v[i]), lam.D) for i, z in enumerate((gap, roller))]
    gap, roller, left, rolled, rest, lam, sums = jax.tree.map(
        lambda v: v[..., which, :], (gap, roller, *ended, rest, lam, sums)
    )

    def free(start: Pair, k: int) -> Pair:
        z = times(start, Pair(near.u[k], near.v[k]), lam.D)
        return plus(z, times(rest, Pair(late.u[k], late.v[k]), lam.D))

    after, before = free(gap, 0), free(rolled, 0)
    enter = _free_form(after, sums.own) - _free_form(before, sums.own)
    enter = enter + _wave_form(after, sums, waves[0][0], waves[1][0], edges.number[0])
    after, before = free(roller, 1), free(left, 1)
    leave = _free_form(after, sums.own) - _free_form(before, sums.own)
    wave = fall * waves[0][1], fall * waves[1][1]
    leave = leave - _wave_form(before, sums, *wave, edges.number[1])
    total = jnp.where(edges.counts[0], enter, 0.0) + jnp.where(edges.counts[1], leave, 0.0)
    return jnp.sum(total, axis=0)


def _end_sum(states, lam: Poles, sums: Sums, ends: Ends, start, stop, turns):
    """The form at the run's first sample less that at the sample after its last."""
    gap, roller, rest = states
    total = 0.0
    for k, sign in ((0, 1.0), (1, -1.0)):
        inside = ends.inside[k]
        begin = Pair(*(jnp.where(inside, a, b) for a, b in zip(gap, roller, strict=True)))
        z = times(begin, Pair(start.u[k], start.v[k]), lam.D)
        z = plus(z, times(rest, Pair(stop.u[k], stop.v[k]), lam.D))
        number = jnp.round(ends.time[k] / ends.time[0]) - 1
        wave = _wave_form(z, sums, turns[0][k], turns[1][k], number)
        total = total + sign * (_free_form(z, sums.own) + jnp.where(inside, wave, 0.0))
    return jnp.sum(total, axis=0)
