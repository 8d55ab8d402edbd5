"""Round wheels: closed forms of the ideal case, eq. 46, and a free gyroscopic body."""

import functools

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from machines import ORTHOGONAL, machine
from scipy.integrate import solve_ivp

from omnijax.dynamics import drive_forces, external_force, minimum_normal_force, rotation_matrix
from omnijax.simulation import simulate, torques

pytestmark = pytest.mark.brief

TS = jnp.linspace(0.0, 2.0, 101)
TORQUE = jnp.array([0.1, 0.2, 0.3])


@functools.cache
def _ideal():
    rig = machine(ORTHOGONAL, roundness=0.0, scale=0.0)
    run = eqx.filter_jit(simulate)(rig, torques(TORQUE, (0.1, 0.2, 0.3)), TS)
    return rig, run


@pytest.mark.full  # in the gate a separate program: test_reference
def test_sphere_velocity_is_linear_in_time():
    rig, run = _ideal()
    r, R = rig.wheels.radius[0], rig.sphere.radius
    inertia = rig.sphere.inertia / R**2 + rig.wheels.inertia[0] / r**2
    turning = jnp.linalg.inv(rig.wheels.spin_axis) @ (TORQUE / r / R / inertia)
    np.testing.assert_allclose(run.Omega, TS[:, None] * turning, atol=1e-10)
    angle = 0.5 * jnp.linalg.norm(turning) * TS**2
    axis = turning / jnp.linalg.norm(turning)
    expected = jnp.concatenate([jnp.cos(angle / 2)[:, None], jnp.sin(angle / 2)[:, None] * axis], 1)
    np.testing.assert_allclose(run.attitude, expected, atol=1e-8)


@pytest.mark.full  # in the gate a separate program: test_reference
def test_quaternion_norm_is_kept():
    _, run = _ideal()
    np.testing.assert_allclose(jnp.linalg.norm(run.attitude, axis=1), 1.0, atol=1e-14)


@pytest.mark.full  # in the gate the momentum under a force: test_conservation
def test_centre_of_mass_moves_on_a_parabola():
    rig, run = _ideal()
    wheels = rig.wheels
    offset = rig.sphere.mass * run.dR + (run.mount_deflection * wheels.mass) @ wheels.normal
    centre = run.R_l + offset / rig.total_mass
    expected = 0.5 * TS[:, None] ** 2 * jnp.array([0.1, 0.2, 0.3]) / rig.total_mass
    np.testing.assert_allclose(centre, expected, atol=1e-9)


@pytest.mark.full  # in the gate propagated: test_propagation
def test_round_wheels_do_not_shake_the_sphere():
    rig = machine(roundness=0.0)
    run = eqx.filter_jit(simulate)(rig, torques([0.0] * 3), TS)
    assert float(jnp.max(jnp.abs(run.dR))) == 0.0
    assert float(jnp.max(jnp.abs(run.shape))) == 0.0


def _whole_system(axes, radius, R, wheel_inertia, inertia, torque, opposing):
    """f, domega/dt, dOmega/dt from eqs. 39, 40, 43 side by side, nothing eliminated."""
    n = len(radius)
    zero = np.zeros
    rows = [
        np.hstack([np.diag(radius), np.diag(wheel_inertia), zero((n, 3))]),
        np.hstack([-R * axes.T, zero((3, n)), inertia]),
        np.hstack([zero((n, n)), -np.diag(radius), R * axes]),
    ]
    right = np.concatenate([torque, -opposing, zero(n)])
    return np.linalg.solve(np.vstack(rows), right)[:n]


def test_drive_forces_solve_the_whole_system():
    key = np.random.default_rng(3)
    for n in (3, 4):
        axes = key.normal(size=(n, 3))
        root = key.normal(size=(3, 3))
        inertia = root @ root.T + np.eye(3)
        args = (0.07 + 0.01 * key.random(n), 1.22, 1e-3 * (1 + key.random(n)))
        torque, opposing = key.normal(size=n), key.normal(size=3)
        f = drive_forces(axes, args[0], 1.22, args[2], inertia, torque, opposing)
        expected = _whole_system(axes, args[0], 1.22, args[2], inertia, torque, opposing)
        np.testing.assert_allclose(f, expected, rtol=1e-10)


def test_equation_46_without_resistance():
    """Eq. 46 with [axes]^T I^-1 [axes]: normal forces for f = mu N; eq. 45's force balance."""
    rig = machine(roundness=0.0, sphere_inertia=jnp.diag(jnp.array([4.0, 5.0, 6.5])))
    wheels, R = rig.wheels, rig.sphere.radius
    axes, r = wheels.spin_axis, wheels.radius
    inverse = jnp.linalg.inv(rig.sphere.inertia_matrix)
    f = drive_forces(axes, r, R, wheels.inertia, rig.sphere.inertia_matrix, TORQUE, jnp.zeros(3))
    matrix = R**2 * axes @ inverse @ axes.T + jnp.diag(r**2 / wheels.inertia)
    mu = wheels.contact.friction
    normal = jnp.linalg.solve(matrix * mu, r / wheels.inertia * TORQUE)
    np.testing.assert_allclose(minimum_normal_force(f, mu), jnp.abs(normal), rtol=1e-12)
    P = jnp.array([0.3, -0.2, 0.4])
    masses = (rig.sphere.mass, rig.total_mass)
    own = external_force(f, P, wheels.normal, wheels.drive, mu, *masses)
    # the sphere accelerates with the platform: contacts at mu N = f, drives and closure together
    contact = wheels.normal.T @ (f / mu) + wheels.drive.T @ f + own
    np.testing.assert_allclose(contact, rig.sphere.mass / rig.total_mass * P, atol=1e-12)
    outside = external_force(f, P, wheels.normal, wheels.drive, mu, *masses, outside=True)
    internal = wheels.normal.T @ (f / mu) + wheels.drive.T @ f
    sphere = (internal + outside) / rig.sphere.mass
    platform = (P - internal) / (rig.total_mass - rig.sphere.mass)
    np.testing.assert_allclose(sphere, platform, atol=1e-12)


@pytest.mark.full  # in the gate the rotation: test_moment, and a separate program: test_reference
def test_free_gyroscopic_body():
    """Weightless wheels leave the sphere free: Euler's equations by an independent integrator."""
    inertia = jnp.array([[4.0, 0.3, 0.1], [0.3, 5.0, -0.2], [0.1, -0.2, 6.5]])
    rig = machine(roundness=0.0, sphere_inertia=inertia, inertia=1e-13)
    start = jnp.array([0.4, 3.0, 0.2])
    drive = torques([0.0] * 3, initial_velocity=start)
    run = eqx.filter_jit(simulate)(rig, drive, TS, rtol=1e-10)
    body = np.asarray(inertia)

    def euler(_, w):
        return np.linalg.solve(body, np.cross(body @ w, w))

    free = solve_ivp(euler, (0, 2), start, "DOP853", TS, rtol=1e-12, atol=1e-13).y.T
    in_body = jax.vmap(lambda q, w: rotation_matrix(q).T @ w)(run.attitude, run.Omega)
    np.testing.assert_allclose(in_body, free, atol=2e-8)
    momentum = jax.vmap(lambda q, w: rotation_matrix(q) @ inertia @ w)(run.attitude, in_body)
    np.testing.assert_allclose(momentum, jnp.broadcast_to(momentum[0], momentum.shape), atol=2e-7)
