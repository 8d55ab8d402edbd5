"""`simulate_many`: torque-driven runs of many rigs at one fixed step, for sweeps.

One step h of dy/dt = A y + N(t, y) is Krogstad's exponential Runge-Kutta method (order 4), with the
wheel's shape taken out of N, since its kinks at gap edges fall inside steps: the angle along the
step is a cubic, the shape is sampled on it at `PANELS` parabolas, and the elastic response to that,
int_0^h exp((h - s) A) B rho(theta(s)) ds, is exact.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float

from ..dynamics import Model, linear_system, position_input
from ..rig import Rig
from ._channels import trajectory
from ._drives import TorqueDrive
from ._phi import phi_functions
from ._trajectory import Trajectory
from ._vector import (
    build_model,
    initial_state,
    initial_state_like,
    pack,
    scaled_field,
    state_scale,
    unpack,
)

HALVINGS = 4
PANELS = 2**HALVINGS  # parabolas of the shape in one step


class Tables(NamedTuple):
    """Matrices of one rig for one step size; elastic part in natural units."""

    A: Float[Array, "m m"]
    half: Float[Array, "3 m m"]  # phi_1 ... phi_3 of half a step
    whole: Float[Array, "3 m m"]  # phi_1 ... phi_3 of a step
    into: Float[Array, "m n"]  # from the shape
    midway: Float[Array, "m k n"]  # elastic state after half a step, to the shape at its nodes
    response: Float[Array, "m k n"]  # the same after a step


def _tables(model: Model, scale, step) -> Tables:
    system = linear_system(model.translation)
    m = system.A.shape[0]
    A = system.A * scale[:m] / scale[:m, None]
    into = system.into("shape") / scale[:m, None]
    width = step / PANELS
    whole, half, *_, part = phi_functions(A, step, HALVINGS)
    one, two, three = part
    parabola = jnp.stack([one - 3 * two + 4 * three, 4 * two - 8 * three, 4 * three - two])
    parabola = width * parabola @ into
    after = jnp.eye(m) + width * A @ one
    midway = response = jnp.zeros((2 * PANELS + 1, m, into.shape[1]))
    for panel in range(PANELS):
        response = jnp.einsum("ab,kbn->kan", after, response)
        response = response.at[2 * panel : 2 * panel + 3].add(parabola)
        if 2 * (panel + 1) == PANELS:
            midway = response[: PANELS + 1]
    return Tables(A, half, whole, into, jnp.swapaxes(midway, 0, 1), jnp.swapaxes(response, 0, 1))


def _step(model: Model, drive, start, scale, tables: Tables, h, t, y):
    """The states half a step and one step later."""
    A, (half1, half2, half3), (one, two, three), into, midway, response = tables
    m = A.shape[0]
    shapes = ravel_pytree(initial_state_like(model))[1]

    def shape(y):
        state = shapes(y * scale)
        return position_input(model.rig, state.angle, state.attitude)

    def split(t, y):  # remainder's elastic rows without the shape, other rows, and the shape
        rate = scaled_field(t, y, (model, drive, start, scale))
        return rate[:m] - A @ y[:m], rate[m:]

    e, z = y[:m], y[m:]
    n1, z1 = split(t, y)
    slope = A @ e + n1
    mid = e + 0.5 * h * (half1 @ slope)
    n2, z2 = split(t + h / 2, jnp.concatenate([mid, z + 0.5 * h * z1]))
    y3 = jnp.concatenate([mid + h * (half2 @ (n2 - n1)), z + 0.5 * h * z2])
    n3, z3 = split(t + h / 2, y3)
    whole = e + h * (one @ slope)
    y4 = jnp.concatenate([whole + 2 * h * (two @ (n3 - n1)), z + h * z3])
    n4, z4 = split(t + h, y4)
    end = z + h / 6 * (z1 + 2 * z2 + 2 * z3 + z4)

    s = np.linspace(0, 1, 2 * PANELS + 1)[:, None]  # cubic of the other rows along the step
    cubic = z + s**2 * (3 - 2 * s) * (end - z) + h * s * (1 - s) * ((1 - s) * z1 - s * z4)
    along = jnp.concatenate([jnp.broadcast_to(e, (len(s), m)), cubic], axis=1)
    rho = jax.vmap(shape)(along)
    r1, r2, r3, r4 = rho[0], shape(jnp.concatenate([e, z + 0.5 * h * z1])), shape(y3), shape(y4)
    d1, d2, d3, d4 = n1 - into @ r1, n2 - into @ r2, n3 - into @ r3, n4 - into @ r4
    first, linear, square = A @ e + d1, 2 * (d2 + d3) - 3 * d1 - d4, 4 * (d1 + d4 - d2 - d3)
    new = e + h * (one @ first + two @ linear + three @ square)
    new = new + jnp.einsum("akn,kn->a", response, rho)
    mid = e + h * (half1 @ first / 2 + half2 @ linear / 4 + half3 @ square / 8)
    mid = mid + jnp.einsum("akn,kn->a", midway, rho[: PANELS + 1])
    return jnp.concatenate([mid, cubic[PANELS]]), jnp.concatenate([new, end])


def _run(rig: Rig, drive: TorqueDrive, ts, model: str, substeps: int) -> Trajectory:
    built = build_model(rig, model)
    scale = ravel_pytree(state_scale(built))[0]
    pairs = len(ts) // 2  # one step passes two samples
    h = 2 * (ts[-1] - ts[0]) / ((len(ts) - 1) * substeps)
    tables = _tables(built, scale, h)
    start = pack(built, initial_state(built, drive), scale)

    def pair(y, t):
        passed = []
        for i in range(substeps):
            mid, y = _step(built, drive, ts[0], scale, tables, h, t + i * h, y)
            passed += [mid, y]
        return y, jnp.stack([passed[substeps - 1], y])

    _, ys = jax.lax.scan(pair, start, ts[0] + substeps * h * jnp.arange(pairs))
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
    with `simulate` on one rig.  Under `jax.jit` only those channels cost
    anything that are used.
    """
    ts = jnp.asarray(ts, float)
    return jax.vmap(lambda rig: _run(rig, drive, ts, model, substeps))(rigs)
