"""RMS, supremum and margins of the long run of many designs, and their derivatives."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from ..._root import root
from .arithmetic import Pair, materialised, product, quotient
from .gradient import ROWS, Slopes, along_poles, half_root, of_psi
from .phases import columns_of, cycle_of, given, ones, phases_of, response
from .poles import PolePairs
from .signals import CONSTANT, Signals
from .steady_margins import steady_margins
from .steady_mean import mean_square, put, steady_slopes
from .supremum import Supremum, supremum
from .system import Layout
from .transient import Lanes


def steady_of(g: Lanes, layout: Layout, gradient: bool) -> tuple[Array, Slopes | None]:
    """RMS, supremum, normal force and grip (4, c); derivatives of the first two, stacked."""
    mean, top = mean_square(g, layout), supremum(g, layout)
    squares = mean.value, top.square
    figures = (materialised(root, x) for x in squares)
    values = jnp.stack([*figures, *steady_margins(g, layout)])
    if not gradient:
        return values, None
    slopes = steady_slopes(g, layout, mean), _supremum_slopes(g, layout, top)
    return values, jax.tree.map(
        lambda *x: jnp.stack([y * half_root(s) for y, s in zip(x, squares, strict=True)]), *slopes
    )


def _supremum_slopes(g: Lanes, layout: Layout, top: Supremum) -> Slopes:
    """Derivatives of the square of the supremum, by the envelope theorem."""
    m, groups, weight = g.modes, phases_of(layout), 2 * top.total
    count, lanes = len(layout.kinds), m.l0.shape[-1]

    def psi(m: PolePairs) -> tuple[Pair, Array]:
        none = jnp.zeros((ROWS, count + 1, len(m.kind), lanes))
        total, direct = (none, none), jnp.zeros((ROWS, count, lanes))
        for phases, time in zip(groups, top.times, strict=True):
            now = response(m, cycle_of(g.signals, layout, phases), time)
            number = np.array(phases.first)
            each = [weight[:, None, None] * jnp.swapaxes(x, 0, 1) for x in now.pole]
            total = put(total, number, (each[0], each[1]))
            direct = direct.at[:, number].set(weight[:, None] * now.level)
        still = np.array([i for i, kind in enumerate(layout.kinds) if kind.phase == CONSTANT], int)
        held = quotient(m.kind, ones(m), (-m.l0, -m.l1))
        each = [jnp.broadcast_to(weight[:, None] * x, none[:, 0].shape)[:, None] for x in held]
        total = put(total, still, (each[0], each[1]))
        return total, direct.at[:, still].set(weight[:, None])

    def figure(signals: Signals):
        value = 0.0
        for phases, time in zip(groups, top.times, strict=True):
            now = response(m, cycle_of(signals, layout, phases), time)
            columns = columns_of(layout, phases)
            z = product(m.kind[:, None], given(m, columns), now.pole)
            seen = jnp.sum(m.c0[:ROWS, :, None] * z[0] + m.c1[:ROWS, :, None] * z[1], axis=1)
            seen = seen + jnp.moveaxis(g.direct[columns][:, :ROWS], 1, 0) * now.level
            value += jnp.sum(weight[:, None] * seen)
        return value

    (value, direct), (rate, _) = along_poles(m, psi)
    both = of_psi(m, layout, value, rate)
    return Slopes(*both, jax.grad(figure)(g.signals), jnp.swapaxes(direct, 0, 1))
