"""Gradients through adaptive solves: forward, reverse, differences agree; each lane has its own."""

import diffrax as dfx
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from machines import ORTHOGONAL, machine
from tiers import tiered

from omnijax.simulation import simulate, speeds, torques

TS = jnp.linspace(0, 0.06, 13)
BASE = machine(ORTHOGONAL)
TORQUE = torques([0.2, 0.5, -0.3], (0.1, 0.2, 0.3), initial_velocity=(0.2, -0.3, 0.1))
SPEED = speeds([0.7, 5.2, 2.3])  # forces jump where a gap begins: its edge moves with the roundness


def changed(factors):
    """The rig with roundness, contact and mount stiffness and contact damping times `factors`."""

    def where(rig):
        wheels = rig.wheels
        contact, mount = wheels.contact, wheels.mount
        return wheels.roundness, contact.stiffness, mount.stiffness, contact.damping

    new = tuple(f * value for f, value in zip(factors, where(BASE), strict=True))
    return eqx.tree_at(where, BASE, new)


def deflection(factors, drive, adjoint=None, rtol=1e-9):
    """RMS of |dR| in units of 0.1 mm."""
    run = simulate(changed(factors), drive, TS, adjoint=adjoint, rtol=rtol, solver="exponential")
    return 1e4 * jnp.sqrt(jnp.mean(run.distance**2))


@pytest.mark.parametrize(
    "drive", tiered([TORQUE, SPEED], lambda drive: drive is SPEED), ids=["torque", "speed"]
)
def test_forward_reverse_and_differences_agree(drive):
    at = jnp.array([1.0, 1.1, 0.9, 1.2])
    forward = jax.jit(jax.jacfwd(lambda p: deflection(p, drive, dfx.ForwardMode())))(at)
    both = jax.jit(jax.value_and_grad(lambda p: deflection(p, drive)))
    np.testing.assert_allclose(forward, both(at)[1], rtol=1e-9, atol=1e-12)
    # central differences: truncation about step^2, rounding and tolerance about 1e-11/step
    step = 2e-4
    for i in range(4):
        high, low = both(at.at[i].add(step))[0], both(at.at[i].add(-step))[0]
        difference = (high - low) / (2 * step)
        np.testing.assert_allclose(forward[i], difference, rtol=2e-6, atol=1e-6)


def test_each_lane_has_its_own_first_and_second_derivatives():
    """Lanes take different numbers of steps; a lane's derivatives are those of its own solve."""

    def value(factor):
        factors = jnp.stack([factor, jnp.ones(()), jnp.ones(()), 1 + 200 * (factor - 0.8)])
        return deflection(factors, TORQUE, dfx.ForwardMode())

    def both(factor):
        return jax.jvp(jax.jacfwd(value), (factor,), (jnp.ones(()),))

    alone = jax.jit(both)
    lanes = jnp.array([0.8, 0.95, 1.1])  # contact damping from 120 to 7000 N s/m
    together = jax.jit(jax.vmap(both))(lanes)
    for lane, slope, bend in zip(lanes, *together, strict=True):
        np.testing.assert_allclose(slope, alone(lane)[0], rtol=1e-8)
        np.testing.assert_allclose(bend, alone(lane)[1], rtol=1e-6)
    step = 1e-4
    difference = (alone(lanes[1] + step)[0] - alone(lanes[1] - step)[0]) / (2 * step)
    np.testing.assert_allclose(together[1][1], difference, rtol=1e-4)


def test_gradients_stay_finite_on_an_edge_and_at_critical_damping():
    """The run starts on a gap's edge and at rest; a mode of the rig is critically damped."""
    wheels = BASE.wheels
    reduced = 1 / (1 / wheels.mass + 1 / BASE.sphere.mass)
    critical = 2 * jnp.sqrt(wheels.contact.stiffness * reduced)
    rig = eqx.tree_at(lambda r: r.wheels.contact.damping, BASE, critical)

    def value(rig):
        run = simulate(rig, torques([0.2, 0.5, -0.3]), TS, rtol=1e-7)
        return 1e4 * jnp.max(run.distance)

    numbers, rest = eqx.partition(rig, eqx.is_inexact_array)
    gradient = jax.jit(jax.grad(lambda x: value(eqx.combine(x, rest))))(numbers)
    leaves = jax.tree.leaves(gradient)
    assert len(leaves) > 10
    assert all(bool(jnp.all(jnp.isfinite(leaf))) for leaf in leaves)
    assert float(jnp.max(jnp.abs(gradient.wheels.roundness))) > 0
