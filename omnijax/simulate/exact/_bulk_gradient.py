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

from ._bulk import Design, Layout, Modes, Wheel, modes, onto_directions
from ._contact import Poles
from ._ring import Pair, inverse, plus, scaled, stored_exponential, stored_sincos, times
from ._stage import stage

LEAST_DECAY = 1e-9  # of the pole's size, where the sum of squares of an undamped mode would diverge


class Orbit(NamedTuple):
    """The periodic motion per pair, and what dies away per direction."""

    gap: Pair  # (2, p, c): free state at the gap's start
    roller: Pair  # (2, p, c): at the gap's end
    rest: Pair  # (2, a, c): decays from the run's start
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
    whole, over, through, since = (Pair(E.u[i], E.v[i]) for i in range(4))
    factor = times(J, inverse(Pair(1 - whole.u, -whole.v), lam.D), lam.D)
    gap = times(factor, Pair(fall * over.u - 1, fall * over.v), lam.D)
    roller = times(factor, Pair(fall - through.u, -through.v), lam.D)
    inside = wheel.since < wheel.passage
    local = Pair(*(jnp.where(inside, a, b) for a, b in zip(gap, roller, strict=True)))
    local = onto_directions(times(local, since, lam.D), layout)
    return gap, roller, plus(initial, scaled(-1.0, local))


def orbit(design: Design, layout: Layout) -> Orbit:
    """The closed form that holds for all times."""
    m: Modes = stage(lambda d: modes(d, layout))(design)
    pair, sets = np.array(layout.wheel), np.array(layout.sets)
    row = sets[np.array(layout.axis)]
    lam = Poles(m.roots.u[:, row], m.roots.D[:, row])
    wheel = Wheel(*(x[pair] for x in design.wheel))
    inside = wheel.since < wheel.passage
    since = jnp.where(inside, wheel.since, wheel.since - wheel.passage)
    when = jnp.stack([wheel.period, wheel.period - wheel.passage, wheel.passage, since])
    E = _exponential(lam, when[:, None])

    def states(J: Pair, initial: Pair, lam: Poles, E: Pair, wheel: Wheel):
        return _orbit_of(J, initial, lam, E, wheel, layout)

    gap, roller, rest = stage(states)(m.J, m.initial, lam, E, wheel)
    roots = Poles(m.roots.u[:, sets], m.roots.D[:, sets])
    return Orbit(gap, roller, rest, lam, roots, m.forced, m.rate[pair], wheel)


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


class Product(NamedTuple):
    """A number p + q j with p, q in the first pair's numbers and j the second pair's unit."""

    p: Pair
    q: Pair


def _kernel(E: Pair, D, F: Pair, G) -> Product:
    """1/(1 - E F) for E over D and F over G."""
    p, q = Pair(1 - E.u * F.u, -E.v * F.u), Pair(-E.u * F.v, -E.v * F.v)
    square, cross = times(p, p, D), times(q, q, D)
    below = inverse(Pair(square.u - G * cross.u, square.v - G * cross.v), D)
    return Product(times(p, below, D), scaled(-1.0, times(q, below, D)))


def _form(a: Pair, b: Pair, K: Product):
    """Output of a b K: the coefficient of both units."""
    return a.u * b.u * K.q.v + a.v * b.u * K.q.u + a.u * b.v * K.p.v + a.v * b.v * K.p.u


def _at(z: Pair, mode: int) -> Pair:
    return Pair(z.u[mode], z.v[mode])


def _kernels(lam: Poles, step: Pair, wave: Pair, rate):
    """1/(1 - E E') for every two of a contact's modes and its forced sinusoid."""
    E, D, G = [_at(step, i) for i in (0, 1)], lam.D, -(rate**2)
    own = [_kernel(E[i], D[i], E[k], D[k]) for i, k in ((0, 0), (0, 1), (1, 1))]
    return own, [_kernel(E[i], D[i], wave, G) for i in (0, 1)]


class Ends(NamedTuple):
    """Where the spans of gaps and rollers begin and end; (g, c), g the gaps of all wheels."""

    number: Float[Array, "3 g c"]  # first sample after: gap's start, its end, the next gap's start
    into: Float[Array, "4 g c"]  # s since the span began: gap's two ends, roller's two ends


