"""Laws at contacts and mounts stepped in time by the diagnosis, and what its short cuts leave."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from seeds import drawn_anew

from omnijax.diagnosis._machine._elastic.elastic import OUTPUTS, rig_modes, signal_names
from omnijax.diagnosis._machine._elastic.stepped import Lane, law_changes, stepped_ports
from omnijax.diagnosis._machine._motion.motion import RunMotion, angles_of
from omnijax.diagnosis._machine._motion.wheels import wheel_tables
from omnijax.diagnosis._machine._rotation.rotation import MeasuredTurning
from omnijax.diagnosis._machine.runs import COARSE, STEPS, Run
from omnijax.dynamics import Rolling, drive_forces, rotation_response, sphere_velocity, wheel_shape
from omnijax.laws import EFFECTS, ContinuousSine, GatedSine, HalfSine, Rollers
from omnijax.rig import load_rig

STEP, SAMPLES = 0.002, 60


@pytest.fixture(scope="module")
def atlas():
    """The bundled rig."""
    return load_rig("atlas")


def add(rig, id, place, **values):
    """The rig with a law."""
    return rig.add(EFFECTS[id](**{k: jnp.asarray(v) for k, v in values.items()}), place)


def lane_of(rig, steps=STEPS):
    """A run of 0.12 s in which every port feels a growing oscillation of its own."""
    modes, time = rig_modes(rig), STEP * np.arange(SAMPLES)
    zero = np.zeros((SAMPLES, 3))
    run = Run("run", "train", time, zero, zero, {}, np.ones(SAMPLES, bool))
    fine = np.linspace(0.0, time[-1], (SAMPLES - 1) * steps + 1)
    count = len(signal_names(stepped_ports(rig))) // 2  # deflections and rates of every port
    phase = 0.3 * np.arange(3 * count).reshape(count, 3)
    wave = 3e-5 * (1 + fine[:, None, None] / 0.1) * np.sin(150 * fine[:, None, None] + phase)
    signals = np.stack([wave, np.gradient(wave, fine, axis=0)], axis=2)
    return Lane(rig, modes, run, signals.reshape(len(fine), -1)), fine


def changes(lanes):
    """What the laws change in dR and a (samples, 6) of every lane."""
    return [change.now for change in law_changes(lanes)]


def integrated(lane, fine, force):
    """dR and a by an adaptive solver, `force(signals)` being the tensions (3 a port)."""
    m, ports = lane.modes, stepped_ports(lane.rig)
    rows = m.out(signal_names(ports))[0]
    B = np.concatenate([m.B[:, m.inputs[p]] for p in ports], axis=1)
    C, D = m.out(OUTPUTS)
    D = np.concatenate([D[:, m.inputs[p]] for p in ports], axis=1)

    def felt(t, d):
        linear = np.array([np.interp(t, fine, s) for s in lane.signals.T])
        return linear + rows @ d

    still = lane.signals[0].reshape(len(ports), 2, -1) * np.array([1.0, 0.0])[:, None]
    d = np.zeros(len(m.A))
    for _ in range(50):  # at rest before the run
        d = -np.linalg.solve(m.A, B @ force(still.ravel() + rows @ d))
    found = solve_ivp(
        lambda t, d: m.A @ d + B @ force(felt(t, d)), (0.0, fine[-1]), d, "DOP853",
        t_eval=lane.run.time, rtol=1e-8, atol=1e-13, max_step=STEP / 4,
    )  # fmt: skip
    out = [C @ d + D @ force(felt(t, d)) for t, d in zip(found.t, found.y.T, strict=True)]
    return np.array(out)


def cubic(k3, x):
    """Tensions of cubic springs at three wheels."""
    return k3 * x**3


@pytest.mark.full  # in the gate: test_machine_contract
def test_stepped_laws_agree_with_an_adaptive_solver_to_second_order(atlas):
    rig = add(add(atlas, "contact-cubic", "all", K3=2e12), "mount-cubic", "w2", k3=1e12)
    error = []
    for steps in (COARSE, STEPS):
        lane, fine = lane_of(rig, steps)
        expected = integrated(
            lane, fine,
            lambda s: np.r_[cubic(2e12, s[:3]), cubic(1e12, s[6:9]) * [0, 1, 0]],
        )  # fmt: skip
        (found,) = changes([lane])
        scale = np.abs(expected).max(axis=0)
        error.append(np.max(np.abs(found - expected) / scale))
    assert error[1] < 5e-4
    assert 3 < error[0] / error[1] < 5  # second order, and the coarse steps are fine for ranking


@pytest.mark.full  # in the gate drawn laws: test_machine_contract
def test_a_dry_friction_that_brakes_within_a_step_agrees_with_an_adaptive_solver(atlas):
    """About rest it damps so strongly that a step's predictor and corrector pass each other."""
    rng = drawn_anew("strong dry friction")
    force, width = rng.uniform(2.5, 4.0), rng.uniform(1e-3, 2e-3)
    rig = add(atlas, "mount-friction", "all", force=force, width=width)
    lane, fine = lane_of(rig)
    expected = integrated(lane, fine, lambda s: force * np.tanh(s[3:] / width))
    (found,) = changes([lane])
    error = np.sqrt(np.mean((found - expected) ** 2, axis=0) / np.mean(expected**2, axis=0))
    assert error.max() < 0.003


