"""Exact propagation against the integrated equations, high-accuracy solutions and itself."""

import sys

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from machines import ANY_SPEEDS, SKEW, drawn_machine, machine
from scipy.linalg import expm
from scipy.spatial.transform import Rotation
from seeds import drawn_anew
from tiers import tiered

from omnijax import InputError, laws
from omnijax.dynamics import TRANSLATIONS, linear_system, wheel_shape
from omnijax.simulation import propagate, ramp, simulate, speeds, table, torques
from omnijax.simulation._exact.constant import constant_response
from omnijax.simulation._exact.forcing import wheel_pieces
from omnijax.simulation._exact.system import exact_obstacle
from omnijax.study import sweep
from omnijax.vibration import evaluate

pytestmark = [pytest.mark.brief, ANY_SPEEDS]

TS = jnp.linspace(0.2, 0.7, 11)
W = (0.4, 5.2, -1.3)


def _distance(a, b) -> float:
    """Largest difference of dR, relative to its size."""
    a, b = np.asarray(a.dR), np.asarray(b.dR)
    return float(np.abs(a - b).max() / np.abs(b).max())


def _effects(rig):
    number = jnp.asarray
    return (
        rig.add(laws.WheelRunout(number(1e-4), number(0.3)), "w2")
        .add(laws.DamagedRoller(number(1.0), number(0.5)), "w2")
        .add(laws.ContactRelaxation(number(5e4), number(0.02)), "w1")
        .add(
            laws.FloorVibration(number(0.1), number(3.0), number(0.4), number([1.0, 2.0, 0.0])),
            "platform",
        )
    )


DRIVES = {
    "constant": speeds(W, force=(0.1, 0.2, 0.3), initial_angle=(0.1, 0.2, 0.3)),
    "ramp through zero": speeds(ramp(0.35, 0.6, W, (-3.0, 2.0, 6.0))),
}


@pytest.mark.full  # in the gate with effects, below
@pytest.mark.parametrize("name", DRIVES)
def test_agrees_with_integration(name):
    rig, drive = machine(SKEW), DRIVES[name]
    exact = propagate(rig, drive, TS)
    stepped = simulate(rig, drive, TS, solver="dopri8", rtol=1e-11)
    assert _distance(exact, stepped) < 1e-9
    for channel in ("R_l", "attitude", "normal_force", "deflection"):
        a, b = np.asarray(getattr(exact, channel)), np.asarray(getattr(stepped, channel))
        assert np.abs(a - b).max() < 2e-9 * np.abs(b).max(), channel


@pytest.mark.parametrize("kind", tiered(["constant", "ramp"], "constant".__eq__))
def test_effects_and_profiles_agree_with_integration(kind):
    """Of constant speeds in the gate: wheels that follow the linear system, below."""
    profiles = (laws.Rollers(), laws.HalfSine(), laws.ContinuousSine())
    rig = eqx.tree_at(lambda r: r.profiles, machine(SKEW), profiles)
    first = (0.4, 5.2, 0.0)
    turning = first if kind == "constant" else ramp(0.35, 0.6, first, (-3.0, 2.0, 6.0))
    drive, rig = speeds(turning, initial_angle=(0.1, 0.2, 0.03)), _effects(rig)
    exact = propagate(rig, drive, TS)
    stepped = simulate(rig, drive, TS, solver="dopri8", rtol=1e-11)
    assert _distance(exact, stepped) < 1e-9
    for channel in ("R_l", "attitude", "normal_force", "deflection"):
        a, b = np.asarray(getattr(exact, channel)), np.asarray(getattr(stepped, channel))
        assert np.abs(a - b).max() < 2e-9 * np.abs(b).max(), channel


@eqx.filter_jit
def _matrices(rig, model):
    """A, what the shape enters by, and what shows the displacement."""
    system = linear_system(TRANSLATIONS[model](rig))
    return system.A, system.into("shape"), system.row("displacement")[0]


def _stepped(rig, w, model, ts, count=16000):
    """dR by exponentials of the matrix with the shape's interpolant on a fine grid."""
    A, B, C = (np.asarray(x) for x in _matrices(rig, model))
    t = np.linspace(0.0, float(ts[-1]), count + 1)
    h, m, n = t[1], len(A), rig.size
    rho = np.asarray(jax.vmap(lambda s: wheel_shape(rig, jnp.asarray(w) * s))(jnp.asarray(t)))
    F = np.zeros((m + 2 * n, m + 2 * n))
    F[:m, :m], F[:m, m : m + n], F[m : m + n, m + n :] = A * h, B * h, np.eye(n)
    E = expm(F)
    y, rows = -np.linalg.solve(A, B @ rho[0]), [np.zeros(m)]
    rows[0] = y
    for k in range(count):
        y = (E @ np.concatenate([y, rho[k], rho[k + 1] - rho[k]]))[:m]
        rows.append(y)
    every = count // (len(ts) - 1)
    return np.asarray(rows)[::every] @ C.T


