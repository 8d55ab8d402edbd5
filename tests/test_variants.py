"""`paper` against `coupled` where they must agree, and where they must not; gap-edge impulses."""

import diffrax as dfx
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from machines import ORTHOGONAL, SKEW, machine

from omnijax.dynamics import Coupled, Paper, PortInputs, flatten, linear_system, unflatten
from omnijax.simulation import simulate, speeds

pytestmark = pytest.mark.brief

TS = jnp.linspace(0.0, 0.5, 126)
SPEEDS = [2.1, -1.2, 0.7]


def _dR(rig, model):
    return eqx.filter_jit(simulate)(rig, speeds(SPEEDS), TS, model=model).dR


@pytest.mark.full  # in the gate their responses, below
def test_paper_equals_coupled_for_orthonormal_wheels_on_a_heavy_platform():
    """No platform reaction, no wheel inertia in its frame, no drive force: one model."""
    rig = machine(ORTHOGONAL, platform_mass=1e9, sphere_inertia=1e-9)
    coupled, paper = _dR(rig, "coupled"), _dR(rig, "paper")
    np.testing.assert_allclose(paper, coupled, rtol=0, atol=1e-6 * float(jnp.max(jnp.abs(coupled))))


@pytest.mark.full  # in the gate their responses, below
def test_paper_differs_from_coupled_elsewhere():
    for rig in (machine(SKEW, platform_mass=1e9, sphere_inertia=1e-9), machine(ORTHOGONAL)):
        coupled, paper = _dR(rig, "coupled"), _dR(rig, "paper")
        assert float(jnp.max(jnp.abs(paper - coupled)) / jnp.max(jnp.abs(coupled))) > 1e-3


def test_their_responses_are_one_for_orthonormal_wheels_on_a_heavy_platform():
    """Of the displacement to the shape, at speeds beside and among the natural frequencies."""
    heavy = {"platform_mass": 1e9, "sphere_inertia": 1e-9}
    for rig, alike in (
        (machine(ORTHOGONAL, **heavy), True),
        (machine(SKEW, **heavy), False),
        (machine(ORTHOGONAL), False),
    ):
        coupled, paper = (np.asarray(_responses(model(rig))) for model in (Coupled, Paper))
        off = np.abs(paper - coupled).max() / np.abs(coupled).max()
        assert off < 1e-6 if alike else off > 1e-3


def _responses(translation):
    """From the shape to the displacement at frequencies from 3 to 3000 rad/s, (f, 3, n)."""
    system = linear_system(translation)
    A, B, C = (
        np.asarray(x) for x in (system.A, system.into("shape"), system.row("displacement")[0])
    )
    at = 1j * np.geomspace(3.0, 3e3, 40)[:, None, None] * np.eye(len(A))
    return C @ np.linalg.solve(at - A, np.broadcast_to(B, (40, *B.shape)))


def test_linear_system_is_the_translation():
    """Matrices against the formulas at a random state; orthonormal wheels decouple in `paper`."""
    key = np.random.default_rng(7)
    for translation in (Coupled(machine()), Paper(machine())):
        system = linear_system(translation)
        y, u = key.normal(size=system.A.shape[0]), key.normal(size=system.B.shape[1])
        state = unflatten(translation.rest(), jnp.asarray(y))
        inputs = unflatten(PortInputs.zeros(3), jnp.asarray(u))
        rate = flatten(translation.rate(state, inputs))
        np.testing.assert_allclose(system.A @ y + system.B @ u, rate, rtol=1e-10)
        motion = translation.motion(state, inputs.shape)
        rows, through = system.row("deflection")
        np.testing.assert_allclose(rows @ y + through @ u, motion.deflection, rtol=1e-10)
    stiff = np.asarray(linear_system(Paper(machine())).A).reshape(4, 3, 4, 3)
    off = stiff.transpose(1, 3, 0, 2)[~np.eye(3, dtype=bool)]
    assert np.all(off == 0)


@pytest.mark.full  # in the gate every channel of a separate program: test_reference
def test_deflection_rate_jumps_at_a_gap_edge():
    """r_w'' holds an impulse there; it is carried without evaluating r_w''.

    The contact's damper then pulls both bodies with C times that jump.
    """
    damping, speed, h = 8500.0, 1.3, 2e-6
    rig = machine(ORTHOGONAL, contact_damping=damping, scale=0.0)
    gap = jax.tree.map(lambda x: x[0], rig.gaps)
    jump = -2 * np.pi / float(gap.width) * float(gap.depth) * speed  # of the shape's rate, m/s
    drive = speeds([speed, 0.0, 0.0], initial_angle=[-0.02 * speed, 0.0, 0.0])
    ts = jnp.array([0.0, 0.02 - h, 0.02 - 1e-9, 0.02 + 1e-9, 0.02 + h])
    run = eqx.filter_jit(simulate)(rig, drive, ts, model="paper", rtol=1e-10)
    rate = run.deflection_rate[:, 0]
    assert float(rate[3] - rate[2]) == pytest.approx(-jump, rel=1e-3)
    assert abs(float(rate[2] - rate[1])) < 1e-6 * abs(jump)
    sphere = float(run.dR_rate[4, 0] - run.dR_rate[3, 0]) / h
    assert sphere == pytest.approx(damping * jump / float(rig.sphere.mass), rel=0.05)
    wheel = float(run.mount_rate[4, 0] - run.mount_rate[3, 0]) / h
    assert wheel == pytest.approx(-damping * jump / float(rig.wheels.mass[0]), rel=0.1)


@pytest.mark.full  # in the gate: test_gradients
def test_gradient_with_respect_to_roundness_at_round_wheels():
    """eta -> 0: the depth is quadratic in eta, so value and gradient vanish without a 0/0."""

    def energy(eta):
        rig = eqx.tree_at(lambda r: r.wheels.roundness, machine(), eta * jnp.ones(3))
        forward = dfx.ForwardMode()
        run = simulate(rig, speeds(SPEEDS), TS[:30], solver="dopri8", adjoint=forward)
        return jnp.sum(run.dR**2)

    both = jax.jit(lambda eta: jax.jvp(energy, (eta,), (1.0,)))
    for eta in (0.0, 1e-3):
        value, slope = both(eta)
        assert np.isfinite(value) and np.isfinite(slope)
        assert (slope == 0) == (eta == 0.0)
