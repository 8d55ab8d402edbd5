"""Extremes of the steady state found by the lean search against the search of `steady_state`."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from machines import ORTHOGONAL, SKEW, machine

from omnijax.simulate import steady_state
from omnijax.vibration import LongRun

RIGS = 8


def _cases(layout):
    """Rigs from soft and round to stiff and damped, wheels that turn either way, slow and fast."""
    random, rig = np.random.default_rng(11), machine(layout)
    for _ in range(RIGS):
        values = [10 ** random.uniform(low, high, 3) for low, high in ((5, 6.7), (2, 4.3), (2, 3))]
        values.append(random.uniform(0.05, 0.95, 3))
        yield (
            eqx.tree_at(
                lambda r: (
                    r.wheels.contact.stiffness,
                    r.wheels.contact.damping,
                    r.wheels.mount.damping,
                    r.wheels.roundness,
                ),
                rig,
                tuple(map(jnp.asarray, values)),
            ),
            jnp.asarray(random.choice([-1, 1], 3) * 10 ** random.uniform(-1, 1, 3)),
        )


@eqx.filter_jit
def _lean(rig, speeds):
    run = LongRun(rig, speeds, jnp.zeros(3), "coupled")
    high, low = run.extremes("dR")
    return jnp.concatenate([run.supremum("dR")[None], jnp.maximum(high, low), high + low])


@pytest.mark.parametrize("layout", [ORTHOGONAL, SKEW])
def test_peaks_are_those_of_the_full_search(layout):
    for rig, speeds in _cases(layout):
        fine = steady_state(rig, speeds, grid_bits=10)
        want = jnp.concatenate([fine.peak[None], fine.peak_component, fine.peak_to_peak])
        found = _lean(rig, speeds)
        assert np.allclose(found[1:], want[1:], rtol=1e-6), (rig, speeds)
        assert np.isclose(found[0], want[0], rtol=1e-5), (rig, speeds)  # two places nearly as high


def test_gradients_of_a_stiff_slow_rig_are_those_of_differences():
    rig, speeds = next(_cases(ORTHOGONAL))
    rig = eqx.tree_at(lambda r: r.wheels.contact.damping, rig, jnp.full(3, 2e4))

    def peak(scale):
        moved = eqx.tree_at(lambda r: r.wheels.roundness, rig, scale * rig.wheels.roundness)
        return LongRun(moved, 0.1 * speeds, jnp.zeros(3), "coupled").supremum("dR")

    value = jax.jit(peak)
    difference = (value(1 + 1e-4) - value(1 - 1e-4)) / 2e-4
    assert np.isclose(jax.jit(jax.grad(peak))(1.0), difference, rtol=1e-5)
