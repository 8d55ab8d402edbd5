"""`simulate_many`: torque-driven runs of many rigs at one fixed step, for sweeps.

One step h of dy/dt = A y + N(t, y) is Krogstad's exponential Runge-Kutta method (order 4), with the
wheel's shape taken out of N, since its kinks at gap edges fall inside steps.  The path of the
angles over the step is known ahead from theta' = R axes . Omega/r(theta), and with it rho:

- the elastic response to it, int_0^h exp((h - s) A) B rho(theta(s)) ds, is exact for parabolas on
  `PIECES` parts of the step that have rho's moments;
- the rolling radius r and the shape's rate come to the stages as the one parabola that has their
  moments over the step (`Passage`), so that a kink costs no order in Omega and theta.
"""

import math
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float, Int

from ...dynamics import (
    Model,
    State,
    StepAverage,
    attitude_rate,
    linear_system,
    position_input,
    radius_under,
    spin_axes,
    surface_shape,
    torque_driven,
    wheel_shape,
)
from ...rig import Rig
from .._channels import trajectory
from .._commands import torque_inputs
from .._drives import TorqueDrive
from .._trajectory import Trajectory
from .phi import phi_functions
from .state_vector import (
    build_model,
    initial_state,
    initial_state_like,
    pack,
    state_scale,
    unpack,
    vector_field,
)

HALVINGS = 2
PIECES = 2**HALVINGS  # parts of a step, each with a parabola for the shape
PANELS = 6  # parabolas of the rule that takes moments over a part


class Nodes(NamedTuple):
    """Where a step samples what is periodic in the angle, and what it makes of the samples."""

    share: np.ndarray  # (k,) of the step
    fit: np.ndarray  # (c, k): coefficients of 1, u, u^2 on each part with the samples' moments
    along: np.ndarray  # (k, c): integral from the step's start to each node
    stages: np.ndarray  # (3, c): at 0, 1/2, 1 the parabola with those moments over the whole step
    change: np.ndarray  # (3, c), and `ends` (3, 2): the same for the derivative
    ends: np.ndarray


def _nodes(pieces: int, panels: int) -> Nodes:
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


