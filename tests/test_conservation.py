"""Total momentum and energy: what internal forces must not change."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from machines import ORTHOGONAL, machine

from omnijax import laws
from omnijax.simulation import simulate, speeds, table, torques

TS = jnp.linspace(0.0, 0.5, 251)


def _total_momentum(rig, run):
    """M_s V_s + sum of wheel momenta + M_l V_l from the run's channels, N s."""
    wheels, normal = rig.wheels, rig.wheels.normal
    platform = run.V_l
    sphere = rig.sphere.mass * (platform + run.dR_rate)
    wheel = wheels.mass[:, None] * (platform[:, None, :] + run.mount_rate[..., None] * normal)
    return sphere + jnp.sum(wheel, axis=1) + rig.platform.mass * platform


def test_total_momentum_follows_the_external_force():
    force = table([0.0, 0.2, 0.2, 0.4], [[1.0, 2.0, -3.0], [3.0, 0.0, 1.0], [0, 0, 0], [0, 0, 0]])
    rig = machine().add(laws.ContactCubic(jnp.asarray(1e12)), "all")
    rig = rig.add(laws.MountBacklash(jnp.asarray(2e-6)), "w2")
    rig = rig.add(laws.RollingResistance(jnp.asarray(1e-3)), "all")
    rig = rig.add(laws.LiftOff(), "all")
    drive = torques([0.05, -0.1, 0.2], force)
    run = eqx.filter_jit(simulate)(rig, drive, TS, solver="dopri8")  # keeps linear invariants
    gained = np.array([force.integral(t) - force.integral(0.0) for t in TS])
    np.testing.assert_allclose(_total_momentum(rig, run), gained, atol=1e-11)


def test_total_momentum_under_prescribed_speeds():
    rig = machine()
    run = eqx.filter_jit(simulate)(rig, speeds([2.0, -1.2, 0.3]), TS)
    assert float(jnp.max(jnp.abs(run.drive_force))) > 1e-3  # the drive forces do act
    np.testing.assert_allclose(_total_momentum(rig, run), 0.0, atol=1e-11)


def _energy(rig, run):
    """Kinetic energy of translation and elastic energy, J."""
    wheels, normal = rig.wheels, rig.wheels.normal
    axial = run.V_l @ normal.T + run.mount_rate
    across = run.V_l[:, None, :] - (run.V_l @ normal.T)[..., None] * normal
    kinetic = rig.sphere.mass * jnp.sum((run.V_l + run.dR_rate) ** 2, axis=1)
    kinetic += rig.platform.mass * jnp.sum(run.V_l**2, axis=1)
    kinetic += jnp.sum(wheels.mass * (axial**2 + jnp.sum(across**2, axis=-1)), axis=1)
    elastic = wheels.contact.stiffness * run.deflection**2
    elastic += wheels.mount.stiffness * run.mount_deflection**2
    elastic += wheels.closure.stiffness * (run.dR @ normal.T) ** 2
    return (kinetic + jnp.sum(elastic, axis=1)) / 2


def test_energy_is_constant_without_damping():
    rig = machine(contact_damping=0.0, mount_damping=0.0, roundness=0.0)
    push = table([0.0, 0.02, 0.02], [[9.0, -4.0, 5.0], [9.0, -4.0, 5.0], [0.0, 0.0, 0.0]])
    run = eqx.filter_jit(simulate)(rig, torques([0.0] * 3, push), TS, rtol=1e-10)
    energy = np.asarray(_energy(rig, run))[TS > 0.021]
    assert energy[0] > 1e-4
    np.testing.assert_allclose(energy / energy[0], 1.0, atol=1e-7)


def test_damping_takes_energy():
    """The energy test can fail: with dampers the same figure falls."""
    rig = machine(ORTHOGONAL, roundness=0.0)
    push = table([0.0, 0.02, 0.02], [[9.0, -4.0, 5.0], [9.0, -4.0, 5.0], [0.0, 0.0, 0.0]])
    run = eqx.filter_jit(simulate)(rig, torques([0.0] * 3, push), TS)
    vibration = np.asarray(jnp.sum(run.dR_rate**2, axis=1))
    assert vibration[-20:].max() < 0.5 * vibration[11:31].max()