@pytest.mark.parametrize("model", tiered(["coupled", "paper"], "paper".__eq__))
def test_drawn_rigs_follow_the_linear_system(model):
    """2 to 5 unlike wheels of unlike profiles, one of them still, contacts damped or not."""
    rng = drawn_anew(f"linear system, {model}")
    n = int(rng.integers(3 if model == "coupled" else 2, 6))
    ts = jnp.linspace(0.0, 0.5, 11)
    base = drawn_machine(rng, n, sphere_inertia=1e-12)
    for damping in (0.0, rng.uniform(1, 20000)):
        rig = eqx.tree_at(lambda r: r.wheels.contact.damping, base, jnp.full(n, damping))
        w = rng.uniform(3, 8, n) * rng.choice([-1, 1], n)  # past a gap at least
        w[rng.integers(n)] = 0.0
        run, want = propagate(rig, speeds(w), ts, model=model), _stepped(rig, w, model, ts)
        assert np.abs(want).max() > 1e-6
        error = np.abs(np.asarray(run.dR) - want).max()
        assert error < 2e-5 * np.abs(want).max()  # interpolation at kinks: h^2


@pytest.mark.full  # in the gate drawn rigs of unlike signals
def test_signals_of_unlike_sizes_take_no_room_from_each_other(monkeypatch):
    """A runout of one wheel of four made room for a turn's pieces on all of them."""
    rng = drawn_anew("signals of unlike sizes")
    rig = drawn_machine(rng, 4, laws.GatedSine())  # whose turn has a piece and a rest a roller
    rig = rig.add(laws.WheelRunout(jnp.asarray(5e-5), jnp.asarray(0.4)), "w1")
    turning, angles, times = rng.uniform(2, 9, 4), rng.uniform(0, 0.4, 4), jnp.linspace(0, 0.3, 61)
    runs = []
    for room in (2.0, 1e9):
        monkeypatch.setattr(sys.modules[wheel_pieces.__module__], "ROOM", room)

        def run(speeds, angles):
            return constant_response(rig, speeds, angles, jnp.ones(3), times, "coupled", None, 16)

        program = jax.jit(run).lower(jnp.asarray(turning), jnp.asarray(angles)).compile()
        response = program(jnp.asarray(turning), jnp.asarray(angles))
        runs.append((response, program.memory_analysis().temp_size_in_bytes))
    (grouped, small), (together, large) = runs
    assert small < 0.7 * large
    for name, x in grouped._asdict().items():
        scale = np.abs(np.asarray(x)).max()
        np.testing.assert_allclose(x, getattr(together, name), rtol=0, atol=1e-12 * scale)


@pytest.mark.parametrize("model", tiered(["coupled", "paper"], "paper".__eq__))
def test_round_or_resting_wheels_shake_nothing(model):
    for rig, w in ((machine(SKEW, roundness=0.0), W), (machine(SKEW), (0.0, 0.0, 0.0))):
        run = propagate(rig, speeds(w), TS, model=model)  # a program of the test below
        assert np.abs(np.asarray(run.dR)).max() < 1e-15


@pytest.mark.full  # in the gate how every study and run reads a drive: test_sweep
def test_input_is_read_as_simulate_reads_it():
    """Falling times went through without a word, and plain speeds ended in an AttributeError."""
    rig, run = machine(SKEW), propagate(machine(SKEW), speeds(W), TS)
    np.testing.assert_array_equal(propagate(rig, list(W), list(TS)).dR, run.dR)
    np.testing.assert_array_equal(
        propagate("atlas", "1 rad/s, 2 rad/s, 0", "20 ms").dR,
        simulate("atlas", (1.0, 2.0, 0.0), 0.02).dR,
    )
    with pytest.raises(InputError, match="`ts` must be finite and increase"):
        propagate(rig, speeds(W), TS[::-1])
    with pytest.raises(InputError, match="the drive has 2 wheels, but the rig has 3"):
        propagate(rig, W[:2], TS)


def test_obstacles_are_said():
    rig = machine(SKEW)
    cubic = rig.add(laws.ContactCubic(jnp.asarray(1e9)), "all")
    assert exact_obstacle(rig) is None
    assert "contact-cubic" in str(exact_obstacle(cubic))
    with pytest.raises(ValueError, match=r"contact-cubic.*not linear"):
        propagate(cubic, speeds(W), TS)
    with pytest.raises(ValueError, match=r"no exact propagation: motor torques drive the wheels"):
        propagate(rig, torques(W), TS)
    drag = rig.add(laws.AirDrag(jnp.asarray(1e-3)), "sphere")
    assert "air-drag" in str(exact_obstacle(drag)) and exact_obstacle(drag, "paper") is None


