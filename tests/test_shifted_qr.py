"""Poles and vectors by QR iteration against the matrices they belong to, drawn of every kind."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.linalg
import scipy.stats
from seeds import drawn_anew
from tiers import tiered

from omnijax.simulation._modal._poles import shifted_qr
from omnijax.simulation._modal._poles.poles import _decomposed
from omnijax.simulation._modal._poles.shifted_qr import decomposed

COUNT = 48
EPS = np.finfo(float).eps


def turned(rng, diagonal):
    """A matrix of these eigenvalues with orthogonal vectors."""
    Q = scipy.stats.ortho_group.rvs(len(diagonal), random_state=rng)
    return Q @ diagonal @ Q.T


def pair(rng):
    """Of two conjugate poles."""
    decay, turn = -(10 ** rng.uniform(-3, 3)), 10 ** rng.uniform(0, 3)
    return np.array([[decay, turn], [-turn, decay]])


def masses(rng, count: int, least: float, most: float):
    """Masses on springs with dampers of 10^least to 10^most of their stiffness, as states."""
    shape = rng.normal(size=(count, count))
    stiffness = 10 ** rng.uniform(2, 6) * shape @ shape.T
    mixed = rng.normal(size=(count, count))
    damping = 10 ** rng.uniform(least, most) * (stiffness + 10 * mixed @ mixed.T)
    zero = np.zeros((count, count))
    return np.block([[zero, np.eye(count)], [-stiffness, -damping]])


def equal_pairs(rng):
    one, other = pair(rng), pair(rng)
    return turned(rng, scipy.linalg.block_diag(one, one, one, other, pair(rng), other))


def equal_reals(rng):
    one, other = -(10 ** rng.uniform(-1, 4, 2))
    return turned(rng, np.diag([one, one, one, other, other, -1.0, 0.0, 0.0]))


def free(rng):
    """Masses of which two directions are not held; a state that nothing moves."""
    shape = rng.normal(size=(4, 2))
    held = 1e4 * shape @ shape.T
    A = np.block([[-0.1 * np.eye(4), np.eye(4)], [-held, -0.01 * held - np.eye(4)]])
    return scipy.linalg.block_diag(A, 0.0, -1.0)


CLASSES = {
    "unstructured": lambda rng, m: rng.normal(size=(m, m)) * 10 ** rng.uniform(-2, 2, (m, 1)),
    "masses": lambda rng, m: masses(rng, m // 2, -6, -3),
    "masses, stiff": lambda rng, m: masses(rng, m // 2, -3, 1),
    "undamped": lambda rng, m: masses(rng, m // 2, -300, -299),
    "equal pairs": lambda rng, m: equal_pairs(rng),
    "equal real poles": lambda rng, m: equal_reals(rng),
    "not held": lambda rng, m: free(rng),
    "in a circle": lambda rng, m: np.roll(np.eye(m), 1, axis=0),
    "nothing": lambda rng, m: np.zeros((m, m)),
}


@pytest.mark.parametrize("name", tiered(CLASSES, {"masses", "equal pairs"}.__contains__))
def test_decompositions_of_drawn_matrices(name):
    rng = drawn_anew(name)
    m = 2 * int(rng.integers(3, 10))
    A = np.array([CLASSES[name](rng, m) for _ in range(COUNT)])
    units = 2.0 ** rng.integers(-8, 9, (COUNT, A.shape[1]))
    A = A * units[:, :, None] / units[:, None]
    made = jax.jit(decomposed)(jnp.moveaxis(jnp.asarray(A), 0, -1))
    good = np.asarray(made.good)  # others are left to LAPACK, the batch with them
    assert np.mean(good) > 0.9
    real, imaginary = (np.asarray(x).T for x in made[:2])
    vector, inverse = (np.moveaxis(np.asarray(x), -1, 0) for x in made[2:4])
    for i in np.flatnonzero(good):
        one = A[i]
        upper = imaginary[i] > 0
        assert np.all(imaginary[i][1:][upper[:-1]] == -imaginary[i][:-1][upper[:-1]])
        L = np.diag(real[i]) + np.diag(imaginary[i, :-1] * upper[:-1], 1)
        L -= np.diag(imaginary[i, :-1] * upper[:-1], -1)
        # in units that make rows and columns alike, as rounding sees them
        _, (unit, _) = scipy.linalg.matrix_balance(one, permute=False, separate=True)
        balanced, V, X = one * unit / unit[:, None], vector[i] / unit[:, None], inverse[i] * unit
        size = 1e3 * EPS * np.linalg.cond(V)
        assert np.abs(V @ X - np.eye(len(V))).max() < size
        assert np.abs(V @ L @ X - balanced).max() <= size * np.abs(balanced).max()


def test_matrices_that_hold_no_numbers_leave_the_others_alone():
    rng = drawn_anew("no number")
    A = rng.normal(size=(8, 8, COUNT))
    broken = A.copy()
    broken[2, 3, 5], broken[0, 0, 7] = np.nan, np.inf
    whole, some = (jax.jit(decomposed)(jnp.asarray(x)) for x in (A, broken))
    assert np.all(some.good) and np.all(np.isnan(np.asarray(some.real)[:, [5, 7]]))
    others = np.delete(np.arange(COUNT), [5, 7])
    for x, y in zip(whole, some, strict=True):
        np.testing.assert_array_equal(np.asarray(x)[..., others], np.asarray(y)[..., others])


def test_a_batch_whose_poles_do_not_come_off_is_left_to_lapack(monkeypatch):
    A = jnp.asarray(drawn_anew("given up").normal(size=(COUNT, 2, 8, 8)))
    in_step, by_lapack = (jax.jit(partial(_decomposed, in_step=x))(A) for x in (True, False))
    assert np.any(in_step.vector != by_lapack.vector)
    monkeypatch.setattr(shifted_qr, "SWEEPS", 0)
    left = jax.jit(lambda A: _decomposed(A, True))(A)
    for x, y in zip(left, by_lapack, strict=True):
        np.testing.assert_array_equal(x, y)


def test_both_ways_give_the_same_matrices_back():
    A = drawn_anew("packed").normal(size=(COUNT, 3, 6, 6))
    for in_step in (True, False):
        made = jax.jit(partial(_decomposed, in_step=in_step))(jnp.asarray(A))
        value, vector, inverse = (np.asarray(x) for x in made[:3])
        turn = np.where(value.imag > 0, value.imag, 0.0)[..., :-1]
        L = value.real[..., None] * np.eye(6)
        for i in range(5):
            L[..., i, i + 1], L[..., i + 1, i] = turn[..., i], -turn[..., i]
        np.testing.assert_allclose(vector @ L @ inverse, A, atol=1e-10)
        each = np.asarray(made.first).sum(-2) + np.asarray(made.second).sum(-2)
        np.testing.assert_array_equal(each, 1.0)
