"""`propagate`: a whole trajectory at prescribed speeds without integrating in steps."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float

from ..._programs import kept
from ...dynamics import TRANSLATIONS, Model, State, initial_memory, pseudoinverse
from ...rig import Rig, over_wheels
from .._channels import trajectory
from .._drives import SpeedDrive
from .._padding import padded, room, samples_of
from .._signals import Signal
from .._trajectory import Trajectory
from .constant import Response, constant_response
from .expm import LEVELS, levels_needed
from .forcing import is_traced, wheel_pieces
from .period_map import longest_passage
from .system import exact_obstacle
from .varying import varying_response


def is_constant(signal: Signal) -> bool:
    """Whether a signal is known to hold one value for all times."""
    if len(signal.knots) == 1:
        return True
    if any(is_traced(x) for x in jax.tree.leaves(signal)):
        return False
    values, slopes = np.asarray(signal.values), np.asarray(signal.slopes)
    return bool(np.all(values == values[0]) and np.all(slopes == 0))


def propagation_obstacle(rig: Rig, drive: SpeedDrive, ts, model: str = "coupled") -> str | None:
    """Why `propagate` does not take this run, in words; None where it does."""
    if not (is_constant(drive.speed) and is_constant(drive.force)) and any(
        is_traced(x) for x in (*jax.tree.leaves((drive.speed, rig.wheels.rollers)), ts)
    ):
        return "changing speeds are not known while tracing"
    return exact_obstacle(rig, model)


def propagate(
    rig: Rig, drive: SpeedDrive, ts: Float[Array, " t"], *, model: str = "coupled"
) -> Trajectory:
    """Trajectory of `rig` at prescribed wheel speeds, in closed form; samples at `ts` (s).

    Starts at ts[0] in static equilibrium, as `simulate` does, with the same channels.  The cost
    does not depend on the contact's damping or stiffness.  Raises `ValueError` for a rig that the
    closed form does not cover (`exact_obstacle` says why).
    """
    reason = propagation_obstacle(rig, drive, ts, model)
    if reason is not None:
        raise ValueError(f"no exact propagation: {reason}; use `simulate`.")
    ts = jnp.asarray(ts, float)
    if is_constant(drive.speed) and is_constant(drive.force):
        if any(is_traced(x) for x in jax.tree.leaves((rig, drive, ts))):
            return _constant(rig, drive, ts, model)
        whole = _constant(rig, drive, padded(ts, room(len(ts))), model)
        return whole if len(whole.t) == len(ts) else samples_of(whole, 0, len(ts))
    return _varying(rig, drive, ts, model, *_room(rig, drive, ts, model))


def _room(rig: Rig, drive: SpeedDrive, ts, model: str) -> tuple[tuple[int, ...], int]:
    """Periods that each wheel may pass between two knots, and the ladder's levels."""
    inside = np.clip(np.asarray(drive.speed.knots), float(ts[0]), float(ts[-1]))
    knots = np.unique(np.concatenate([np.asarray(ts[:1]), inside, np.asarray(ts[-1:])]))
    read = jax.vmap(drive.speed)
    early, late = read(jnp.asarray(knots[:-1])), read(jnp.asarray(knots[1:] - 1e-12))
    fastest = np.maximum(np.abs(np.asarray(early)), np.abs(np.asarray(late)))
    turned = (fastest * np.diff(knots)[:, None]).max(axis=0)
    shapes = [[pieces for pieces, _ in wheel_pieces(rig, i)] for i in range(rig.size)]
    periods = [min(float(jnp.sum(p.width)) for p in some) for some in shapes]
    counts = tuple(int(np.ceil(a / p)) + 3 for a, p in zip(turned, periods, strict=True))
    step = float(np.diff(np.asarray(ts)).max(initial=1e-6))
    still = jnp.zeros(rig.size)
    return counts, levels_needed(longest_passage(rig, still, still, model, jnp.asarray(step)))


@kept
def _varying(rig, drive, ts, model, counts, levels) -> Trajectory:
    response = varying_response(rig, drive, ts, model, counts, levels, compose)
    return _finish(rig, drive, ts, model, response, response.attitude)