def test_more_rollers_than_a_traced_turn_has_room_for_are_refused():
    """A runout on a wheel of 48 rollers: the closed form had left eight of them out of a turn."""
    runout = laws.WheelRunout(jnp.asarray(1e-4), jnp.asarray(0.3))
    many = machine(SKEW, rollers=48.0)
    assert exact_obstacle(many) is None
    assert exact_obstacle(machine(SKEW, rollers=40.0).add(runout, "w1")) is None
    many = many.add(runout, "w2")
    assert "wheel w2 has 48 rollers and a law on its shape" in str(exact_obstacle(many))
    with pytest.raises(ValueError, match="has room for 40; use `simulate`"):
        propagate(many, speeds(W), TS)

    @jax.jit
    def period(rollers):
        rig = eqx.tree_at(lambda r: r.wheels.rollers, many, rollers)
        return jnp.sum(wheel_pieces(rig, 1)[0][0].width)

    assert float(period(jnp.full(3, 40.0))) == pytest.approx(2 * np.pi)
    assert np.isnan(period(jnp.full(3, 48.0)))


@pytest.mark.full  # in the gate edges of gaps: test_moment
def test_samples_that_fall_on_the_starts_of_periods_are_like_their_neighbours():
    """Rounding puts such a sample a hair before or behind the edge; nothing jumps there."""
    rng = drawn_anew("samples on edges")
    profiles = (laws.GatedSine(), laws.HalfSine(), laws.ContinuousSine())  # one program
    for _ in range(3):
        rig = eqx.tree_at(lambda r: r.profiles, drawn_machine(rng, 3), profiles)
        turning = [float(rng.uniform(0.5, 6)), 0.0, 0.0]
        passing = float(rig.gaps.pitch[0]) / turning[0] * np.arange(1, 300)
        ts = np.sort(np.concatenate([[0.0], passing, passing + 1e-10]))
        dR = np.asarray(propagate(rig, speeds(turning), ts).dR)[1:]
        np.testing.assert_allclose(dR[::2], dR[1::2], atol=1e-6 * np.abs(dR).max())


@pytest.mark.full  # in the gate that slope: test_moment
def test_starts_at_an_edge_with_the_slope_of_the_side_it_turns_to():
    rng = drawn_anew("edges")
    rig = drawn_machine(rng, 3, contact_damping=2000.0)
    gaps, signs = rig.gaps, rng.permutation([-1.0, -1.0, 1.0])
    edges = rng.integers(-3, 4, 3) * gaps.pitch + rng.integers(0, 2, 3) * gaps.width
    drive = speeds(signs * rng.uniform(0.5, 3.0, 3), initial_angle=edges)
    for how in ({"solver": "dopri8", "rtol": 1e-9}, {}):
        run = simulate(rig, drive, jnp.asarray([0.0, 1e-8, 2e-8]), **how)
        force = np.asarray(run.normal_force)
        assert np.abs(force[1] - force[0]).max() < 1e-4 * force.max(), how


@pytest.mark.full  # in the gate the runs, above
def test_a_sweep_of_wheels_that_turn_backwards_sees_what_a_run_sees():
    rng = drawn_anew("backwards")
    rig = drawn_machine(rng, 3, contact_damping=2000.0)
    drive = speeds(-rng.uniform(0.5, 3.0, 3))
    names = ("sphere_acceleration_peak", "lift_off_margin")
    swept = sweep(rig, {"sphere.mass": [5.0, 6.0]}, names, drive=drive, duration=0.1)
    run = evaluate(simulate(rig, drive, 0.1), rig, names)
    for name in names:
        assert float(swept.to_xarray()[name][0]) == pytest.approx(float(run[name]), rel=1e-6)


@pytest.mark.full  # in the gate ramps, above, and many periods, below
def test_a_run_at_late_times_is_that_at_early_ones():
    """Before a jump at a late time the speed behind it was read, and gaps went unseen."""
    rng = drawn_anew("late times")
    rig, fast = drawn_machine(rng, 3), rng.uniform(40, 90, 3)
    late = float(rng.uniform(2e4, 1e5))

    def run(begin):
        drive = speeds(
            table(
                begin + np.array([0.0, 0.3, 0.3, 1.0]),
                np.stack([0 * fast, fast, 0 * fast, 0 * fast]),
            )
        )
        return propagate(rig, drive, begin + np.linspace(0, 0.5, 101))

    assert _distance(run(late), run(0.0)) < 1e-6  # a late time is known to some 1e-11 s


def test_a_run_of_many_periods_turns_on():
    """Above 2^24 gaps their number was cut off."""
    rng = drawn_anew("many periods")
    rig, speed = machine(SKEW, profile=laws.HalfSine()), rng.uniform(300, 900)
    many = round(2.0 ** rng.uniform(18, 20))
    hundred = 100 * 2 * np.pi / float(rig.wheels.rollers[0]) / speed
    ts = jnp.asarray([0.0, hundred, many * hundred])
    run = propagate(rig, speeds([speed, 0.0, 0.0]), ts)
    _, once, often = Rotation.from_quat(np.asarray(run.attitude), scalar_first=True)
    expected = Rotation.from_rotvec(many * once.as_rotvec())  # about one axis all the time
    assert (often * expected.inv()).magnitude() < 1e-3