def test_a_port_whose_laws_do_nothing_changes_nothing(atlas):
    contact = add(atlas, "contact-cubic", "w1", K3=2e12)
    both = add(contact, "mount-cubic", "all", k3=0.0)
    one, other = lane_of(contact)[0], lane_of(both)[0]
    assert stepped_ports(one.rig) == ("contact",)
    assert stepped_ports(other.rig) == ("contact", "mount")
    other = dataclasses.replace(other, signals=np.hstack([one.signals, 0 * one.signals]))
    (alone,), (beside,) = changes([one]), changes([other])
    assert np.abs(alone).max() > 0
    assert beside == pytest.approx(alone, rel=1e-9, abs=1e-12 * np.abs(alone).max())


def test_lanes_that_share_their_signals_are_stepped_as_alone(atlas):
    lanes = [lane_of(add(atlas, "contact-cubic", "all", K3=k * 1e12))[0] for k in (1.0, 2.0, 3.0)]
    shared = [dataclasses.replace(x, signals=lanes[0].signals) for x in lanes]
    alone = [changes([x])[0] for x in lanes]
    for found in (changes(shared), changes(lanes)):
        assert np.stack(found) == pytest.approx(np.stack(alone), rel=1e-9, abs=1e-15)


def test_places_in_a_wheels_table_are_those_of_a_search(atlas):
    tables = wheel_tables(atlas, -30.0, 50.0)
    theta = np.random.default_rng(0).uniform(-30.0, 50.0, (500, 3))
    theta[:3, 0] = 0.0, 2 * np.pi, np.nan
    turned = np.mod(theta - tables.first, tables.span)
    for k in range(3):
        expected = np.interp(turned[:, k], tables.angle[:, k] - tables.first, tables.shape[:, k])
        assert tables.rho(theta)[:, k] == pytest.approx(expected, abs=1e-12, nan_ok=True)
    rolled = tables.rolled(theta)
    assert rolled[1, 0] - rolled[0, 0] == pytest.approx(tables.length[-1, 0], rel=1e-12)
    assert np.isnan(rolled[2, 0])
    order = np.argsort(theta[3:, 1])
    assert np.all(np.diff(rolled[3:, 1][order]) >= 0)  # no jump from turn to turn


@pytest.mark.parametrize("encoders", [(), (0,), (0, 2)])
def test_a_wheels_table_reaches_as_far_as_wheels_turn_that_have_no_encoder(atlas, encoders):
    """Waves that do not close were looked up turns away, as far as the encoders' range is long."""
    rig, rng = eqx.tree_at(lambda r: r.profiles, atlas, (ContinuousSine(),) * 3), drawn_anew("far")
    time = 2e-3 * np.arange(2000)
    speed = rng.uniform(20.0, 40.0, 3) * np.array([1.0, -1.0, -1.0])  # rad/s
    theta = np.full((len(time), 3), np.nan)
    theta[:, encoders] = (speed * time[:, None])[:, encoders]
    geometry = Rolling(rig.wheel_radius, rig.wheels.spin_axis)
    Omega = np.asarray(sphere_velocity(rig, geometry, jnp.asarray(speed)))
    outputs = {"theta": theta, "Omega": np.tile(Omega, (len(time), 1))}
    zero = np.zeros((len(time), 3))
    run = Run("run", "train", time, zero, zero, outputs, np.ones(len(time), bool))
    low, high = angles_of(rig, [run])
    further = np.where(
        np.isin(range(3), encoders), 1.0, 1.05
    )  # gaps and tolerances move the others
    reached = further * speed * time[-1]
    assert low <= reached.min() and reached.max() <= high
    assert high - low < 1.5 * np.ptp(reached)


