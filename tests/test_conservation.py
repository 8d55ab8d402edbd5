"""Total momentum and energy: what internal forces must not change."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from machines import SKEW, machine
from scipy.interpolate import CubicSpline
from seeds import drawn_anew

from omnijax import laws
from omnijax.simulation import simulate, speeds, table, torques

pytestmark = pytest.mark.brief

TS = jnp.linspace(0.0, 0.5, 1001)


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
    ts = TS[:501]  # past a jump of the force
    run = eqx.filter_jit(simulate)(rig, drive, ts, solver="dopri8")  # keeps linear invariants
    gained = jax.vmap(force.integral)(ts) - force.integral(0.0)
    np.testing.assert_allclose(_total_momentum(rig, run), gained, atol=1e-11)


@pytest.mark.full  # in the gate under torques and a force, above
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


PUSH = table([0.0, 0.02, 0.02], [[9.0, -4.0, 5.0], [9.0, -4.0, 5.0], [0.0, 0.0, 0.0]])


@eqx.filter_jit
def _shaken(rig):
    return simulate(rig, torques([0.0] * 3, PUSH), TS, rtol=1e-10)


def _dissipated(rig, run):
    """Work that the dampers took from the start of the run to each sample, J."""
    contact = rig.wheels.contact.damping * run.deflection_rate**2
    mount = rig.wheels.mount.damping * run.mount_rate**2
    power = np.asarray(jnp.sum(contact + mount, axis=1))
    return CubicSpline(TS, power).antiderivative()(TS)


@pytest.mark.full  # in the gate momentum, above, and a separate program: test_reference
def test_energy_is_constant_without_damping_and_falls_by_the_dampers_work_with_them():
    """The same figure twice, on a rig drawn anew: it stays, or it goes where the dampers say."""
    rng = drawn_anew("energy")
    normal = np.array(SKEW[0]) + rng.uniform(-0.1, 0.1, (3, 3))
    drive = np.cross(normal, rng.normal(size=(3, 3)))
    layout = [x / np.linalg.norm(x, axis=1, keepdims=True) for x in (normal, drive)]
    late = TS > 0.021
    for damped in (0.0, rng.uniform(1.0, 4.0)):
        rig = machine(
            layout, roundness=0.0, contact_damping=10.0 * damped, mount_damping=5.0 * damped
        )
        run = _shaken(rig)
        energy = np.asarray(_energy(rig, run))[late]
        assert energy[0] > 1e-4
        if not damped:
            np.testing.assert_allclose(energy / energy[0], 1.0, atol=1e-7)
            continue
        taken, lost = _dissipated(rig, run)[late], energy[0] - energy
        assert lost[-1] > 1e4 * 1e-7 * energy[0]  # what is left drifts along, undamped
        np.testing.assert_allclose(lost, taken - taken[0], atol=1e-2 * lost[-1])
