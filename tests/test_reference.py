"""Noise-free trajectories of a separate program, every channel."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from references import reference
from tiers import tiered

from omnijax.simulation import simulate, table, torques

pytestmark = pytest.mark.brief


# of the former, whose plant is the simpler, in the gate: test_plant
@pytest.mark.parametrize("name", tiered(["ref-1", "ref-2"], "ref-1".__eq__))
def test_agrees_with_a_separate_program(name):
    rig, t, torque, force, expected = ref = reference(name)
    drive = torques(table(t, torque), table(t, force), ref.angles)
    run = eqx.filter_jit(simulate)(rig, drive, jnp.asarray(t))
    assert run.ok
    outputs = {f"theta_{i + 1}": run.theta[:, i] for i in range(3)}
    for group in ("Omega", "dR", "a"):
        outputs |= {f"{group}_{a}": getattr(run, group)[:, i] for i, a in enumerate("xyz")}
    assert outputs.keys() == expected.keys()
    worst = {
        key: float(np.max(np.abs(value - expected[key])) / np.ptp(expected[key]))
        for key, value in outputs.items()
    }
    assert max(worst.values()) < 1e-4, worst
    assert float(jnp.min(run.normal_force)) > 0
