"""The largest and the smallest values of single outputs of the long run.

Phases run independently of each other, so the largest value of an output is the sum of those of
what each phase moves of it.  All of them, of all outputs asked for, stand beside each other.
"""

from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..lanes import Lanes
from ..system import Layout
from .climb import chosen, risen
from .curves import ModalCurves, curves_of, rows_shown, shown_rows
from .phases import Spot, constant, phases_of
from .spots import repeated
from .supremum import two_tops_of_each

ROUNDS = 6  # of Newton's method


class Ends(NamedTuple):
    """What outputs (r) are times each sign (n), at most, and where."""

    height: Float[Array, "n r c"]
    spots: list[Spot]  # (n, r, s, c), of phases of like kinds


def ends_of(g: Lanes, layout: Layout, rows: Sequence[int], signs: Sequence[float]) -> Ends:
    """The largest values of the outputs `rows` times each of the signs."""
    sign = jnp.asarray(signs)[:, None, None]
    lanes = g.modes.l0.shape[-1]
    height = sign * constant(g.modes, layout, np.array(rows), g.direct)
    spots = []
    for phases in phases_of(layout):
        count = phases.count
        moved = [rows_shown(layout, phases, [row]) for row in rows]
        pairs = [(r, s) for r, own in enumerate(moved) for s in range(count) if own[s]]
        none = jnp.zeros((len(signs), len(rows), count, lanes))
        if not pairs:
            spots.append(Spot(none, none, none))
            continue
        line, phase = np.array(pairs).T
        shown = shown_rows(layout, [[rows[r]] for r in line])
        f = curves_of(g, layout, repeated(phases, phase), shown)
        spot, top = _highest(f, sign)
        spots.append(Spot(*(none.at[:, line, phase].set(x) for x in spot)))
        height = height.at[:, line].add(top)
    return Ends(height, spots)


def _highest(f: ModalCurves, sign: Float[Array, "n 1 1"]) -> tuple[Spot, Float[Array, "n s c"]]:
    """Where each phase's one output, times each sign, is largest, and how large."""
    lanes = f.cycle.period.shape[-1]
    tops = two_tops_of_each(f, jnp.broadcast_to(sign, (len(sign), 1, lanes)))
    each = [risen(f, sign, top.spots(f), top.step, ROUNDS) for top in tops]
    (first, high), (second, low) = each
    return chosen(high >= low, first, second), jnp.maximum(high, low)


def with_grip(g: Lanes, layout: Layout) -> tuple[Lanes, Layout, list[int]]:
    """The design with mu N - f and mu N + f of every wheel as further outputs, and their rows."""
    m, mu = g.modes, g.friction
    normal, drive = layout.place("normal_force"), layout.place("drive_force")

    def more(x, mu):
        """Outputs (o, ...) and what they give of the grip."""
        both = mu * x[normal] - x[drive], mu * x[normal] + x[drive]
        return jnp.concatenate([x, *both])

    modes = m._replace(c0=more(m.c0, mu[:, None]), c1=more(m.c1, mu[:, None]))
    straight = (jax.vmap(lambda x: more(x, mu))(x) for x in (g.direct, g.slope))
    direct, slope = straight

    def also(shown: tuple[tuple[int, ...], ...]):
        pairs = zip(normal.tolist(), drive.tolist(), strict=True)
        each = tuple(tuple(sorted({*shown[i], *shown[j]})) for i, j in pairs)
        return shown + each + each

    first, n = len(m.c0), layout.wheels
    layout = layout._replace(
        live=also(layout.live), waves=also(layout.waves), tabled=also(layout.tabled)
    )
    rows = [*range(first, first + 2 * n)]
    return g._replace(modes=modes, direct=direct, slope=slope), layout, rows
