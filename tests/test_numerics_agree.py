"""Numerics that stand twice, for one moment and for whole arrays, hold together on random input."""

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.linalg import expm

from omnijax.diagnosis._machine._elastic.elastic import rig_modes
from omnijax.diagnosis._machine._elastic.modes import hold_weights
from omnijax.diagnosis._machine._elastic.stepped import step_matrices
from omnijax.diagnosis._machine._motion.motion import attitude
from omnijax.dynamics import quaternion_of, quaternion_product, rotation_matrix
from omnijax.rig import load_rig
from omnijax.simulation._solve.phi import phi_functions


@pytest.mark.parametrize("seed", range(3))
def test_attitudes_are_products_of_small_turns(seed):
    rng = np.random.default_rng(seed)
    omega, step = rng.normal(size=(30, 3)) * 10.0 ** rng.uniform(-3, 1), 0.02
    found = attitude(omega, step)
    q = jnp.array([1.0, 0.0, 0.0, 0.0])
    for k, turn in enumerate((omega[1:] + omega[:-1]) / 2 * step):
        q = quaternion_product(quaternion_of(jnp.asarray(turn)), q)
        assert found[k + 1] == pytest.approx(np.asarray(rotation_matrix(q)), abs=1e-13)
    generator = np.cross(turn, np.eye(3)).T  # v -> turn x v
    alone = np.asarray(rotation_matrix(quaternion_of(jnp.asarray(turn))))
    assert alone == pytest.approx(expm(generator), abs=1e-13)


@pytest.mark.parametrize("seed", range(3))
def test_integrals_over_a_step_are_the_same_three_times(seed):
    """By eigenvalues, by one large exponential, and by the solvers' phi functions."""
    modes, rng = rig_modes(load_rig("atlas")), np.random.default_rng(seed)
    h = 10.0 ** rng.uniform(-4.5, -3)
    first, second = rng.normal(size=(2, 3))
    B = modes.B[:, modes.inputs["contact"]]
    E, P, Q = step_matrices(modes, h, ("contact",))
    whole = first @ P + second @ Q
    one, two, _ = (np.asarray(x) for x in phi_functions(jnp.asarray(modes.A), h, 0)[0])
    scale = np.abs(whole).max()
    assert h * ((one - two) @ B @ first + two @ B @ second) == pytest.approx(
        whole, abs=1e-9 * scale
    )
    assert np.eye(len(E)) + h * modes.A @ one == pytest.approx(E, abs=1e-9 * np.abs(E).max())
    w = hold_weights(modes.rates, h, 1)
    gains = modes.gains[:, modes.inputs["contact"]]
    z = w[0] * (gains @ first) + w[1] * (gains @ second)
    assert np.real(modes.shapes @ z) == pytest.approx(whole, abs=1e-9 * scale)
