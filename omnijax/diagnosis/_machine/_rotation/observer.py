"""Omega where dry friction hangs on it: the model's own Omega, held gently to the measured one.

Near a reversal tanh(Omega/epsilon) changes within 1e-4 rad/s, less than smoothed angles resolve, so
the laws are evaluated along dOmega/dt = model + pull (measured - Omega).  Where the model is right
the pull does nothing; where it is not, Omega stays near the measured one.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from scipy.interpolate import CubicSpline

from ...._programs import kept
from ....dynamics import RotationMoment, TurningLaws, combined, rest_memory, torques
from ....rig import Rig
from ..._recursion import recursion
from ..._settings import SETTINGS
from .._laws import bare
from .._motion import RunMotion, rolling_radius
from ..runs import FINE, padded
from .rotation import MeasuredTurning, attitude_matters

PULL = SETTINGS.prediction.pull
ERROR = SETTINGS.prediction.turning_error
SHORTEST = SETTINGS.prediction.shortest_turn
STILL_SHARE = SETTINGS.prediction.still_share


def needs_observer(rig: Rig) -> bool:
    """Whether a law with a friction width acts on the rotation."""
    placed = (*rig.at("rolling"), *rig.at("shaft"))
    return any("width" in p.law.parameters for p in placed)


class Path(NamedTuple):
    """What Omega's rate hangs on beside Omega, (t, ...)."""

    response: jax.Array  # (t, n + 3, 3) rad/s^2 of a unit torque on each shaft, against each axis
    axes: jax.Array  # (t, n, 3)
    radius: jax.Array  # (t, n) m
    theta: jax.Array  # (t, n) rad
    command: jax.Array  # (t, n) N m
    normal: jax.Array  # (t, n) N
    attitude: jax.Array  # (t, 3, 3)
    measured: jax.Array  # (t, 3) rad/s


