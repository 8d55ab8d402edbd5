"""Augmented Lagrangian around BFGS, many starts at once.

    L = F + 1/(2 mu) sum (max(0, lambda + mu c)^2 - lambda^2),    c = (g - limit)/scale

The worst case over k is the epigraph form: F = t with c_k = f_k/size - t, exact and smooth at the
optimum, and its multipliers are the weights of the worst cases.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Array, Float

from ._design_problem import Problem, Scale, from_angle, to_angle

OUTER, INNER = 14, 40
PENALTY, GROWTH = 30.0, 5.0
FEASIBLE = 3e-6  # of a limit's scale


class Lanes(NamedTuple):
    """Searches side by side: where they start, which variables they may move, their limits."""

    share: Float[Array, "l d"]
    free: Float[Array, "l d"]  # 1 or 0
    limit: Float[Array, "l c"]


class Found(NamedTuple):
    """Where the searches ended."""

    share: np.ndarray  # (l, d)
    evaluations: np.ndarray  # (l,) of the objective with its gradient
    rounds: int


class Search:
    """The compiled pieces of one problem."""

    def __init__(self, problem: Problem, size: float):
        self.problem, self.size = problem, size
        self.scale = Scale.of(problem.variables)
        self.bound = jnp.array([limit.bound for limit in problem.limits])
        self.unit = jnp.array([limit.scale for limit in problem.limits])
        self.epigraph = problem.worst and len(problem.cases) > 1
        self._inner = jax.jit(jax.vmap(self._minimise, in_axes=(0, 0, 0, 0, 0, 0, None)))
        self._residuals = jax.jit(jax.vmap(self._constraints, in_axes=(0, 0, 0, 0, None)))
        self._step = None

    def parts(self, share, extra) -> tuple[Array, Array]:
        """f and g at a share of the ranges."""
        return self.problem.figures(self.scale.value(share), extra)

    def _split(self, y, share, free, limit, extra):
        """F and the scaled constraints c at y = (z, t)."""
        moved = jnp.where(free > 0, from_angle(y[0]), share)
        f, g = self.parts(moved, extra)
        c = (g - limit) / self.unit
        if self.epigraph:
            return y[1], jnp.concatenate([f / self.size - y[1], c])
        return jnp.mean(f) / self.size, c

    def _constraints(self, y, share, free, limit, extra):
        return self._split(y, share, free, limit, extra)[1]

    def _lagrangian(self, y, args):
        share, free, limit, multiplier, penalty, extra = args
        F, c = self._split(y, share, free, limit, extra)
        pushed = jnp.maximum(0.0, multiplier + penalty * c)
        return F + jnp.sum(pushed**2 - multiplier**2) / (2 * penalty)

    def _minimise(self, y, share, free, limit, multiplier, penalty, extra):
        solver = optx.BFGS(rtol=1e-8, atol=1e-8)
        args = (share, free, limit, multiplier, penalty, extra)
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

    def begin(self, lanes: Lanes):
        """(y, multipliers) at the start."""
        z = to_angle(jnp.clip(lanes.share, 1e-3, 1 - 1e-3))
        cases = len(self.problem.cases) if self.epigraph else 0
        t = jnp.zeros(len(z))
        if self.epigraph:
            f = jax.jit(jax.vmap(lambda s: self.parts(s, self.problem.extra)[0]))(lanes.share)
            t = jnp.max(f, axis=1) / self.size
        first = jnp.full((len(z), cases), 1.0 / max(cases, 1))
        return (z, t), jnp.concatenate([first, jnp.zeros_like(lanes.limit)], axis=1)

    def run(self, lanes: Lanes, report: Callable[[int], None] | None = None) -> Found:
        """All lanes to their ends."""
        y, multiplier = self.begin(lanes)
        count = len(lanes.share)
        penalty, previous = jnp.full(count, PENALTY), np.full(count, np.inf)
        evaluations, done, rounds = np.zeros(count, int), False, 0
        while not done and rounds < OUTER:
            y, steps = self._inner(y, *lanes, multiplier, penalty, self.problem.extra)
            evaluations, rounds = evaluations + np.asarray(steps), rounds + 1
            if multiplier.shape[1] == 0:
                done = rounds > 1 and int(np.max(steps)) <= 2
            else:
                c = self._residuals(y, *lanes, self.problem.extra)
                slack = jnp.maximum(c, -multiplier / penalty[:, None])
                gap = np.asarray(jnp.max(jnp.abs(slack), axis=1))
                multiplier = jnp.maximum(0.0, multiplier + penalty[:, None] * c)
                done = bool(np.all(np.nan_to_num(gap, nan=0.0) <= FEASIBLE))
                slow = gap > 0.25 * previous
                penalty = jnp.where(slow, jnp.minimum(penalty * GROWTH, 1e6), penalty)
                previous = gap
            if report is not None:
                report(rounds)
        share = jnp.where(lanes.free > 0, from_angle(y[0]), lanes.share)
        return Found(np.asarray(share), evaluations, rounds)

    def stochastic(self, lanes: Lanes, steps: int, rate: float, seed: int) -> Lanes:
        """Lanes moved by optax's Adam on draws that are new at every step."""
        import optax

        draw = self.problem.draw
        assert draw is not None
        method = optax.adam(optax.cosine_decay_schedule(rate, steps))

        def one(y, share, free, limit):
            multiplier = self._first(limit)
            args: Any = (share, free, limit, multiplier, jnp.asarray(PENALTY))

            def step(carry, key):
                y, state = carry
                slope = jax.grad(self._lagrangian)(y, (*args, draw(key)))
                change, state = method.update(slope, state)
                return (optax.apply_updates(y, change), state), None

            keys = jax.random.split(jax.random.key(seed), steps)
            (end, _), _ = jax.lax.scan(step, (y, method.init(y)), keys)
            z: Any = end[0]  # pyright: ignore[reportIndexIssue]
            return z

        y, _ = self.begin(lanes)
        z = jax.jit(jax.vmap(one))(y, *lanes)
        return lanes._replace(share=jnp.where(lanes.free > 0, from_angle(z), lanes.share))

    def _first(self, limit):
        cases = len(self.problem.cases) if self.epigraph else 0
        return jnp.concatenate([jnp.full(cases, 1.0 / max(cases, 1)), jnp.zeros_like(limit)])
