"""What outputs show of the tables that wheels pass."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..arithmetic import Pair, onward, rows
from ..lanes import Lanes
from ..system import Layout
from ..table_signals import TableSignals
from .response import Knots, PolesAlone, TableResponse, decay_at, knots_of, response_at


class TableLanes(NamedTuple):
    """What tables need to know of a group of designs, batch first."""

    poles: PolesAlone  # those that differ (q, see `Layout.poles`)
    pair: Float[Array, "c p"]  # the kind of every pair
    shown: Pair  # (c, o, p)
    given: Pair  # (c, w, p)
    direct: Float[Array, "c w o"]
    slope: Float[Array, "c w o"]
    tables: TableSignals


def table_lanes(g: Lanes, layout: Layout) -> TableLanes:
    """The first `layout.rows` outputs of a group."""
    m, tables = g.modes, g.signals.tables
    assert tables is not None

    def first(x):
        return jnp.moveaxis(x, -1, 0)

    few, columns = layout.rows, list(layout.tables)
    alone = (first(rows(x, layout.poles))[:, :, None] for x in (m.kind, m.l0, m.l1))
    return TableLanes(
        PolesAlone(*alone),
        first(m.kind),
        (first(m.c0[:few]), first(m.c1[:few])),
        (first(rows(m.b0, columns)), first(rows(m.b1, columns))),
        first(rows(g.direct, columns)[:, :few]),
        first(rows(g.slope, columns)[:, :few]),
        TableSignals(*(first(x) for x in tables)),
    )


def knots(t: TableLanes, until) -> Knots:
    """The begins of all pieces, (c, w, ...), for times up to `until` (s)."""
    of_tables = jax.vmap(knots_of, in_axes=(None, 0, 0, None))
    return jax.vmap(of_tables, in_axes=(0, 0, 0, None))(t.poles, *t.tables, until)


def table_outputs(t: TableLanes, layout: Layout, time: Float[Array, " t"]) -> Float[Array, "c o t"]:
    """What the tables add to the outputs at times (s) since the start, in order."""

    def of_design(one: tuple[TableLanes, Knots]):
        own, each = one
        decay = decay_at(own.poles, time)

        def add(total, table: tuple[Knots, Pair, Array, Array]):
            z, given, direct, slope = table
            response = response_at(own.poles, z, time, decay)
            weights = merged(onward(own.pair, own.shown, given), layout)
            return total + shown(weights, direct, slope, response), None

        none = jnp.zeros((layout.rows, len(time)))
        return jax.lax.scan(add, none, (each, own.given, own.direct, own.slope))[0]

    return jax.lax.map(of_design, (t, knots(t, time[-1])))


def merged(weights: Pair, layout: Layout) -> Pair:
    """Weights (o, q) of the poles that differ, from those (o, p) of all pairs."""
    count = len(layout.poles)
    onto = np.zeros((len(layout.pole), count))
    onto[np.arange(len(layout.pole)), list(layout.pole)] = 1.0
    return weights[0] @ onto, weights[1] @ onto


def shown(weights: Pair, direct, slope, response: TableResponse) -> Float[Array, "o t"]:
    """The outputs (o, t) of a response."""
    first, second = response.z
    straight = direct[:, None] * response.rho[0] + slope[:, None] * response.rho[1]
    return weights[0] @ first + weights[1] @ second + straight
