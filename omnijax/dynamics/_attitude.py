"""Attitude of the sphere: quaternions (w, x, y, z), body frame -> inertial frame (eq. 44)."""

import jax.numpy as jnp
from jaxtyping import Array, Float


def rotation_matrix(attitude: Float[Array, "4"]) -> Float[Array, "3 3"]:
    """Matrix body frame -> inertial frame of the quaternion (w, x, y, z), normalised here."""
    w, x, y, z = attitude / jnp.sqrt(attitude @ attitude)
    return jnp.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def attitude_rate(attitude: Float[Array, "4"], omega: Float[Array, "3"]) -> Float[Array, "4"]:
    """dq/dt = 1/2 (0, Omega) o q, Omega in the inertial frame (eq. 44)."""
    return 0.5 * quaternion_product(jnp.concatenate([jnp.zeros(1), omega]), attitude)


def quaternion_product(a: Float[Array, "4"], b: Float[Array, "4"]) -> Float[Array, "4"]:
    """a o b: the turn b, then the turn a."""
    scalar = a[0] * b[0] - a[1:] @ b[1:]
    vector = a[0] * b[1:] + b[0] * a[1:] + jnp.cross(a[1:], b[1:])
    return jnp.concatenate([jnp.atleast_1d(scalar), vector])


def quaternion_of(turn: Float[Array, "3"]) -> Float[Array, "4"]:
    """The quaternion of a turn by a rotation vector (rad)."""
    square = turn @ turn
    size = jnp.sqrt(jnp.where(square > 0, square, 1.0))
    half = jnp.where(square > 0, jnp.sin(size / 2) / size, 0.5)
    cosine = jnp.where(square > 0, jnp.cos(size / 2), 1.0)
    return jnp.concatenate([jnp.atleast_1d(cosine), half * turn])
