"""The ideal case: round wheels, constant torques and a constant force on the platform."""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from ..rig import Rig
from ..simulation import Trajectory, simulate, torques
from ._case import FORCE, RANGES, TORQUE, changed

DURATION, SAMPLES = 8.0, 161  # s


class Ideal(NamedTuple):
    """Runs of the ideal case; leading axis: the own rig, then the corners of the ranges."""

    t: Float[np.ndarray, " t"]  # s
    run: Trajectory
    no_torque: Trajectory  # own rig, T = 0
    no_force: Trajectory  # own rig, P = 0
    one_torque: Trajectory  # own rig, the second motor alone


@eqx.filter_jit
def _run(rig: Rig, values, torque, force) -> Trajectory:
    ts = jnp.linspace(0.0, DURATION, SAMPLES)

    def one(row, torque, force):
        machine = changed(rig, {"wheel.roundness": 0.0, **row})
        return simulate(machine, torques(torque, force), ts, solver="tsit5")

    return jax.vmap(one)(values, torque, force)


def ideal_runs(rig: Rig) -> Ideal:
    """The ideal case of `rig` and at the corners of the ranges of I_s and I_w."""
    by_path = {r.path: r for r in RANGES if r.path.endswith("inertia")}
    own = {
        "sphere.inertia": float(rig.sphere.inertia),
        "wheel.inertia": float(rig.wheels.inertia[0]),
    }
    corners = [own] + [
        {"sphere.inertia": a, "wheel.inertia": b}
        for a in (by_path["sphere.inertia"].low, by_path["sphere.inertia"].high)
        for b in (by_path["wheel.inertia"].low, by_path["wheel.inertia"].high)
    ]
    rows = corners + [own] * 3
    values = {path: jnp.asarray([row[path] for row in rows]) for path in own}
    torque = np.tile(TORQUE, (len(rows), 1))
    force = np.tile(FORCE, (len(rows), 1))
    torque[-3] = 0.0
    force[-2] = 0.0
    torque[-1] = [0.0, TORQUE[1], 0.0]
    runs = _run(rig, values, jnp.asarray(torque), jnp.asarray(force))

    def at(index) -> Trajectory:
        return jax.tree.map(lambda x: np.asarray(x)[index], runs)

    ideal = Ideal(np.asarray(runs.t[0]), at(slice(0, len(corners))), at(-3), at(-2), at(-1))
    for run in (ideal.no_torque, ideal.no_force, ideal.one_torque):
        if int(run.status) != 0:
            raise RuntimeError(f"the ideal case failed: {run.message()}")
    return ideal


def line_residual(t, values) -> float:
    """Largest distance of columns from their own straight line through 0, over their range."""
    slope = (t @ values) / (t @ t)
    return float(np.max(np.abs(values - t[:, None] * slope)) / np.max(np.abs(values)))


def parabola_residual(t, values) -> float:
    """Largest distance of columns from their own parabola a t^2/2, over their range."""
    return line_residual(t**2, values)


def angle_residual(t, omega, attitude) -> float:
    """Distance of the quaternion from (cos, sin) of half the turn angle about Omega's direction."""
    rate = np.linalg.norm((t @ omega) / (t @ t))
    axis = (t @ omega) / np.linalg.norm(t @ omega)
    half = 0.25 * rate * t**2
    expected = np.column_stack([np.cos(half), np.sin(half)[:, None] * axis])
    return float(np.max(np.abs(attitude - expected)))


def time_sinusoid_residual(t, attitude) -> float:
    """RMS left of the quaternion by the best sinusoid in time with one frequency, over its RMS."""
    best = np.inf
    for rate in np.linspace(0.05, 12.0, 1200):
        basis = np.column_stack([np.ones_like(t), np.cos(rate * t), np.sin(rate * t)])
        left = attitude - basis @ np.linalg.lstsq(basis, attitude, rcond=None)[0]
        best = min(best, float(np.sqrt(np.mean(left**2) / np.mean(attitude**2))))
    return best
