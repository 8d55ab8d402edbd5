"""Gradients through adaptive solves: forward, reverse, differences agree; each lane has its own."""

import diffrax as dfx
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from machines import ORTHOGONAL, machine

from omnijax.simulation import simulate, speeds, torques

pytestmark = [pytest.mark.long, pytest.mark.brief]

TS = jnp.linspace(0, 0.06, 13)
BASE = machine(ORTHOGONAL)
TORQUE = torques([0.2, 0.5, -0.3], (0.1, 0.2, 0.3), initial_velocity=(0.2, -0.3, 0.1))
SPEED = speeds([0.7, 5.2, 2.3])  # forces jump where a gap begins: its edge moves with the roundness


def four(rig):
    """Roundness, contact and mount stiffness, contact damping of all wheels."""
    wheels = rig.wheels
    contact, mount = wheels.contact, wheels.mount
    return wheels.roundness, contact.stiffness, mount.stiffness, contact.damping


def changed(factors):
    """The rig with the four times `factors`."""
    new = tuple(f * value for f, value in zip(factors, four(BASE), strict=True))
    return eqx.tree_at(four, BASE, new)


def deflection(rig, drive, adjoint=None, rtol=1e-9):
    """RMS of |dR| in units of 0.1 mm."""
    run = simulate(rig, drive, TS, adjoint=adjoint, rtol=rtol, solver="exponential")
    return 1e4 * jnp.sqrt(jnp.mean(run.distance**2))


# one program for all rigs and drives of a kind: it has every number's slope
backward = eqx.filter_jit(eqx.filter_value_and_grad(deflection))


@pytest.mark.full
@pytest.mark.parametrize("drive", [TORQUE, SPEED], ids=["torque", "speed"])
def test_forward_reverse_and_differences_agree(drive):
    at = jnp.array([1.0, 1.1, 0.9, 1.2])
    along = jax.jit(jax.jacfwd(lambda p: deflection(changed(p), drive, dfx.ForwardMode())))
    forward, (_, slopes) = along(at), backward(changed(at), drive)
    own = [jnp.sum(slope * x) for slope, x in zip(four(slopes), four(BASE), strict=True)]
    np.testing.assert_allclose(forward, own, rtol=1e-9, atol=1e-12)
    # central differences: truncation about step^2, rounding and tolerance about 1e-11/step
    step = 2e-4
    for i in range(4):
        high, low = (backward(changed(at.at[i].add(h)), drive)[0] for h in (step, -step))
        difference = (high - low) / (2 * step)
        np.testing.assert_allclose(forward[i], difference, rtol=2e-6, atol=1e-6)


@pytest.mark.full
def test_each_lane_has_its_own_first_and_second_derivatives():
    """Lanes take different numbers of steps; a lane's derivatives are those of its own solve."""

    def value(factor):
        factors = jnp.stack([factor, jnp.ones(()), jnp.ones(()), 1 + 200 * (factor - 0.8)])
        return deflection(changed(factors), TORQUE, dfx.ForwardMode())

    def both(factor):
        return jax.jvp(jax.jacfwd(value), (factor,), (jnp.ones(()),))

    several = jax.jit(jax.vmap(both))

    def alone(lane):
        """Of one lane's steps: all lanes are that one, in the same program."""
        slopes, bends = several(jnp.full(3, lane))
        assert np.ptp(slopes) == np.ptp(bends) == 0.0
        return slopes[0], bends[0]

    lanes = jnp.array([0.8, 0.95, 1.1])  # contact damping from 120 to 7000 N s/m
    together = several(lanes)
    for lane, slope, bend in zip(lanes, *together, strict=True):
        np.testing.assert_allclose(slope, alone(lane)[0], rtol=1e-8)
        np.testing.assert_allclose(bend, alone(lane)[1], rtol=1e-6)
    step = 1e-4
    difference = (alone(lanes[1] + step)[0] - alone(lanes[1] - step)[0]) / (2 * step)
    np.testing.assert_allclose(together[1][1], difference, rtol=1e-4)


@pytest.mark.full
def test_gradients_stay_finite_on_an_edge_and_at_critical_damping():
    """The run starts on a gap's edge and at rest; a mode of the rig is critically damped."""
    wheels = BASE.wheels
    reduced = 1 / (1 / wheels.mass + 1 / BASE.sphere.mass)
    critical = 2 * jnp.sqrt(wheels.contact.stiffness * reduced)
    rig = eqx.tree_at(lambda r: r.wheels.contact.damping, BASE, critical)
    _, slopes = backward(rig, torques([0.2, 0.5, -0.3], initial_velocity=(0.0, 0.0, 0.0)))
    leaves = jax.tree.leaves(slopes)
    assert len(leaves) > 10
    assert all(bool(jnp.all(jnp.isfinite(leaf))) for leaf in leaves)
    assert float(jnp.max(jnp.abs(slopes.wheels.roundness))) > 0
