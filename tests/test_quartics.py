"""Poles in closed form against matrix exponentials, on drawn blocks of every class."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.linalg
from seeds import drawn_anew

from omnijax.simulation._modal._poles.poles import _decomposed
from omnijax.simulation._modal._poles.quartics import block_poles

COUNT = 64
EPS = np.finfo(float).eps


def oscillators(mass, stiffness, damping):
    """Two masses as states, in units in which rows and columns are of like size."""
    A = np.zeros((4, 4))
    A[:2, 2:] = np.eye(2)
    A[2:, :2], A[2:, 2:] = -stiffness / mass[:, None], -damping / mass[:, None]
    _, (scale, _) = scipy.linalg.matrix_balance(A, permute=False, separate=True)
    return A * scale / scale[:, None]


def chain(rng, least: float, most: float):
    """A contact and a mount, damped by 10^least to 10^most N s/m."""
    mass = 10 ** rng.uniform(-1, 2, 2)
    contact, mount = 10 ** rng.uniform((3, 2), 6)
    damping = 10 ** rng.uniform(least, most, 2)
    link = np.array([[1.0, -1.0], [-1.0, 1.0]])
    own = np.diag([0.0, 1.0])
    return oscillators(mass, contact * link + mount * own, damping[0] * link + damping[1] * own)


def critical(rng):
    """One of two masses as near to critical damping as rounding tells, or not quite."""
    rate = rng.uniform(10, 100, 2)
    link = 0.1 * rate.min() ** 2 * rng.uniform(0.1, 1)
    stiffness = np.diag(rate**2) - link * (1 - np.eye(2))
    near = 1 + 10 ** rng.uniform(-16, -2)
    damping = np.diag([2 * rate[0] * near, 2 * rate[1] * 10 ** rng.uniform(-2, 1)])
    return oscillators(np.ones(2), stiffness, damping)


CLASSES = {
    "damped": lambda rng: chain(rng, 0, 5),
    "lightly": lambda rng: chain(rng, -4, 0),
    "undamped": lambda rng: chain(rng, -300, -299),
    "critical": critical,
    "unstructured": lambda rng: rng.normal(size=(4, 4)) * 10 ** rng.uniform(-3, 3, (4, 1)),
    "two": lambda rng: np.array([[0, 1], [-(10 ** rng.uniform(0, 6)), -(10 ** rng.uniform(0, 3))]]),
}


def moved(block, i: int, time: float):
    """exp(A t) of one matrix, by its poles."""
    kind, first, second = (np.asarray(x)[:, i] for x in block[:3])
    parts = [
        np.exp(a * time) * np.array([[np.cos(b * time), np.sin(b * time)],
                                     [-np.sin(b * time), np.cos(b * time)]])
        if k else np.diag(np.exp(np.array([a, b]) * time))
        for k, a, b in zip(kind, first, second, strict=True)
    ]  # fmt: skip
    V, X = (np.asarray(x)[:, :, i] for x in (block.vector, block.inverse))
    return V @ scipy.linalg.block_diag(*parts) @ X


@pytest.mark.parametrize("name", CLASSES)
def test_exponentials_of_drawn_blocks(name):
    rng = drawn_anew(name)
    A = np.array([CLASSES[name](rng) for _ in range(COUNT)])
    block = jax.jit(block_poles)(jnp.moveaxis(jnp.asarray(A), 0, -1))
    assert np.all(block.good)
    for i, one in enumerate(A):
        poles = np.linalg.eigvals(one)
        size = np.linalg.cond(np.asarray(block.vector)[:, :, i])
        for turns in (0.1, 1.0, 10.0):
            time = turns / np.abs(poles).max()
            expected = scipy.linalg.expm(one * time)
            error = np.abs(moved(block, i, time) - expected).max() / np.abs(expected).max()
            assert error < 1e-13 * max(size, 10.0)


def test_slow_poles_beside_fast_ones_are_as_good_as_these():
    """Overdamped contacts: K/C beside C/m, known from the sum and the product of all roots."""
    rng = drawn_anew("stiff")
    contact, mount, damping = 10 ** rng.uniform((5, 3, 4), (6, 4, 5), (COUNT, 3)).T
    link, own = np.array([[1.0, -1.0], [-1.0, 1.0]]), np.diag([0.0, 1.0])
    A = np.array([
        oscillators(np.array([70.0, 0.3]), K * link + k * own, C * link)
        for K, k, C in zip(contact, mount, damping, strict=True)
    ])  # fmt: skip
    block = jax.jit(block_poles)(jnp.moveaxis(jnp.asarray(A), 0, -1))
    k, a, b = (np.asarray(x) for x in block[:3])
    product = np.prod(np.where(k, a * a + b * b, a * b), axis=0)
    np.testing.assert_allclose(product, contact * mount / (70.0 * 0.3), rtol=2e-12)
    inverse = np.sum(np.where(k, 2 * a / (a * a + b * b), 1 / a + 1 / b), axis=0)  # = -a1/a0
    np.testing.assert_allclose(inverse, -damping / contact, rtol=2e-12)


@pytest.mark.full  # in the gate others that are: test_shifted_qr
def test_pairs_that_are_hardly_two_are_left_to_lapack():
    """Two equal oscillators that hardly move each other: their quadratics have roots in common."""
    rng = drawn_anew("weak")
    weak = 1e-9 * rng.uniform(1, 2)
    stiffness = 1e3 * np.array([[1.0, weak], [weak, 1.0 + weak]])
    A = jnp.asarray(oscillators(np.ones(2), stiffness, 0.1 * np.eye(2)))
    assert not np.any(block_poles(A[:, :, None]).good)
    both = jnp.stack([A, jnp.asarray(chain(rng, 0, 2))])[:, None]
    found_by = jax.jit(partial(_decomposed, in_step=False))(both)
    expected = np.linalg.eigvals(np.asarray(both)[:, 0])
    for ours, theirs in zip(np.asarray(found_by.value)[:, 0], expected, strict=True):
        np.testing.assert_allclose(
            np.sort_complex(ours), np.sort_complex(theirs), rtol=1e-12 * np.abs(theirs).max()
        )