@kept
def _constant(rig: Rig, drive: SpeedDrive, ts, model: str) -> Trajectory:
    """One program for every rig and speed: the ladder is as long as any rig's rates ask."""
    angles = jnp.zeros(rig.size) if drive.initial_angle is None else drive.initial_angle
    speeds, force = drive.speed.values[0], drive.force.values[0]
    response = constant_response(rig, speeds, angles, force, ts, model, None, LEVELS)
    return _finish(rig, drive, ts, model, response, attitudes(rig, drive, ts, response))


def _finish(rig: Rig, drive: SpeedDrive, ts, model: str, response, attitude) -> Trajectory:
    translation = TRANSLATIONS[model](rig)
    rest = (translation.rest(), initial_memory(rig))
    unravel = ravel_pytree(rest)[1]
    elastic, memory = jax.vmap(unravel)(response.state)
    count = len(ts)
    states = State(
        elastic=elastic,
        angle=jnp.zeros((count, rig.size)),  # the drive's own, filled in with the channels
        angular_velocity=jnp.zeros((count, 3)),
        attitude=attitude,
        position=response.position,
        drift=response.drift,
        memory=memory,
    )
    finite = jnp.all(jnp.isfinite(response.state))
    status, steps = jnp.where(finite, 0, 1), jnp.zeros((), int)
    return trajectory(Model(translation), drive, ts, states, status, steps, "exact")


class Turning(NamedTuple):
    """Integrals of r_w omega of every wheel between samples."""

    whole: Float[Array, "t n"]  # m rad
    moment: Float[Array, "t n"]  # m rad s, about the middle of each interval


def _turning(rig: Rig, speeds, ts, response: Response) -> Turning:
    h = jnp.diff(ts)[:, None]
    L, LL = response.integral, response.second
    gained = L[1:] - L[:-1]
    # integral of (t - t_k) rho = h L(t_k+1) - (LL(t_k+1) - LL(t_k)), both from the run's start
    moment = h * L[1:] - (LL[1:] - LL[:-1]) - h / 2 * gained
    return Turning((rig.wheel_radius * h + gained) * speeds, moment * speeds)


def attitudes(rig: Rig, drive: SpeedDrive, ts, response: Response) -> Float[Array, "t 4"]:
    """Attitude at the samples from q = identity: Magnus steps of fourth order,

    sigma = I + (J x I)/h,   I = integral of Omega, J = its moment about the interval's middle
    """
    speeds = drive.speed.values[0]
    factor = 1 + over_wheels(rig.at("kinematics"), speeds, rig.size)
    to_sphere = pseudoinverse(rig.wheels.spin_axis) * factor / rig.sphere.radius
    turning = _turning(rig, speeds, ts, response)
    whole, moment = turning.whole @ to_sphere.T, turning.moment @ to_sphere.T
    h = jnp.diff(ts)[:, None]
    return compose(whole + jnp.cross(moment, whole) / jnp.where(h > 0, h, 1.0))


def compose(angles: Float[Array, "t 3"]) -> Float[Array, "t+1 4"]:
    """Attitudes after successive turns by rotation vectors (rad, inertial frame)."""
    square = jnp.sum(angles**2, axis=1, keepdims=True)
    size = jnp.sqrt(jnp.where(square > 0, square, 1.0))
    half = jnp.where(square > 0, jnp.sin(size / 2) / size, 0.5)
    cosine = jnp.where(square > 0, jnp.cos(size / 2), 1.0)
    turns = jnp.concatenate([cosine, half * angles], axis=1)

    def on(q, turn):
        w, v = q[0], q[1:]
        vector = turn[0] * v + w * turn[1:] + jnp.cross(turn[1:], v)
        q = jnp.concatenate([jnp.atleast_1d(turn[0] * w - turn[1:] @ v), vector])
        return q, q

    first = jnp.array([1.0, 0.0, 0.0, 0.0])
    return jnp.concatenate([first[None], jax.lax.scan(on, first, turns)[1]])