NODES, COARSE = _nodes(PIECES, PANELS), _nodes(PIECES, PANELS // 2)


class StepTables(NamedTuple):
    """Matrices of one rig for one step size; elastic part in natural units."""

    A: Float[Array, "m m"]
    half: Float[Array, "3 m m"]  # phi_1 ... phi_3 of half a step
    whole: Float[Array, "3 m m"]  # phi_1 ... phi_3 of a step
    into: Float[Array, "m n"]  # from the shape
    midway: Float[Array, "m k n"]  # elastic state after half a step, to the shape at its nodes
    response: Float[Array, "m k n"]  # the same after a step


def _tables(model: Model, scale, step) -> StepTables:
    system = linear_system(model.translation)
    m = system.A.shape[0]
    A = system.A * scale[:m] / scale[:m, None]
    into = system.into("shape") / scale[:m, None]
    width = step / PIECES
    whole, half, *_, part = phi_functions(A, step, HALVINGS)
    parabola = width * part * np.array([1, 1, 2])[:, None, None] @ into  # to 1, u, u^2
    after = jnp.eye(m) + width * A @ part[0]
    pieces = [parabola]
    for _ in range(PIECES - 1):
        pieces.insert(0, jnp.einsum("ab,kbn->kan", after, pieces[0]))
    response, midway = jnp.concatenate(pieces), jnp.concatenate(pieces[PIECES // 2 :])
    return StepTables(
        A, half, whole, into, jnp.swapaxes(midway, 0, 1), jnp.swapaxes(response, 0, 1)
    )


def _shapes(rig: Rig, angle: Float[Array, "n k"]) -> Float[Array, "n k"]:
    return jax.vmap(lambda a: wheel_shape(rig, a), -1, -1)(angle)


def _radii(rig: Rig, shape: Float[Array, "n k"], rim: Float[Array, "n k"]) -> Float[Array, "n k"]:
    """Rolling radii in m at the nodes, where the sphere moves the rims at `rim` (m/s)."""
    rim = jnp.broadcast_to(rim, shape.shape)
    return jax.vmap(lambda s, r: radius_under(rig, s, r), -1, -1)(shape, rim)


def _ahead(rig: Rig, state: State, turning, h) -> Float[Array, "n k"]:
    """Wheel shapes rho in m at the nodes of the step ahead, Omega going on as it turns.

    theta' = R axes . Omega/r(theta) is integrated twice: with the first radius, then with the radii
    along the path that this gave.
    """
    s, angle = h * COARSE.share, state.angle[:, None]
    arms = rig.sphere.radius * spin_axes(rig, state.angle)
    rim, gain = (arms @ state.angular_velocity)[:, None], (arms @ turning)[:, None]
    radius = _radii(rig, wheel_shape(rig, state.angle)[:, None], rim)
    path = angle + s * (rim + gain * s / 2) / radius
    speed = (rim + gain * s) / _radii(rig, _shapes(rig, path), rim + gain * s)
    return _shapes(rig, angle + h * (speed @ COARSE.fit.T) @ NODES.along.T)


def _surface_ahead(rig: Rig, state: State, turning, h) -> Float[Array, "n k"]:
    """What a sphere out of round adds to the shapes at those nodes, m."""

    def at(s):
        rate = attitude_rate(state.attitude, state.angular_velocity + s * turning / 2)
        return surface_shape(rig, state.attitude + s * rate)

    return jax.vmap(at, out_axes=-1)(h * NODES.share)


def _step(model: Model, drive, start, scale, tables: StepTables, h, t, carry):
    """The states half a step and one step later, and what the next step begins with."""
    A, (half1, half2, half3), (one, two, three), into, midway, response = tables
    m = A.shape[0]
    y, turning, ahead = carry
    rig, shapes = model.rig, ravel_pytree(initial_state_like(model))[1]
    state = shapes(y * scale)
    rho = ahead + _surface_ahead(rig, state, turning, h)
    omega = state.angular_velocity[:, None] + h * NODES.share * turning[:, None]
    rim = rig.sphere.radius * spin_axes(rig, state.angle) @ omega
    radius = NODES.stages @ (NODES.fit @ _radii(rig, ahead, rim).T)
    ends, rho = jnp.stack([rho[:, 0], rho[:, -1]]), NODES.fit @ rho.T
    change = (NODES.change @ rho + NODES.ends @ ends) / h

    def split(t, y, i):  # elastic rows' remainder without the shape, and the other rows
        state = unpack(model, y, scale)
        inputs = torque_inputs(model.rig, drive, t, start)
        rate = torque_driven(
            model, state, inputs, StepAverage(jnp.asarray(radius)[i], jnp.asarray(change)[i])
        )
        rate = ravel_pytree(rate._replace(position=state.drift))[0] / scale
        shape = position_input(rig, state.angle, state.attitude)
        return rate[:m] - A @ y[:m] - into @ shape, rate[m:]

    e, z = y[:m], y[m:]
    d1, z1 = split(t, y, 0)
    first = A @ e + d1
    shaped = jnp.einsum("akn,kn->a", midway, rho[: len(rho) // 2])
    mid = e + 0.5 * h * (half1 @ first) + shaped
    d2, z2 = split(t + h / 2, jnp.concatenate([mid, z + 0.5 * h * z1]), 1)
    y3 = jnp.concatenate([mid + h * (half2 @ (d2 - d1)), z + 0.5 * h * z2])
    d3, z3 = split(t + h / 2, y3, 1)
    passed = e + jnp.einsum("akn,kn->a", response, rho)
    whole = passed + h * (one @ first + 2 * two @ (d3 - d1))
    d4, z4 = split(t + h, jnp.concatenate([whole, z + h * z3]), 2)
    end = z + h / 6 * (z1 + 2 * z2 + 2 * z3 + z4)

    linear, square = 2 * (d2 + d3) - 3 * d1 - d4, 4 * (d1 + d4 - d2 - d3)
    new = passed + h * (one @ first + two @ linear + three @ square)
    mid = e + shaped + h * (half1 @ first / 2 + half2 @ linear / 4 + half3 @ square / 8)
    halfway = (z + end) / 2 + h / 8 * (z1 - z4)
    size = rig.size
    turning = (z4 * scale[m:])[size : size + 3]
    y = jnp.concatenate([new, end])
    return jnp.concatenate([mid, halfway]), (y, turning, _ahead(rig, shapes(y * scale), turning, h))


def simulate_fixed(
    rig: Rig, drive: TorqueDrive, ts, model: str = "coupled", substeps: int | Int[Array, ""] = 1
) -> Trajectory:
    """One rig's run by fixed steps, `substeps` of them for two samples of the even `ts`."""
    built = build_model(rig, model)
    scale = ravel_pytree(state_scale(built))[0]
    pairs = len(ts) // 2  # one step passes two samples
    h = 2 * (ts[-1] - ts[0]) / ((len(ts) - 1) * substeps)
    tables = _tables(built, scale, h)
    begun = initial_state(built, drive, ts[0])
    start = pack(built, begun, scale)

    def pair(carry, t):
        def one(i, reached):
            mid, carry = _step(built, drive, ts[0], scale, tables, h, t + i * h, reached[0])
            halfway = jnp.where(2 * i + 1 == substeps, mid, reached[1])
            return carry, jnp.where(2 * i + 2 == substeps, carry[0], halfway)

        carry, halfway = jax.lax.fori_loop(0, substeps, one, (carry, carry[0]))
        return carry, jnp.stack([halfway, carry[0]])

    turning = vector_field(ts[0], begun, (built, drive, ts[0])).angular_velocity
    carry = (start, turning, _ahead(rig, begun, turning, h))
    _, ys = jax.lax.scan(pair, carry, ts[0] + substeps * h * jnp.arange(pairs))
    ys = jnp.concatenate([start[None], ys.reshape(2 * pairs, -1)])[: len(ts)]
    states = jax.vmap(lambda y: unpack(built, y, scale))(ys)
    status = jnp.where(jnp.all(jnp.isfinite(ys)), 0, 1)
    steps = jnp.asarray(pairs * substeps)
    return trajectory(built, drive, ts, states, status, steps, "fixed exponential")


@eqx.filter_jit
def simulate_many(
    rigs: Rig,
    drive: TorqueDrive,
    ts: Float[Array, " t"],
    *,
    model: str = "coupled",
    substeps: int = 1,
) -> Trajectory:
    """Trajectories of `rigs` (every leaf with a leading axis) under one torque drive.

    `ts` are evenly spaced; `substeps` steps pass two samples.  Errors are not controlled: compare
    with twice the substeps, or with `simulate` on one rig.  Under `jax.jit` only those channels
    cost anything that are used.

    Arrays (rigs, samples, ...) in SI.  Raises nothing: a run that diverges has status non-finite.

    Source: as `simulate`; Krogstad, J. Comput. Phys. 203 (2005).
    """
    ts = jnp.asarray(ts, float)
    return jax.vmap(lambda rig: simulate_fixed(rig, drive, ts, model, substeps))(rigs)