def _ends(wheel: Wheel, which: np.ndarray, count: np.ndarray, layout: Layout) -> Ends:
    P, tau, since = (x[which] for x in (wheel.period, wheel.passage, wheel.since))
    enter = jnp.asarray(count, float)[:, None] * P - since
    edges = jnp.stack([enter, enter + tau, enter + P])
    number = jnp.ceil(jax.lax.stop_gradient(edges) / layout.step) - 1
    number = jnp.clip(number, 0.0, layout.samples)
    time = (number + 1) * layout.step
    gap, roller = number[1] > number[0], number[2] > number[1]
    into = [
        jnp.where(filled, time[i] - edges[k], 0.0)
        for filled, i, k in ((gap, 0, 0), (gap, 1, 0), (roller, 1, 1), (roller, 2, 1))
    ]
    return Ends(number, jnp.stack(into))


def mean_square(o: Orbit, layout: Layout, gaps: tuple[int, ...]):
    """Mean of |dR|^2 over the samples, (c,); every direction has its own wheel (no coupling).

    `gaps` is the number of gaps of each wheel that the samples can see.
    """
    h = layout.step
    least = -LEAST_DECAY * jnp.sqrt(jnp.abs(o.lam.D))
    lam = Poles(jnp.minimum(o.lam.u, least), o.lam.D)
    s, c = stored_sincos(o.rate * h)
    own, mixed = stage(_kernels)(lam, _exponential(lam, h), Pair(c, s / o.rate), o.rate)
    which = np.repeat(np.arange(len(gaps)), gaps)
    ends = _ends(o.wheel, which, np.concatenate([np.arange(n) for n in gaps]), layout)
    many = Poles(lam.u[:, which], lam.D[:, which])
    late = _exponential(many, (ends.number[:, None] + 1) * h)
    E = _exponential(many, ends.into[:, None])
    waves = stored_sincos(o.rate[which] * ends.into[:2])

    def pick(x):
        return jax.tree.map(lambda v: v[..., which, :], x)

    args = (pick((o.gap, o.roller, o.rest)), many, pick((own, mixed)), pick(o.forced))
    tails = (o.rate[which], late, E, waves, ends.number, pick((s, c)))
    return stage(_sum_of_spans)(*args, *tails) / layout.samples


def _sum_of_spans(states, lam: Poles, kernels, forced, rate, late, E, waves, number, turn):
    """Sum of x_k^2 over all spans: the quadratic form at each span's start less that at its end."""
    (gap, roller, rest), (own, mixed), (fa, fb), (s, c) = states, kernels, forced, turn
    filled = (number[1] > number[0], number[2] > number[1])

    def free(start: Pair, k: int, edge: int) -> Pair:
        near = times(start, Pair(E.u[k], E.v[k]), lam.D)
        return plus(near, times(rest, Pair(late.u[edge], late.v[edge]), lam.D))

    def form(z: Pair):
        a, b = _at(z, 0), _at(z, 1)
        return _form(a, a, own[0]) + 2 * _form(a, b, own[1]) + _form(b, b, own[2])

    def with_wave(z: Pair, k: int):
        S, C = waves[0][k], waves[1][k]
        f = Pair(rate * (fa * C - fb * S), fa * S + fb * C)
        cross = 2 * (_form(_at(z, 0), f, mixed[0]) + _form(_at(z, 1), f, mixed[1]))
        # sums of cos(2 phi), sin(2 phi) over samples telescope with phi shifted half a step
        double_s, double_c = 2 * S * C, C * C - S * S
        low_s, low_c = double_s * c - double_c * s, double_c * c + double_s * s
        below = jnp.where(jnp.abs(s) > 1e-12, 2 * s, 1.0)
        return cross - (0.5 * (fb**2 - fa**2) * low_s - fa * fb * low_c) / below

    begin, end = free(gap, 0, 0), free(gap, 1, 1)
    over = form(begin) + with_wave(begin, 0) - form(end) - with_wave(end, 1)
    over = over + 0.5 * (number[1] - number[0]) * (fa**2 + fb**2)
    flat = form(free(roller, 2, 1)) - form(free(roller, 3, 2))
    total = jnp.where(filled[0], over, 0.0) + jnp.where(filled[1], flat, 0.0)
    return jnp.sum(total, axis=0)
