"""Derivatives of phases' periodic responses by their poles and by the signals.

Those of phases with signals of few pieces come in one pass backwards.  Of tables, which have many
pieces, the derivative by each pole is carried along forwards, and the way back leads to the signals
alone.
"""

from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..arithmetic import Pair
from ..signals import Signals
from .phases import Phases

Slope = Pair  # of every response by its own pole, (p, s, c)
PulledBack = Callable[[Float[Array, "p c"], list], tuple[list[Slope], Signals]]


def with_pull_back(
    each: Sequence[Callable[[Pair, Signals], Any]],
    groups: Sequence[Phases],
    poles: list[Pair],
    signals: Signals,
    unit: Callable[[Any], Any],
    response: Callable[[Any], Pair],
) -> tuple[list[Any], PulledBack]:
    """What `each` of the groups of phases makes of poles and signals, and the way back.

    `response` takes the responses (p, s, c) from one of these; `unit` of one are its derivatives of
    the sum of all its responses, each of which depends on its own pole alone.  The way back gives
    the derivatives of all responses and, of sums (m) whose derivatives by what `each` makes are
    given with that leading axis, those by the signals.
    """
    tabled = [i for i, phases in enumerate(groups) if phases.tables]
    others = [i for i, phases in enumerate(groups) if not phases.tables]
    made: list[Any] = [None] * len(groups)

    def together(poles: list[Pair], signals: Signals) -> list[Any]:
        return [each[i](pole, signals) for i, pole in zip(others, poles, strict=True)]

    back = None
    if others:
        every, back = jax.vjp(together, [poles[i] for i in others], signals)
        for i, x in zip(others, every, strict=True):
            made[i] = x
    ways = {}
    for i in tabled:
        made[i], ways[i] = jax.vjp(lambda signals, i=i: each[i](poles[i], signals), signals)

    def pull(kind: Float[Array, "p c"], bars: list) -> tuple[list[Slope], Signals]:
        slopes: list[Slope] = [poles[0]] * len(groups)
        total: Signals | None = None
        if back is not None:
            units = [unit(made[i]) for i in others]
            every = jax.tree.map(
                lambda x, y: jnp.concatenate([x, y[None]]), [bars[i] for i in others], units
            )
            by_poles, total = jax.vmap(back)(every)
            for i, (x, y) in zip(others, by_poles, strict=True):
                slopes[i] = x[-1], jnp.where(kind[:, None] > 0, -y[-1], y[-1])
            total = jax.tree.map(lambda x: x[:-1], total)
        for i, way in ways.items():
            first, second = poles[i]
            along = jnp.ones_like(first), jnp.where(kind[:, None] > 0, 0.0, jnp.ones_like(second))
            own = jax.jvp(lambda pole, i=i: response(each[i](pole, signals)), (poles[i],), (along,))
            slopes[i] = own[1]
            (by_signals,) = jax.vmap(way)(bars[i])
            total = by_signals if total is None else jax.tree.map(jnp.add, total, by_signals)
        assert total is not None
        return slopes, total

    return made, pull
