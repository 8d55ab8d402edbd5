"""What the wheels show while a step of a torque-driven run lasts: their shapes, known ahead.

The path of the angles over the step follows from theta' = R axes . Omega/r(theta) with Omega going
on as it turns, and with it the shapes rho.  Their kinks at gap edges fall inside steps: rolling
radius, shape and the shape's rate come to a Runge-Kutta method's stages as the one parabola that
has their moments over the step (`Passage`), so that a kink costs no order.
"""

import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from ...dynamics import (
    State,
    StepAverage,
    attitude_rate,
    radius_under,
    spin_axes,
    surface_shape,
    wheel_shape,
)
from ...rig import Rig


class Nodes(NamedTuple):
    """Where a step samples what is periodic in the angle, and what it makes of the samples."""

    share: np.ndarray  # (k,) of the step
    fit: np.ndarray  # (c, k): coefficients of 1, u, u^2 on each part with the samples' moments
    along: np.ndarray  # (k, c): integral from the step's start to each node
    stages: np.ndarray  # (3, c): at 0, 1/2, 1 the parabola with those moments over the whole step
    change: np.ndarray  # (3, c), and `ends` (3, 2): the same for the derivative
    ends: np.ndarray


def nodes_of(pieces: int, panels: int) -> Nodes:
    """Nodes on `pieces` parts of a step, each with `panels` parabolas for its moments."""
    size, powers = 2 * panels, np.arange(3)
    u = np.linspace(0, 1, size + 1)
    simpson = np.full(size + 1, 2.0)
    simpson[1::2], simpson[[0, -1]] = 4.0, 1.0
    weighted = u ** powers[:, None] * simpson
    inside = np.linalg.solve(weighted @ u[:, None] ** powers, weighted)
    share = np.linspace(0, 1, pieces * size + 1)
    fit, along = np.zeros((3 * pieces, share.size)), np.zeros((share.size, 3 * pieces))
    moments = np.zeros((3, 3 * pieces))  # of 1, s, s^2 over the step
    for i in range(pieces):
        own, here = slice(3 * i, 3 * i + 3), slice(i * size, (i + 1) * size + 1)
        fit[own, here] = inside
        along[here, own] = u[:, None] ** (powers + 1) / (powers + 1) / pieces
        along[(i + 1) * size :, own] = 1 / (powers + 1) / pieces
        for k in powers:  # s = (i + u)/pieces
            terms = [math.comb(k, j) * i ** (k - j) / (1 + j + powers) for j in range(k + 1)]
            moments[k, own] = sum(terms) / pieces ** (k + 1)
    back = np.array([[0], [0.5], [1]]) ** powers @ np.linalg.inv(1 / (1 + powers[:, None] + powers))
    change = -back @ (powers[:, None] * np.roll(moments, 1, axis=0))
    ends = back @ np.array([[-1, 1], [0, 1], [0, 1]])
    return Nodes(share, fit, along, back @ moments, change, ends)


def _shapes(rig: Rig, angle: Float[Array, "n k"]) -> Float[Array, "n k"]:
    return jax.vmap(lambda a: wheel_shape(rig, a), -1, -1)(angle)


def _radii(rig: Rig, shape: Float[Array, "n k"], rim: Float[Array, "n k"]) -> Float[Array, "n k"]:
    """Rolling radii in m at the nodes, where the sphere moves the rims at `rim` (m/s)."""
    rim = jnp.broadcast_to(rim, shape.shape)
    return jax.vmap(lambda s, r: radius_under(rig, s, r), -1, -1)(shape, rim)


def _rims(rig: Rig, state: State, turning):
    """Speeds (n, 1) in m/s at which the sphere moves the rims, and their rates in m/s^2."""
    arms = rig.sphere.radius * spin_axes(rig, state.angle)
    return (arms @ state.angular_velocity)[:, None], (arms @ turning)[:, None]


class StepGrid(NamedTuple):
    """Nodes of a step, and the fewer ones on which its path is integrated."""

    fine: Nodes
    coarse: Nodes

    @classmethod
    def of(cls, pieces: int, panels: int) -> "StepGrid":
        """The grid with `pieces` parts of a step."""
        return cls(nodes_of(pieces, panels), nodes_of(pieces, (panels + 1) // 2))


def shapes_ahead(grid: StepGrid, rig: Rig, state: State, turning, h) -> Float[Array, "n k"]:
    """Wheel shapes rho in m at the nodes of the step ahead, Omega going on as it turns.

    theta' = R axes . Omega/r(theta) is integrated twice: with the first radius, then with the radii
    along the path that this gave.
    """
    s, angle = h * grid.coarse.share, state.angle[:, None]
    rim, gain = _rims(rig, state, turning)
    radius = _radii(rig, wheel_shape(rig, state.angle)[:, None], rim)
    path = angle + s * (rim + gain * s / 2) / radius
    speed = (rim + gain * s) / _radii(rig, _shapes(rig, path), rim + gain * s)
    return _shapes(rig, angle + h * speed @ (grid.coarse.fit.T @ grid.fine.along.T))


def _surface_ahead(grid: StepGrid, rig: Rig, state: State, turning, h) -> Float[Array, "n k"]:
    """What a sphere out of round adds to the shapes at those nodes, m."""

    def at(s):
        rate = attitude_rate(state.attitude, state.angular_velocity + s * turning / 2)
        return surface_shape(rig, state.attitude + s * rate)

    return jax.vmap(at, out_axes=-1)(h * grid.fine.share)


class Passage(NamedTuple):
    """One step's shapes: coefficients of their parabolas, and what each stage sees of them."""

    fit: Float[Array, "c n"]  # m, of rho with the sphere's surface, on each part of the step
    radius: Float[Array, "3 n"]  # m, at the step's start, middle and end, as those below
    change: Float[Array, "3 n"]  # m/s
    shape: Float[Array, "3 n"]  # m

    @classmethod
    def over(cls, grid: StepGrid, rig: Rig, state: State, turning, ahead, h) -> "Passage":
        """That of a step of `h` s from `state`, Omega changing at `turning`, shapes `ahead`."""
        nodes = grid.fine
        rho = ahead + _surface_ahead(grid, rig, state, turning, h)
        rim, gain = _rims(rig, state, turning)
        rim = rim + h * nodes.share * gain
        stages = jnp.asarray(nodes.stages)
        radius = stages @ (nodes.fit @ _radii(rig, ahead, rim).T)
        ends, fit = jnp.stack([rho[:, 0], rho[:, -1]]), nodes.fit @ rho.T
        return cls(fit, radius, (nodes.change @ fit + nodes.ends @ ends) / h, stages @ fit)

    def at(self, i: int | Int[Array, ""]) -> StepAverage:
        """What the stage at the step's start (0), middle (1) or end (2) sees."""
        return StepAverage(self.radius[i], self.change[i], self.shape[i])

    def without_shape(self, i: int | Int[Array, ""]) -> StepAverage:
        """The same where the state has followed the shape itself, kinks and all."""
        return StepAverage(self.radius[i], self.change[i])
