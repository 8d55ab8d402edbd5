"""The printed forms, the matrices, contacts on two rows, forces without slip, attitudes."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from machines import SKEW, machine
from moment_cases import PARTS, shapes
from moments import near, rotation, slope

from omnijax import laws
from omnijax.dynamics import (
    Coupled,
    ElasticState,
    Paper,
    Pointwise,
    PortInputs,
    external_force,
    linear_system,
    minimum_normal_force,
    pointwise_shape_acceleration,
    quaternion_of,
    quaternion_product,
    rotation_matrix,
    spin_axes,
)


def check_paper(n=3):
    """Eqs. 41-42 contact by contact: no reaction on the platform, which moves as P/M_T + floor."""
    rng = np.random.default_rng(5)
    rig = machine(SKEW, **PARTS)
    w, Ms = rig.wheels, float(rig.sphere.mass)
    x, mount, rho = 1e-4 * rng.normal(size=(3, n))
    x_rate, mount_rate, contact_law, mount_law, drive = rng.normal(size=(5, n))
    force, floor = rng.normal(size=(2, 3))
    C = np.asarray(w.contact.damping)
    state = ElasticState(
        *(jnp.asarray(y) for y in (x, mount, Ms * x_rate - C * rho, w.mass * mount_rate + C * rho))
    )
    ports = PortInputs(*map(jnp.asarray, (rho, contact_law, mount_law, drive, force, floor)))
    rate = Paper(rig).rate(state, ports)
    tension = w.contact.stiffness * (x - mount - rho) + C * (x_rate - mount_rate) + contact_law
    held = w.mount.stiffness * mount + w.mount.damping * mount_rate + mount_law
    platform = force / float(rig.total_mass) + floor
    near(rate.approach, x_rate)
    near(rate.mount, mount_rate)
    across = np.asarray(w.normal) @ platform
    near(rate.momentum, -tension - w.closure.stiffness * x - Ms * across)
    near(rate.wheel_momentum, tension - held)
    near(Paper(rig).platform_acceleration(state, ports), platform)
    near(Paper(rig).motion(state, ports.shape).displacement, x @ np.asarray(w.normal))


def check_linear_system():
    """The matrices give the rates and outputs of the formulas that they are read off."""
    rig, rng = machine(SKEW, **PARTS), np.random.default_rng(6)
    coupled = Coupled(rig)
    y, u = rng.normal(size=12), rng.normal(size=18)
    system = linear_system(coupled)
    near(system.A @ y + system.B @ u, by_formula(coupled, y, u))


def by_formula(coupled, y, u):
    state = ElasticState(*(jnp.asarray(part) for part in np.split(y, [3, 6, 9])))
    inputs = PortInputs(*(jnp.asarray(part) for part in np.split(u, [3, 6, 9, 12, 15])))
    return np.concatenate(list(coupled.rate(state, inputs)))


def check_pointwise():
    """Eqs. 41-42 as printed, with r_w'' as an input and either sign of the closure."""
    rig, rng = machine(SKEW), np.random.default_rng(7)
    w, Ms = rig.wheels, float(rig.sphere.mass)
    state, shape = rng.normal(size=(4, 3)), rng.normal(size=3)
    d, D, d_rate, D_rate = state
    for sign in (1, -1):
        tension = w.contact.stiffness * d + w.contact.damping * d_rate
        wheel = (tension - w.mount.stiffness * D - w.mount.damping * D_rate) / w.mass
        sphere = -(tension + sign * w.closure.stiffness * (d + D)) / Ms - shape
        found = Pointwise(rig, sign).rate(jnp.asarray(state), jnp.asarray(shape))
        near(found, np.stack([d_rate, D_rate, sphere - wheel, wheel]))
    angle, speed = jnp.array([0.05, 0.06, 0.04]), jnp.array([2.0, -1.0, 3.0])
    rho = shapes(rig, False)[0]
    bend = slope(lambda t: slope(lambda s: rho(angle + s), t, 1e-4), 0.0, 1e-4)
    near(pointwise_shape_acceleration(rig, angle, speed), bend * speed**2, 1e-5)


def check_dual_row():
    """A contact on one row: the arm turns by asin(s/R) about `drive`, the axis with it."""
    rig = machine(SKEW, profile=laws.DualRow(jnp.asarray(0.3)))
    r, v, R = np.asarray(rig.wheels.normal), np.asarray(rig.wheels.drive), 1.22
    angle = jnp.array([0.0, 0.25, 0.1])
    axle = -np.cross(r, v)
    lateral = [
        float(p.lateral(angle[i], jax.tree.map(lambda x, i=i: x[i], rig.gaps)))
        for i, p in enumerate(rig.profiles)
    ]
    sine = np.array(lateral)[:, None] / R
    assert len({round(x, 6) for x in lateral}) == 2
    arm = -np.sqrt(1 - sine**2) * r + sine * axle
    near(spin_axes(rig, angle), np.cross(arm, v))


def check_external_force():
    """Eq. 45 as rederived in section 5 of the specification."""
    rng = np.random.default_rng(8)
    rig = machine(SKEW, friction=[0.9, 0.7, 0.5])
    w, Ms, Mt = rig.wheels, float(rig.sphere.mass), float(rig.total_mass)
    f, P = rng.normal(size=(2, 3))
    v, back, mu = np.asarray(w.drive).T, -np.asarray(w.normal).T, np.asarray(w.contact.friction)
    expected = Ms * P / Mt - (v - back @ np.diag(1 / mu)) @ f
    given = (f, P, w.normal, w.drive, w.contact.friction, Ms, Mt)
    near(external_force(*given), expected)
    near(external_force(*given, outside=True), Mt / (Mt - Ms) * expected)
    near(minimum_normal_force(f, w.contact.friction), np.abs(f) / mu)


def check_rotation_matrix():
    """A quaternion of any length, not of one axis: q e q* of the body's axes."""
    q = np.array([0.5, -0.1, 0.7, 0.5])
    near(rotation_matrix(jnp.asarray(3 * q)), rotation(q))
    product = quaternion_product(jnp.array([1.0, 2.0, 3.0, 4.0]), jnp.array([5.0, 6.0, 7.0, 8.0]))
    near(product, np.array([-60.0, 12.0, 30.0, 24.0]))  # Hamilton's rule by hand
    turn = np.array([0.4, -0.8, 0.8])  # 1.2 rad about (1, -2, 2)/3
    by_hand = np.array([np.cos(0.6), *(np.sin(0.6) * np.array([1.0, -2.0, 2.0]) / 3)])
    near(quaternion_of(jnp.asarray(turn)), by_hand)
    near(quaternion_of(jnp.zeros(3)), np.array([1.0, 0.0, 0.0, 0.0]))


CHECKS = {
    "rotation": check_rotation_matrix,
    "paper": check_paper,
    "linear system": check_linear_system,
    "pointwise": check_pointwise,
    "dual row": check_dual_row,
    "external force": check_external_force,
}


@pytest.mark.parametrize("name", list(CHECKS))
def test_form(name):
    CHECKS[name]()
