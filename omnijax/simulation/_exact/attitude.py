"""The attitude of a run in closed form: turns between samples, one after the other."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ...dynamics import pseudoinverse, quaternion_of, quaternion_product
from ...rig import Rig, over_wheels
from .._drives import SpeedDrive
from .constant import Response


class TurningSteps(NamedTuple):
    """Integrals of r_w omega of every wheel between samples."""

    whole: Float[Array, "t n"]  # m rad
    moment: Float[Array, "t n"]  # m rad s, about the middle of each interval


def _turning(rig: Rig, speeds, ts, response: Response) -> TurningSteps:
    h = jnp.diff(ts)[:, None]
    L, LL = response.integral, response.second
    gained = L[1:] - L[:-1]
    # integral of (t - t_k) rho = h L(t_k+1) - (LL(t_k+1) - LL(t_k)), both from the run's start
    moment = h * L[1:] - (LL[1:] - LL[:-1]) - h / 2 * gained
    return TurningSteps((rig.wheel_radius * h + gained) * speeds, moment * speeds)


def attitudes(rig: Rig, drive: SpeedDrive, ts, response: Response, first) -> Float[Array, "t 4"]:
    """Attitude at the samples from q = `first`: Magnus steps of fourth order,

    sigma = I + (J x I)/h,   I = integral of Omega, J = its moment about the interval's middle
    """
    speeds = drive.speed.values[0]
    factor = 1 + over_wheels(rig.at("kinematics"), speeds, rig.size)
    to_sphere = pseudoinverse(rig.wheels.spin_axis) * factor / rig.sphere.radius
    turning = _turning(rig, speeds, ts, response)
    whole, moment = turning.whole @ to_sphere.T, turning.moment @ to_sphere.T
    h = jnp.diff(ts)[:, None]
    return compose(whole + jnp.cross(moment, whole) / jnp.where(h > 0, h, 1.0), first)


def compose(angles: Float[Array, "t 3"], first: Float[Array, "4"]) -> Float[Array, "t+1 4"]:
    """Attitudes from `first` on after successive turns by rotation vectors (rad, inertial)."""

    def on(q, turn):
        q = quaternion_product(turn, q)
        return q, q

    turns = jax.vmap(quaternion_of)(angles)
    return jnp.concatenate([first[None], jax.lax.scan(on, first, turns)[1]])
