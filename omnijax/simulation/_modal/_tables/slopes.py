"""Derivatives of a figure by tables, and by the poles and residues that show them."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..arithmetic import Pair, onward, product, summed
from ..gradient import Slopes, seen
from ..lanes import Lanes
from ..system import Layout
from ..table_signals import TableSignals
from .outputs import TableLanes, merged, shown
from .response import PolesAlone, decay_at, knots_of, response_at


class TableSums(NamedTuple):
    """Sums over the samples of a figure's derivatives by the outputs, one leading axis a design."""

    psi: Pair  # (c, w, o, q), of the poles that differ: times the response of a unit
    rate: Pair  # its derivative by the poles
    direct: Float[Array, "c w o"]  # times rho
    slope: Float[Array, "c w o"]  # times drho/dt
    tables: TableSignals  # derivatives by the tables


def table_sums(
    t: TableLanes, layout: Layout, time: Float[Array, " t"], weights: Float[Array, "c o t"]
) -> TableSums:
    """The sums of a figure with such derivatives by the outputs at times (s) since the start."""

    def one(design: tuple[TableLanes, Array]) -> TableSums:
        return TableSums(*_of_design(*design, layout, time))

    return jax.lax.map(one, (t, weights))


def table_slopes(g: Lanes, layout: Layout, sums: TableSums) -> Slopes:
    """Derivatives through the tables alone, from the sums of a group, batch last.

    The layout has no other signals.
    """
    m = g.modes
    own, given = seen(m.kind, (m.c0[: layout.rows], m.c1[: layout.rows])), m.given(layout.tables)

    def shown_by(psi: Pair) -> Pair:  # (w + 1, p, c)
        first, second = product(m.kind, own, _of_pairs(psi, layout))
        first, second = (jnp.pad(summed(x, 1), ((0, 1), (0, 0), (0, 0))) for x in (first, second))
        return first, second

    def given_to(psi: Pair) -> Pair:  # (o, p, c)
        b = given[0][:, None], given[1][:, None]
        first, second = product(m.kind, b, _of_pairs(psi, layout))
        return summed(first), summed(second)

    return Slopes(
        shown_by(sums.psi),
        shown_by(sums.rate),
        given_to(sums.psi),
        given_to(sums.rate),
        jax.tree.map(jnp.zeros_like, g.signals)._replace(tables=sums.tables),
        sums.direct,
        sums.slope,
    )


def _of_design(own: TableLanes, weights: Float[Array, "o t"], layout: Layout, time):
    """Of one design: Psi and its derivative by the poles (w, o, q), the derivatives by what shows
    rho straight (w, o), and those by the tables.
    """
    kind, l0, l1 = own.poles
    decay = decay_at(own.poles, time)
    along = jnp.ones_like(l0), jnp.where(kind > 0, 0.0, jnp.ones_like(l1))

    def one(table):
        signal, given, direct, slope = table

        def response(l0, l1):
            poles = PolesAlone(kind, l0, l1)
            z = knots_of(poles, signal.duration, signal.rho, time[-1])
            return response_at(poles, z, time, decay_at(poles, time))

        here, moved = jax.jvp(response, (l0, l1), along)
        psi, rate = ((weights @ x.z[0].T, weights @ x.z[1].T) for x in (here, moved))
        w = merged(onward(own.pair, own.shown, given), layout)

        def figure(signal: TableSignals):
            z = knots_of(own.poles, signal.duration, signal.rho, time[-1], fixed=True)
            response = response_at(own.poles, z, time, decay, fixed=True)
            return jnp.sum(weights * shown(w, direct, slope, response))

        straight = weights @ here.rho[0], weights @ here.rho[1]
        return psi, rate, *straight, jax.grad(figure)(signal)

    return jax.lax.map(one, (own.tables, own.given, own.direct, own.slope))


def _of_pairs(psi: Pair, layout: Layout) -> Pair:
    """Of every pair, of those with poles that differ."""
    index = np.array(layout.pole)
    return psi[0][..., index, :], psi[1][..., index, :]
