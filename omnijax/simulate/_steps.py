"""Step sizes that end at gap edges: the wheel's shape has kinks there, at angles known ahead."""

from typing import Any

import diffrax as dfx
import jax
import jax.numpy as jnp

from ..laws import Gap


def time_to_edge(gap: Gap, angle, speed):
    """Time in s until a wheel turning at `speed` (rad/s) reaches its next kink; inf at rest.

    Kinks lie at both edges of a gap and at its middle.  A wheel that stands on a kink goes on to
    the next one.
    """
    forward = jnp.where(speed >= 0, 1.0, -1.0)
    into = jnp.mod(forward * angle, gap.pitch)
    start = jnp.where(speed >= 0, 0.0, gap.pitch - gap.width)
    kinks = jnp.mod(start + jnp.array([0.0, 0.5, 1.0]) * gap.width, gap.pitch)
    ahead = jnp.mod(kinks - into, gap.pitch)
    near = 1e-9 * gap.pitch
    ahead = jnp.where(ahead < near, gap.pitch, ahead)
    moving = (speed != 0) & (gap.width > 0)
    return jnp.where(moving, jnp.min(ahead) / jnp.where(speed == 0, 1.0, jnp.abs(speed)), jnp.inf)


class EdgeSteps(dfx.AbstractAdaptiveStepSizeController):
    """Wraps a controller: no step goes over the next predicted gap edge.

    `edge_time(t, y, args)` gives the time in s to the next edge, predicted at constant speed, so a
    step ends on the edge up to the square of the step; what is left the error control handles.
    """

    controller: dfx.AbstractAdaptiveStepSizeController
    edge_time: Any

    @property
    def rtol(self):
        return self.controller.rtol

    @property
    def atol(self):
        return self.controller.atol

    @property
    def norm(self):
        return self.controller.norm

    def wrap(self, direction):
        return EdgeSteps(self.controller.wrap(direction), self.edge_time)

    def init(self, terms, t0, t1, y0, dt0, args, func, error_order):
        first, state = self.controller.init(terms, t0, t1, y0, dt0, args, func, error_order)
        return jnp.minimum(first, t0 + self._limit(t0, y0, args)), state

    def adapt_step_size(self, t0, t1, y0, y1_candidate, args, y_error, error_order, state):
        keep, next_t0, next_t1, jump, state, result = self.controller.adapt_step_size(
            t0, t1, y0, y1_candidate, args, y_error, error_order, state
        )
        y = jax.tree.map(lambda a, b: jnp.where(keep, b, a), y0, y1_candidate)
        limit = next_t0 + self._limit(next_t0, y, args)
        return keep, next_t0, jnp.minimum(next_t1, limit), jump, state, result

    def _limit(self, t, y, args):
        return jax.lax.stop_gradient(self.edge_time(t, y, args))