def observed_turning(rig: Rig, motion: RunMotion, path: Path, normal, step: float, at_rest: bool):
    """(Omega (t, 3), wheel speeds (t, n)) at the FINE points, from Omega at the samples.

    `path` is that of `path_along`, `normal` (t, n) the contacts' forces.  A run that begins at rest
    begins at zero: smoothed angles say so only to 1e-2 rad/s, which already is sliding.
    """
    samples = (len(normal) - 1) // FINE + 1
    path = path._replace(normal=padded(normal[:: FINE // 2], len(path.radius)))
    first = np.zeros(3) if at_rest else motion.turning[0]
    laws = TurningLaws.of(rig, masked=True)
    omega = np.asarray(_integrate(bare(rig), laws, path, np.asarray(step), first))[:samples]
    fine = np.full((len(normal), 3), np.nan)  # of a run that runs away
    if np.all(np.isfinite(omega)):
        fine = CubicSpline(np.arange(samples), omega)(np.arange(len(normal)) / FINE)
    radius = rolling_radius(rig, motion)
    speed = float(rig.sphere.radius) * np.einsum("tij,tj->ti", motion.axes, fine) / radius
    return fine, speed


def held_turning(
    foretold: np.ndarray, measured: np.ndarray, step: float, at_rest: bool
) -> np.ndarray:
    """Omega (t, 3) in rad/s under the same pull where the model's own, `foretold`, is known.

    Its rates do not hang on Omega, so that what the `measured` one pulls it by adds to it.
    """
    drift = measured - foretold
    keep = np.exp(-PULL * step)
    first = np.zeros((1, 3)) if at_rest else drift[:1]
    held = np.concatenate([first, (1 - keep) * drift])
    recursion([float(keep)] * held.shape[1], held)
    return foretold + held[1:]


def path_along(
    rig: Rig, motion: RunMotion, response: MeasuredTurning, command, longest: int
) -> Path:
    """The path at two points a sample (starts, middles, ends of the steps), without normal forces.

    Runs are padded to `longest` samples, so that one program serves all.
    """
    half, length = FINE // 2, 2 * (longest - 1) + 1

    def every(x):
        return np.broadcast_to(x, (len(command), *x.shape[1:]))[::half]

    radius = every(rolling_radius(rig, motion))
    attitude = motion.attitude if attitude_matters(rig) else np.eye(3)[None]
    path = (
        every(response.rates), every(response.axes), radius, every(motion.theta), every(command),
        np.zeros_like(radius), every(attitude), every(motion.turning),
    )  # fmt: skip
    return Path(*(jnp.asarray(padded(x, length)) for x in path))


@kept
def _integrate(rig: Rig, laws: TurningLaws, path: Path, step, first):
    """Omega (samples, 3): classical Runge-Kutta, one step a sample, halved where need be.

    A narrow friction switches within a part of a step, and holds the sphere stiffly at rest.
    """
    points = tuple(jax.tree.map(lambda x, k=k: x[k : len(x) - 2 + k : 2], path) for k in range(3))

    def rate(state, at):
        omega, memory = state
        return _rate(rig, laws, omega, memory, at)

    def body(state, now):
        def part(carry):
            state, begin, share = carry
            here = [_between(now, begin + k * share / 2) for k in range(3)]
            ahead, fits = _runge_kutta(rate, state, here, share * step)
            good = fits | (share <= SHORTEST)
            state = jax.tree.map(lambda new, old: jnp.where(good, new, old), ahead, state)
            return state, begin + jnp.where(good, share, 0.0), jnp.where(good, share, share / 2)

        state, *_ = jax.lax.while_loop(lambda carry: carry[1] < 1, part, (state, 0.0, 1.0))
        return state, state[0]

    begin = jax.tree.map(lambda x: x[0], path)
    memory = rest_memory(lambda z: rate((first, z), begin)[1], laws.rest(rig.size))
    _, out = jax.lax.scan(body, (first, memory), points)
    return jnp.concatenate([first[None], out])


def _between(points: tuple[Path, Path, Path], share) -> Path:
    """The path at a share of a step, straight between its begin, middle and end."""
    early = share < 0.5
    rest = jnp.where(early, 2 * share, 2 * share - 1)

    def at(begin, middle, end):
        return jnp.where(early, begin, middle) * (1 - rest) + jnp.where(early, middle, end) * rest

    return jax.tree.map(at, *points)


def _runge_kutta(rate, state, points, h):
    """The state after `h` s, and whether that is short enough.

    So it is where Omega is near that of the midpoint rule, and what a rate's change changes in the
    next one is no larger: beyond that a stiff state would swing about its rest.  One that runs away
    gains nothing from shorter steps.
    """

    def ahead(rate, h):
        return jax.tree.map(lambda x, r: x + h * r, state, rate)

    a, b, c = points
    k1 = rate(state, a)
    k2 = rate(ahead(k1, h / 2), b)
    k3 = rate(ahead(k2, h / 2), b)
    k4 = rate(ahead(k3, h), c)
    mean = jax.tree.map(lambda p, q, r, s: (p + 2 * q + 2 * r + s) / 6, k1, k2, k3, k4)
    error, first, second = (h * jnp.max(jnp.abs(x[0] - k2[0])) for x in (mean, k1, k3))
    swings = second > jnp.maximum(first, ERROR * STILL_SHARE)
    return ahead(mean, h), ~((error > ERROR) | swings)


def _rate(rig: Rig, laws: TurningLaws, omega, memory, at: Path) -> tuple[jax.Array, Any]:
    """dOmega/dt and the rates of the laws' memories at one moment."""
    speed = rig.sphere.radius * combined(omega, at.axes.T) / at.radius
    moment = RotationMoment(
        at.axes, at.attitude, omega, at.theta, speed, at.command, at.command, at.normal
    )
    _, caused, rates = torques(rig, laws, moment, memory)
    turned = combined(jnp.concatenate(caused), at.response)
    return turned + PULL * (at.measured - omega), rates