@pytest.mark.parametrize("profile", [GatedSine(), HalfSine(), Rollers()])
def test_a_wheels_table_keeps_the_corners_of_its_gaps(atlas, profile):
    """Even points cut them off by 1 um: three sigma of a, where a slow wheel passed one."""
    rig = eqx.tree_at(lambda r: r.profiles, atlas, (profile,) * 3)
    tables, pitch = wheel_tables(rig, -1.0, 1.0), np.asarray(rig.gaps.pitch)
    width = np.asarray(rig.gaps.width)
    around = np.linspace(-2e-3, 2e-3, 101)[:, None]
    for corner in (3 * pitch, 3 * pitch + width / 2, 3 * pitch + width):
        theta = corner + around
        exact = np.asarray(jax.vmap(lambda a: wheel_shape(rig, a))(jnp.asarray(theta)))
        np.testing.assert_allclose(tables.rho(theta), exact, rtol=0, atol=1e-8)


@pytest.mark.parametrize("profile", [GatedSine(), HalfSine(), Rollers()])
def test_slopes_of_a_wheels_table_jump_at_the_corners_of_its_gaps(atlas, profile):
    """Straight from point to point they were a mean of both sides within 0.4 mrad of an edge."""
    rig = eqx.tree_at(lambda r: r.profiles, atlas, (profile,) * 3)
    tables, pitch = wheel_tables(rig, -1.0, 1.0), np.asarray(rig.gaps.pitch)
    width = np.asarray(rig.gaps.width)
    beside = np.concatenate([-np.geomspace(1e-6, 2e-3, 20), np.geomspace(1e-6, 2e-3, 20)])
    sloping = jax.vmap(lambda a: jax.jvp(lambda b: wheel_shape(rig, b), (a,), (0 * a + 1,))[1])
    for corner in (3 * pitch, 3 * pitch + width / 2, 3 * pitch + width):
        theta = corner + beside[:, None]
        exact = np.asarray(sloping(jnp.asarray(theta)))
        tops = np.abs(tables.slope).max(axis=(0, 1))
        assert np.max(np.abs(tables.rho_slope(theta) - exact) / tops) < 1e-3


def test_rates_that_jump_between_points_keep_their_integrals():
    """A corner of a shape anywhere between the force points: its rate's integral and moment."""
    step, points = 2.5e-4, 40
    time, fine = step * np.arange(points), step / 4 * np.arange(4 * (points - 1) + 1)
    corners = step * drawn_anew("corners").uniform(8, 30, 3)
    bend = np.array([0.5, -1.0, 2.0])
    rho = bend * np.maximum(fine[:, None] - corners, 0.0)
    rate = np.where(time[:, None] > corners, bend, 0.0)
    unknown = {f.name: None for f in dataclasses.fields(RunMotion)}
    motion = RunMotion(**(unknown | {"rho": rho, "shape_rate": rate, "step": step}))
    whole = rate + motion.missed_rate
    ends = np.r_[0.5, np.ones(points - 2), 0.5][:, None] * step
    assert np.sum(ends * whole, axis=0) == pytest.approx(rho[-1], rel=1e-9)
    lasted = time[-1] ** 2 - corners**2
    assert np.sum(ends * time[:, None] * whole, axis=0) == pytest.approx(
        bend * lasted / 2, rel=1e-3
    )
    assert np.sum(ends * rate, axis=0) != pytest.approx(rho[-1], rel=1e-3)


def test_responses_to_torques_are_those_of_the_whole_equations(atlas):
    """What the diagnosis adds up from unit torques, against `dynamics` at every moment."""
    rng = np.random.default_rng(1)
    t, n, R = 20, 3, float(atlas.sphere.radius)
    w, axes = atlas.wheels, np.asarray(atlas.wheels.spin_axis)
    radius = rng.uniform(0.5, 1.5, (t, n)) * np.asarray(w.radius)
    inertia = np.asarray(atlas.sphere.inertia_matrix)
    unit = jax.vmap(
        lambda r: rotation_response(atlas, Rolling(r, jnp.asarray(axes)), inertia), 0, 1
    )(radius)
    response = MeasuredTurning(np.asarray(unit), axes[None])
    shaft, opposing = rng.normal(size=(t, n)), rng.normal(size=(t, 3))
    shaft[:, 1] = 0.0
    for T, g in ((shaft, opposing), (shaft, None), (None, opposing)):
        torque = 0 * shaft if T is None else T
        against = 0 * opposing if g is None else g
        drive = np.stack([
            drive_forces(axes, r, R, w.inertia, inertia, *x)
            for r, *x in zip(radius, torque, against, strict=True)
        ])  # fmt: skip
        found = response.respond(T, g)
        assert found[0] == pytest.approx(drive)
        assert found[1] == pytest.approx((R * drive @ axes - against) @ np.linalg.inv(inertia))
