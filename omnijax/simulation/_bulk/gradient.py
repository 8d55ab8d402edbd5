"""Gradients of bulk figures without differentiating the samples' loop.

Peak: by the envelope theorem the derivative of |x(t)|^2 at the peak's own sample, from the closed
form at one time, differentiated in reverse.  RMS: see `_bulk_square`.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._exact import rows_of
from .contact import Poles
from .design import Design, Layout, Wheel
from .materialise import stage
from .modes import Modes, modes, onto_directions
from .pole_pair import Pair, inverse, plus, scaled, stored_exponential, stored_sincos, times

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
