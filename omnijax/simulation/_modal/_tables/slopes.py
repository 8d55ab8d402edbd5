"""Derivatives of a figure by tables, and by the poles and residues that show them."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..arithmetic import Pair, product, summed
from ..gradient import Slopes, seen
from ..lanes import Lanes
from ..system import Layout
from ..table_signals import TableSignals
from .outputs import TableLanes, knots, merged, residues, shown, table_lanes
from .response import Knots, PolesAlone, knots_of, response_at


def with_tables(
    slopes: Slopes, g: Lanes, layout: Layout, time: Float[Array, " t"],
    weights: Float[Array, "c o t"],
) -> Slopes:  # fmt: skip
    """The slopes with what the tables add to a figure of such derivatives by the outputs.

    `time` (s) since the start: of the samples of the outputs.
    """
    t = table_lanes(g, layout)
    psi, rate, direct, slope, tables = jax.lax.map(
        lambda one: _of_design(*one, layout, time), (t, weights)
    )
    last = jax.tree.map(lambda x: jnp.moveaxis(x, 0, -1), (psi, rate))  # (w, o, q, c)
    m = g.modes
    own = seen(m.kind, (m.c0[: layout.rows], m.c1[: layout.rows]))
    given = m.given(layout.tables)

    def shown_by(psi: Pair) -> Pair:  # (w, p, c)
        first, second = product(m.kind, own, _of_pairs(psi, layout))
        return summed(first, 1), summed(second, 1)

    def given_to(psi: Pair) -> Pair:  # (o, p, c)
        b = given[0][:, None], given[1][:, None]
        first, second = product(m.kind, b, _of_pairs(psi, layout))
        return summed(first), summed(second)

    return slopes._replace(
        shown=_before_start(slopes.shown, shown_by(last[0])),
        shown_rate=_before_start(slopes.shown_rate, shown_by(last[1])),
        given=_sum(slopes.given, given_to(last[0])),
        given_rate=_sum(slopes.given_rate, given_to(last[1])),
        direct=jnp.concatenate([slopes.direct, jnp.moveaxis(direct, 0, -1)]),
        rate=jnp.concatenate([slopes.rate, jnp.moveaxis(slope, 0, -1)]),
        signals=slopes.signals._replace(
            tables=TableSignals(*(jnp.moveaxis(x, 0, -1) for x in tables))
        ),
    )


def _of_design(own: TableLanes, weights: Float[Array, "o t"], layout: Layout, time):
    """Of one design: Psi and its derivative by the poles (w, o, q), the derivatives by what shows
    rho straight (w, o), and those by the tables.
    """
    kind, l0, l1 = own.poles
    along = jnp.ones_like(l0), jnp.where(kind > 0, 0.0, jnp.ones_like(l1))

    def one(table):
        signal, given, direct, slope = table

        def response(l0, l1):
            poles = PolesAlone(kind, l0, l1)
            return response_at(poles, knots_of(poles, *signal), time)

        here, moved = jax.jvp(response, (l0, l1), along)
        psi, rate = ((weights @ x.z[0].T, weights @ x.z[1].T) for x in (here, moved))
        w = merged(residues(own.pair, own.shown, given), layout)

        def figure(signal: TableSignals):
            response = response_at(own.poles, knots_of(own.poles, *signal), time)
            return jnp.sum(weights * shown(w, direct, slope, response))

        straight = weights @ here.rho[0], weights @ here.rho[1]
        return psi, rate, *straight, jax.grad(figure)(signal)

    return jax.lax.map(one, (own.tables, own.given, own.direct, own.slope))


def _of_pairs(psi: Pair, layout: Layout) -> Pair:
    """Of every pair, of those with poles that differ."""
    index = np.array(layout.pole)
    return psi[0][..., index, :], psi[1][..., index, :]


def _before_start(slopes: Pair, tables: Pair) -> Pair:
    first, second = (
        jnp.concatenate([x[:-1], y, x[-1:]]) for x, y in zip(slopes, tables, strict=True)
    )
    return first, second


def _sum(one: Pair, other: Pair) -> Pair:
    return one[0] + other[0], one[1] + other[1]
