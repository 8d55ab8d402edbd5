"""Augmented Lagrangian around BFGS, many starts at once; quadratic programs take it from there.

Searches without limits begin with it, and those that quadratic programs alone leave outside of
their limits go back to it: a penalty leads across where the limits' slopes lead nowhere.

    L = F + 1/(2 mu) sum (max(0, lambda + mu c)^2 - lambda^2),    c = (g - limit)/scale

The worst case over k is the epigraph form: F = t with c_k = f_k/size - t, exact and smooth at the
optimum, and its multipliers are the weights of the worst cases.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import optax
import optimistix as optx
from jaxtyping import Array, Float

from ...._compiling import quick_jit
from ..._batches import Order, each
from ..._problem import Problem, from_angle, to_angle
from ..._range import Ranges

ROUNDS, INNER = 5, 15
PENALTY, GROWTH = 30.0, 5.0
NEAR = 1e-4  # of a limit's scale: what is left to quadratic programs


def _searches(problem: Problem) -> Order:
    """How many searches go: their loops end at different times, which a batch has first for."""
    return "in turn" if problem.order == "in turn" else "side by side"


class Starts(NamedTuple):
    """Searches side by side: where they start, which variables they may move, their limits."""

    share: Float[Array, "l d"]
    free: Float[Array, "l d"]  # 1 or 0
    limit: Float[Array, "l c"]


Values = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]  # shares to f (l, k), g (l, c)


class SearchRun(NamedTuple):
    """Where the searches ended."""

    share: np.ndarray  # (l, d)
    evaluations: np.ndarray  # (l,) of the objective with its gradient


class SearchSizes(NamedTuple):
    """What the objective and the limits are measured in; data, so that one program serves all."""

    objective: Float[Array, ""]
    limits: Float[Array, " c"]


class Adam(NamedTuple):
    """A stochastic search: number of steps, first step as a share of the range, and seed."""

    steps: int
    rate: float = 0.05
    seed: int = 0


class DesignSearch:
    """The compiled pieces of one problem."""

    def __init__(self, problem: Problem, size: float):
        self.problem, self.size = problem, size
        self.scale = Ranges.of(problem.variables)
        unit = jnp.array([limit.scale for limit in problem.limits], float)
        self.sizes = SearchSizes(jnp.asarray(size, float), unit)
        self._inner = quick_jit(self._minimise_each)

    def parts(self, share, extra) -> tuple[Array, Array]:
        """f and g at a share of the ranges."""
        return self.problem.figures(self.scale.value(share), extra)

    def _split(self, y, lane: Starts, sizes: SearchSizes, extra):
        """F and the scaled constraints c of one lane at y = (z, t)."""
        moved = jnp.where(lane.free > 0, from_angle(y[0]), lane.share)
        f, g = self.parts(moved, extra)
        c = (g - lane.limit) / sizes.limits
        if self.problem.epigraph:
            return y[1], jnp.concatenate([f / sizes.objective - y[1], c])
        return jnp.mean(f) / sizes.objective, c

    def _lagrangian(self, y, args):
        lane, multiplier, penalty, sizes, extra = args
        F, c = self._split(y, lane, sizes, extra)
        pushed = jnp.maximum(0.0, multiplier + penalty * c)
        return F + jnp.sum(pushed**2 - multiplier**2) / (2 * penalty)

    def _minimise_each(self, y, lanes, multiplier, penalty, sizes, extra):
        def one(y, lane, multiplier, penalty):
            return self._minimise(y, lane, multiplier, penalty, sizes, extra)

        return each(one, [y, lanes, multiplier, penalty], _searches(self.problem))

    def _minimise(self, y, lane, multiplier, penalty, sizes, extra):
        """The next y and the number of steps."""
        solver = optx.BFGS(rtol=1e-7, atol=1e-7)
        args = (lane, multiplier, penalty, sizes, extra)
        solution = optx.minimise(
            self._lagrangian,
            solver,
            y,
            args,
            options={"autodiff_mode": "fwd"},
            max_steps=INNER,
            throw=False,
        )
        return solution.value, solution.stats["num_steps"]

    def begin(self, lanes: Starts, values: Values):
        """(y, multipliers) at the start."""
        first = values(np.asarray(lanes.share))[0]
        z = to_angle(jnp.clip(lanes.share, 1e-3, 1 - 1e-3))
        lead = first.max(axis=1) if self.problem.epigraph else np.zeros(len(z))
        t = jnp.asarray(lead / self.size)
        weights = jnp.broadcast_to(self._weights(), (len(z), len(self._weights())))
        return (z, t), jnp.concatenate([weights, jnp.zeros_like(lanes.limit)], axis=1)

    def _weights(self) -> Array:
        """Multipliers of the cases to begin with."""
        count = len(self.problem.cases) if self.problem.epigraph else 0
        return jnp.full(count, 1.0 / max(count, 1))

    def run(self, lanes: Starts, values: Values) -> SearchRun:
        """All lanes to the neighbourhood of their ends."""
        y, multiplier = self.begin(lanes, values)
        count = len(lanes.share)
        penalty, previous = jnp.full(count, PENALTY), np.full(count, np.inf)
        evaluations, share = np.zeros(count, int), np.asarray(lanes.share)
        for _ in range(ROUNDS):
            y, steps = self._inner(y, lanes, multiplier, penalty, self.sizes, self.problem.extra)
            evaluations = evaluations + np.asarray(steps)
            share = np.asarray(jnp.where(lanes.free > 0, from_angle(y[0]), lanes.share))
            if multiplier.shape[1] == 0:
                break
            f, g = values(share)
            lead = f / self.size - np.asarray(y[1])[:, None] if self.problem.epigraph else f[:, :0]
            c = np.concatenate([lead, (g - lanes.limit) / self.sizes.limits], axis=1)
            slack = jnp.maximum(c, -multiplier / penalty[:, None])
            gap = np.asarray(jnp.max(jnp.abs(slack), axis=1))
            multiplier = jnp.maximum(0.0, multiplier + penalty[:, None] * c)
            if np.all(np.nan_to_num(gap, nan=0.0) <= NEAR):
                break
            slow = gap > 0.25 * previous
            penalty = jnp.where(slow, jnp.minimum(penalty * GROWTH, 1e6), penalty)
            previous = gap
        return SearchRun(share, evaluations)

    def stochastic(self, lanes: Starts, values: Values, drawn: Adam) -> Starts:
        """Lanes moved by optax's Adam on draws that are new at every step."""
        draw = self.problem.draw
        assert draw is not None
        method = optax.adam(optax.cosine_decay_schedule(drawn.rate, drawn.steps))
        (z, t), multiplier = self.begin(lanes, values)

        def one(y, lane, multiplier):
            def step(carry, key):
                y, state = carry
                args = (lane, multiplier, jnp.asarray(PENALTY), self.sizes, draw(key))
                change, state = method.update(jax.jacfwd(self._lagrangian)(y, args), state)
                return (optax.apply_updates(y, change), state), None

            keys = jax.random.split(jax.random.key(drawn.seed), drawn.steps)
            end: Any = jax.lax.scan(step, (y, method.init(y)), keys)[0]
            return end[0][0]

        moved = jax.jit(lambda *rows: each(one, rows, _searches(self.problem)))
        z = moved((z, t), lanes, multiplier)
        return lanes._replace(share=jnp.where(lanes.free > 0, from_angle(z), lanes.share))
