"""Step sizes that end at gap edges: the wheel's shape has kinks there, at angles known ahead."""

from collections.abc import Callable
from typing import Any, NamedTuple

import diffrax as dfx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from ..._root import root
from ...laws import Gap


def angle_to_edge(gap: Gap, angle, speed):
    """Angle in rad that a wheel turning at `speed` (rad/s) has to go to be just past its next kink.

    Kinks lie at both edges of a gap and at its middle.
    """
    forward = jnp.where(speed >= 0, 1.0, -1.0)
    into = jnp.mod(forward * angle, gap.pitch)
    start = jnp.where(speed >= 0, 0.0, gap.pitch - gap.width)
    kinks = jnp.mod(start + jnp.array([0.0, 0.5, 1.0]) * gap.width, gap.pitch)
    ahead = jnp.mod(kinks - into, gap.pitch)
    near = 1e-10 * gap.pitch
    ahead = jnp.min(jnp.where(ahead < near, gap.pitch, ahead)) + 2 * near
    return jnp.where(gap.width > 0, ahead, jnp.inf)


def time_to_edge(ahead, speed, acceleration):
    """Time in s to turn by `ahead` (rad) at `speed` (rad/s), first root of the parabola; or inf."""
    ahead = jnp.minimum(ahead, 1e6)
    forward = jnp.where(speed >= 0, 1.0, -1.0)
    speed, change = forward * speed, forward * jax.lax.stop_gradient(acceleration)
    square = speed**2 + 2 * change * ahead
    there = jnp.sqrt(jnp.where(square > 0, square, 1.0))  # speed at the edge
    arrives = (square > 0) & (speed + there > 1e-9)
    return jnp.where(arrives, 2 * ahead / jnp.where(arrives, speed + there, 1.0), jnp.inf)


class StepMemory(NamedTuple):
    """What the controller remembers from step to step."""

    wanted: Float[Array, ""]  # s, the step that the error would allow
    quality: Float[Array, ""]  # 1/error of the last good step
    on_stop: Bool[Array, ""]  # whether the step under way ends at a stop


class EdgeSteps(dfx.AbstractAdaptiveStepSizeController):
    """Proportional-integral error control whose steps end on stops and on predicted gap edges.

    `edges(t, y, args)` gives each wheel's angle to its next edge and its speed.  The edge's time is
    predicted with the acceleration of the last step; what is left the error control handles.  The
    end of such a step moves with the rig's parameters, and is differentiated: forces that jump at
    an edge would else lose their part of the gradient.
    `stops` are times to hit exactly.  A step cut short does not lower the step wanted next.
    With a `coarsest` step only coarsest/2^k and sizes up to `finest` are taken, as
    `LinearPart` wants it.
    """

    rtol: Any
    atol: Any
    norm: Callable[[Any], Any]
    edges: Callable[..., Any]
    stops: Float[Array, " k"]
    first: Any = 1e-4  # s
    coarsest: Any = None  # s
    finest: Any = None  # s

    def wrap(self, direction):
        return self

    def init(self, terms, t0, t1, y0, dt0, args, func, error_order):
        wanted = jnp.asarray(self.first, float)
        end, on_stop = self._end(t0, wanted, self.edges(t0, y0, args), 0.0)
        return end, StepMemory(wanted, jnp.ones(()), on_stop)

    def adapt_step_size(self, t0, t1, y0, y1_candidate, args, y_error, error_order, state):
        step = t1 - t0
        size = jnp.maximum(jnp.abs(y0), jnp.abs(y1_candidate))
        error = self.norm(y_error / (self.atol + self.rtol * size))
        error = jax.lax.stop_gradient(jnp.where(jnp.isfinite(error), error, jnp.inf))
        keep = error < 1
        quality = 1 / jnp.maximum(error, 1e-12)
        factor = 0.9 * quality ** (0.7 / error_order) * state.quality ** (-0.3 / error_order)
        factor = jnp.clip(factor, 0.2, jnp.where(keep, 8.0, 0.8))
        new = step * factor
        cut_short = keep & (step < 0.49 * state.wanted)
        wanted = jnp.where(cut_short, jnp.maximum(new, state.wanted), new)
        wanted = jax.lax.stop_gradient(wanted)
        next_t0 = jnp.where(keep, t1, t0)
        before, after = self.edges(t0, y0, args), self.edges(t1, y1_candidate, args)
        ahead = jax.tree.map(lambda a, b: jnp.where(keep, a, b), after, before)
        change = (after[1] - before[1]) / step
        change = jnp.where(keep, change, 0.0)
        next_t1, on_stop = self._end(next_t0, wanted, ahead, change)
        memory = StepMemory(wanted, jnp.where(keep, quality, state.quality), on_stop)
        result = dfx.RESULTS.where(
            next_t1 > next_t0, dfx.RESULTS.successful, dfx.RESULTS.dt_min_reached
        )
        return keep, next_t0, next_t1, keep & state.on_stop, memory, result

    def _end(self, t, wanted, wheels, acceleration):
        """Where the next step from `t` ends, and whether that is at a stop."""
        rounding = 1e-14 * jnp.maximum(1.0, jnp.abs(t))
        index = jnp.searchsorted(self.stops, t + 10 * rounding, side="right")
        last = self.stops.size - 1
        stop = jnp.where(index > last, jnp.inf, self.stops[jnp.minimum(index, last)])
        edge = jnp.min(time_to_edge(wheels[0], wheels[1], acceleration))
        step = jnp.minimum(wanted, jnp.minimum(stop - t, edge))
        if self.coarsest is not None and self.finest is not None:
            exponent = jnp.floor(jnp.log2(step / self.coarsest) + 1e-9)
            level = self.coarsest * 2.0 ** jnp.minimum(exponent, 0.0)
            step = jnp.where(step <= self.finest, step, jnp.maximum(level, self.finest))
        on_stop = jnp.abs(t + step - stop) <= 1e-10 * step + rounding
        return jnp.where(on_stop, stop, t + step), on_stop


def root_mean_square(x):
    """Norm of an error over its tolerances."""
    return root(jnp.mean(x**2))
