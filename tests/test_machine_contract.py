"""What `simulate` makes of a rig, the diagnosis predicts of the same rig: no law is lost.

The residuals at the truth are what the steps in time leave: far below the sensors' noise, which a
law left out of the prediction is far above.
"""

import itertools

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from drawn_rigs import any_laws, any_rig, any_sensors, torque_size, with_laws
from seeds import drawn_anew
from tiers import tiered

from omnijax.diagnosis._machine._elastic.elastic import refine, rig_modes
from omnijax.diagnosis._machine._motion.wheels import _heights as shape_programs
from omnijax.diagnosis._machine.machine import Machine
from omnijax.diagnosis._machine.runs import FINE, Run
from omnijax.laws import EFFECTS, DualRow
from omnijax.rig import get_parameter, load_rig, set_parameter
from omnijax.simulation import measured, simulate, table, torques
from omnijax.study._parameters import scalar_parameters

pytestmark = [pytest.mark.long, pytest.mark.brief]
# laws at contacts and mounts whose forces are stepped in time
STEPPED = {p.id for p in EFFECTS.values() if p.port in ("contact", "mount")}
NOTHING = {  # numbers at which a law does nothing; zero for all others
    "contact-hertz": {"exponent": 1.0},
    "actuator-lag": {"tau": 1e-3},
    "actuator-saturation": {"limit": 1e3},
}
TIME = np.arange(301) / 500  # s
NOISE = {"dR": 2e-6, "theta": 1e-4, "Omega": 1e-4, "a": 2e-2}

ELASTIC = (
    ("wheel-runout", "w1", {"amplitude": 5e-5, "phase": 0.3}),
    ("damaged-roller", "w2", {"roller": 13, "severity": 0.2}),
    ("sphere-out-of-round", "sphere", {"amplitude": 4e-5, "axis": [0.2, 0.5, -0.4]}),
    ("contact-cubic", "w1", {"K3": 1e12}),
    ("contact-hertz", "w2", {"exponent": 1.5}),
    ("contact-relaxation", "all", {"K1": 2e4, "tau": 0.02}),
    ("lift-off", "all", {}),
    ("mount-cubic", "w3", {"k3": 1e13}),
    ("mount-backlash", "w1", {"gap": 4e-6}),
    ("mount-friction", "w2", {"force": 1.0}),
    ("floor-vibration", "platform",
     {"amplitude": 0.6, "frequency": 17, "phase": 0.4, "direction": [1, 2, 0.5]}),
)  # fmt: skip
TURNING = (
    ("bearing-coulomb", "all", {"torque": 0.02}),
    ("bearing-viscous", "w1", {"b": 0.01}),
    ("motor-ripple", "w2", {"amplitude": 0.02, "order": 3, "phase": 0.4}),
    ("motor-gain", "w1", {"g": 0.03}),
    ("rolling-resistance", "all", {"arm": 5e-4}),
    ("spin-resistance", "all", {"lever": 1e-3}),
    ("air-drag", "sphere", {"D": 0.1}),
    ("unbalance", "sphere", {"offset": [1e-3, 2e-3, -1e-3]}),
    ("creep", "w3", {"creepage": 0.01}),
    ("wheel-radius", "w2", {"s": 0.003}),
    ("torque-offset", "w3", {"torque": 0.02}),
    ("actuator-delay", "all", {"delay": 0.0067}),
    ("actuator-lag", "all", {"tau": 0.01}),
    ("actuator-saturation", "w1", {"limit": 0.4}),
    ("cogging", "w1", {"amplitudes": [0.01, 0.02], "orders": [7, 4.5], "phases": [0.1, 0.2]}),
    ("current-ripple", "w3", {"g": 0.05, "order": 5, "phase": 0.3}),
    ("stribeck", "w2", {"torque": 0.02, "speed": 0.5}),
    ("load-friction", "all", {"mu": 0.03}),
    ("friction-asymmetry", "w1", {"torque": 0.01}),
)
SENSORS = (
    ("sensor-gain", "dR", {"g": 0.05}),
    ("sensor-delay", "dR", {"delay": 0.0031}),
    ("sensor-lag", "dR", {"tau": 0.004}),
    ("sensor-drift", "dR_y", {"a": 2e-5, "b": -3e-5}),
    ("sensor-crosstalk", "dR", {"X_xy": 0.1, "X_zx": -0.05}),
    ("sensor-saturation", "dR_x", {"limit": 1e-4}),
    ("sensor-rectified", "dR_z", {}),
)
ENCODERS = (
    ("encoder-eccentricity", "theta_2", {"amplitude": 2e-3, "phase": 0.4}),
    ("sensor-gain", "theta", {"g": 1e-3}),
    ("sensor-delay", "Omega", {"delay": 0.002}),
    ("sensor-gain", "a", {"g": 0.02}),
)


def simulated(laws, seed):
    """A rig, and 0.6 s of it under smooth torques."""
    rig = eqx.tree_at(lambda r: r.platform.gravity, load_rig("atlas"), jnp.array([0.0, 0.0, -9.81]))
    rig, rng = with_laws(rig, laws), np.random.default_rng(seed)
    time = TIME
    waves = np.sin(
        2 * np.pi * time[:, None] * rng.uniform(0.6, 2, (3, 1, 3)) + rng.uniform(0, 6, 3)
    )
    torque = 0.3 * waves.sum(axis=0) + rng.uniform(-0.2, 0.2, 3)
    return rig, torque, followed(rig, torque)


def followed(rig, torque):
    """The rig's run under those torques, with what slow sensors would see between its samples."""
    slow = with_laws(rig, SENSORS)
    return simulate(slow, torques(table(TIME, torque)), jnp.asarray(TIME))


def machine_of(rig, torque, run):
    """The diagnosis's machine at the truth, with what the rig's sensors showed of the run."""
    outputs = {g: np.asarray(values) for g, values in measured(run, rig).items()}
    time = np.asarray(run.t)
    known = np.ones(len(time), bool)
    record = Run("run", "train", time, torque, np.zeros((len(time), 3)), outputs, known)
    return Machine(rig, [record], NOISE)


def in_sigmas(machine, rig):
    """RMS of the whitened residuals of one rig."""
    (rows,) = machine.residuals([rig], [0])
    return float(np.sqrt(np.mean(rows**2)))


@pytest.fixture(scope="module")
def turning():
    """The laws that act on torques and rolling."""
    return simulated(TURNING, 0)


@pytest.fixture(scope="module")
def ringing():
    """The laws at contacts and mounts."""
    return simulated(ELASTIC, 1)


def check_every_law(simulation, laws, bound):
    rig, torque, run = simulation
    assert run.ok
    machine = machine_of(rig, torque, run)
    at_truth = in_sigmas(machine, rig)
    assert at_truth < bound
    bare = rig.with_effects(())
    for k, (name, place, values) in enumerate(laws):
        if not values:  # lift-off has no size, and no contact loses its sphere in this run
            continue
        law = EFFECTS[name]
        zero = {key: np.zeros(np.shape(v)) for key, v in values.items()
                if law.parameters[key].linear or len(values) == 1}  # fmt: skip
        without = (name, place, values | NOTHING.get(name, zero))
        others = with_laws(bare, (*laws[:k], without, *laws[k + 1 :]))
        assert in_sigmas(machine, others) > 3 * at_truth, name


def test_every_law_of_the_rotation_is_predicted(turning):
    check_every_law(turning, TURNING, 0.12)


@pytest.mark.full  # in the gate drawn ones, below
def test_every_law_of_the_elastic_machine_is_predicted(ringing):
    """The steps at the edges of the play and of the gaps leave a third of a sigma."""
    check_every_law(ringing, ELASTIC, 0.4)


@pytest.mark.full  # in the gate drawn sensors, below
@pytest.mark.parametrize(
    ("name", "group", "value"),
    [("sensor-lag", "dR", 4e-3), ("sensor-lag", "a", 2e-3), ("sensor-delay", "a", 1.2e-3)],
)
def test_slow_sensors_see_what_nonlinear_laws_ring_between_the_samples(ringing, name, group, value):
    """Half a sample of a delay by splines through the samples is 2.6 m/s^2 RMS off, noise 0.02."""
    rig, torque, run = ringing
    (key,) = EFFECTS[name].parameters
    sensed = with_laws(rig, [(name, group, {key: value})])

    def left(rig):
        elastic, _ = machine_of(rig, torque, run).residual_tables(rig, 0)
        return np.sqrt(np.mean(np.split(elastic, 2, axis=1)[group == "a"] ** 2))

    assert left(sensed) < 2 * left(rig)  # between the samples the steps leave somewhat more


DRIFT = {f"theta_{k}": ("sensor-drift", f"theta_{k}", {"a": a, "b": b})
         for k, a, b in ((1, 0.5, -0.4), (2, -0.12, -0.6), (3, -0.3, 0.2))}  # fmt: skip
LATE = ("sensor-delay", "theta", {"delay": 6e-3})
LAG = ("sensor-lag", "theta", {"tau": 3e-3})
LIMIT = ("sensor-saturation", "theta", {"limit": 0.4})
RECTIFIED = ("sensor-rectified", "theta_3", {})
STOPS = (LIMIT, ("sensor-saturation", "theta_2", {"limit": 0.3}))


# in the gate two of them, and drawn ones with other laws, below
@pytest.mark.parametrize(
    "sensors",
    tiered([
        (DRIFT["theta_2"], LATE),
        (LATE, DRIFT["theta_2"]),
        (DRIFT["theta_1"], ("sensor-rectified", "theta_1", {}), LAG),
        (DRIFT["theta_3"], RECTIFIED),
        (("sensor-rectified", "theta_1", {}), ("sensor-rectified", "theta_2", {})),
        STOPS,
        (LIMIT, ("sensor-lag", "theta", {"tau": 0.011})),
    ], lambda sensors: sensors[0] != DRIFT["theta_2"] and LAG not in sensors),
)  # fmt: skip
def test_encoders_that_drift_with_another_law_are_understood(turning, sensors):
    """The drift of a late one was taken at another moment, the start of a folded one elsewhere."""
    truth, torque, run = turning
    rig = with_laws(truth, sensors)
    assert in_sigmas(machine_of(rig, torque, run), rig) < 0.3


@pytest.mark.full  # in the gate drawn rigs and laws
def test_friction_of_rolling_feels_the_normal_forces_of_laws_at_contacts():
    """The linear model's normal forces left 11 sigma at the truth of a drawn rig."""
    laws = (
        ("rolling-resistance", "all", {"arm": 2e-3}),
        ("contact-relaxation", "all", {"K1": 2e5, "tau": 0.02}),
        ("mount-cubic", "all", {"k3": 1e13}),
    )
    rig, torque, run = simulated(laws, 2)
    machine = machine_of(rig, torque, run)
    normal = machine.rotated(rig)[0].normal[::FINE]
    assert np.std(normal - run.normal_force) < 0.01 * np.std(run.normal_force)
    assert in_sigmas(machine, rig) < 0.3


def turning_back(roundness: float):
    """A rig whose third wheel has two rows and turns back once, its torques, and the run."""
    rig = load_rig("atlas")
    parts = lambda r: (r.platform.gravity, r.profiles, r.wheels.roundness)  # noqa: E731
    rows = (*rig.profiles[:2], DualRow(0.3 * rig.wheels.radius[2]))
    rig = eqx.tree_at(parts, rig, (jnp.zeros(3), rows, rig.wheels.roundness.at[2].set(roundness)))
    pushed = np.full(len(TIME), -1.0)
    torque = np.column_stack([0.3 * pushed, 0.25 * pushed, 0.34 * np.cos(2.4 * np.pi * TIME)])
    return rig, torque, simulate(rig, torques(table(TIME, torque)), jnp.asarray(TIME))


@pytest.mark.full
def test_a_wheel_that_turns_back_just_behind_a_switch_of_its_rows_is_understood():
    """Half the encoder's noise behind it; then the contact slides along: 0.45 sigma by angles."""
    rig, torque, run = turning_back(0.3)
    for _ in range(3):
        turn, pitch = float(run.theta[:, 2].max()), float(rig.gaps.pitch[2])
        rig, torque, run = turning_back(2 * ((turn - 5e-5) / pitch % 0.5 - 0.25))
    machine = machine_of(rig, torque, run)
    (shares,) = machine.basis.shares
    sliding = (shares[:, 2] > 0.01) & (shares[:, 2] < 0.99)
    axes, turning = machine.motions(rig)[0].axes[sliding, 2], refine(np.asarray(run.Omega), FINE)
    assert sliding.sum() > 2 * FINE
    standing = np.abs(np.einsum("tj,tj->t", axes, turning[sliding]))
    assert np.median(standing) < 1e-3 * np.abs(turning).max()
    assert in_sigmas(machine, rig) < 0.2


@pytest.mark.parametrize(
    ("width", "sigmas", "most"),
    [(3e-3, 0.1, 0.8), (5e-4, 1.3, 6.0)],
)
def test_friction_under_forces_that_jump_is_followed_through_rest(width, sigmas, most):
    """N jumps at the edges of gaps, and a narrow friction holds the sphere stiffly at rest.

    Steps of a sample left 414 sigma of the narrow one; slopes that were smeared over an edge and
    jumps put off to the next force point left 1.2 sigma of a sample of `a` with the wide one.
    """
    laws = (("rolling-resistance", "all", {"arm": 5e-3, "width": width}),)
    rig, torque, run = simulated(laws, 4 if width > 1e-3 else 3)
    machine = machine_of(rig, torque, run)
    elastic, _ = machine.rows[0].split(machine.residuals([rig], [0])[0])
    assert in_sigmas(machine, rig) < sigmas
    assert np.abs(elastic[:, 3:]).max() < most


@pytest.mark.parametrize("count", tiered([2, 4], (4).__eq__))  # paths that are drawn
def test_a_residual_does_not_hang_on_what_was_asked_before(turning, count):
    """What is kept of one rig is no other one's: both orders of asking give the same bits.

    Wheels' masses and the floor's vibration move the contacts' normal forces, on which rolling
    resistance hangs: what was kept of the rotation did not know them (0.6 sigma of a residual).
    """
    truth, torque, run = turning
    rig = with_laws(truth, [law for law in (*ELASTIC, *ENCODERS) if law[0] not in STEPPED])
    machine, rng = machine_of(truth, torque, run), drawn_anew("asked before")
    always = ["wheel.w2.mass", "effect.floor-vibration.platform.frequency"]
    drawn = rng.permutation([p for p in scalar_parameters(rig) if p not in always])[:count]
    for path in (*always, *drawn):
        value = float(get_parameter(rig, path))
        other = set_parameter(
            rig, path, value + 1 if path.endswith(("roller", "rollers")) else 0.98 * value
        )
        machine.forget()
        first, after = (machine.residuals([asked], [0])[0] for asked in (rig, other))
        machine.forget()
        (alone,) = machine.residuals([other], [0])
        np.testing.assert_array_equal(after, alone, err_msg=path)
        assert not np.array_equal(first, after), path


def test_the_tables_name_every_law():
    named = {name for name, _, _ in (*ELASTIC, *TURNING, *SENSORS, *ENCODERS)}
    assert named == set(EFFECTS)


@pytest.mark.full  # in the gate drawn ones, and of encoders
def test_every_pair_of_sensor_laws_is_predicted_in_its_order(turning):
    """The second acts on what the first left: no pair leaves more than its laws alone do."""
    rig, torque, _ = turning
    run = followed(
        with_laws(rig, SENSORS), torque
    )  # those that remember see it between its samples
    machine = machine_of(rig, torque, run)
    (record,) = machine.runs

    def left(sensed, shown):
        outputs = {g: np.asarray(x) for g, x in measured(run, shown).items()}
        machine.replace(0, Run("run", "train", record.time, torque, record.force, outputs,
                               record.known))  # fmt: skip
        elastic, _ = machine.residual_tables(sensed, 0)
        return np.abs(elastic[:, :3]).max()

    bare, alone = left(rig, rig), {}
    for law in SENSORS:
        sensed = with_laws(rig, [law])
        alone[law[0]] = left(sensed, sensed)
        assert alone[law[0]] < 1.1 * bare, law
    programs = shape_programs._cache_size()
    for pair in itertools.permutations(SENSORS, 2):
        sensed = with_laws(rig, pair)
        assert left(sensed, sensed) < 1.2 * max(alone[name] for name, _, _ in pair), pair
    assert shape_programs._cache_size() == programs  # of shapes no sensor has a part in


def test_a_free_direction_has_a_mode_for_its_position_and_one_for_its_speed():
    """A double zero has one vector; by luck of rounding both were one (185 sigma at a truth)."""
    rng = drawn_anew("free directions")
    for one in (np.random.default_rng([151019, 0, 77]), *[rng] * 20):
        m = rig_modes(any_rig(one, (2,)))
        np.testing.assert_allclose((m.shapes @ m.inverse).real, np.eye(len(m.A)), atol=1e-8)
        assert np.ptp(np.sort(np.abs(m.rates))[:2]) > 0.1 * np.abs(m.rates).min()


def drawn_run(rng, rig):
    """Torques (samples, n) of a few slow waves, the run under them, and noise of its channels."""
    time = TIME[: rng.integers(150, len(TIME))]
    waves = rng.uniform(0.6, 4, (3, 1, rig.size)) * 2 * np.pi * time[:, None]
    waves = rng.uniform(0.1, 0.5, (3, 1, rig.size)) * np.sin(waves + rng.uniform(0, 6, rig.size))
    torque = torque_size(rig) * (waves.sum(axis=0) + rng.uniform(-0.3, 0.3, rig.size))
    run = simulate(with_laws(rig, [SENSORS[2]]), torques(table(time, torque)), jnp.asarray(time))
    sizes = {g: float(np.std(getattr(run, g), axis=0).max()) for g in ("dR", "theta", "Omega", "a")}
    return torque, run, sizes


@pytest.mark.parametrize(
    "ports",
    tiered([("turning",), ("elastic",), ("turning", "elastic")], lambda ports: len(ports) < 2),
)
def test_any_rig_with_any_laws_and_sensors_is_predicted(ports):
    """Noise of a thousandth to a hundredth of the signals hides what the steps in time leave."""
    rng = drawn_anew(f"rig and laws, {' and '.join(ports)}")
    # two wheels leave a direction in which nothing holds the sphere: it goes as it is pushed
    rig = any_rig(rng) if ports == ("turning",) else any_rig(rng, (3, 3, 4, 5, 6))
    for port in ports:
        rig = with_laws(rig, any_laws(rng, rig, port, int(rng.integers(1, 5))))
    torque, run, sizes = drawn_run(rng, rig)
    assert run.ok
    noise = {"theta": 1e-4} | {
        g: share * sizes[g] for g, share in (("dR", 5e-3), ("a", 1e-2), ("Omega", 1e-3))
    }

    def left(sensors):
        sensed = with_laws(rig, sensors)
        outputs = {g: np.asarray(values) for g, values in measured(run, sensed).items()}
        time, known = np.asarray(run.t), np.ones(len(run.t), bool)
        record = Run("run", "train", time, torque, np.zeros((len(time), 3)), outputs, known)
        return in_sigmas(Machine(sensed, [record], noise), sensed)

    bare = left(())
    assert bare < 0.6
    # Omega tells the motion about a free axis, and jumps between samples with dual rows
    plain = rig.size > 2 and not any(isinstance(p, DualRow) for p in rig.profiles)
    told = {g: size for g, size in sizes.items() if plain or g != "Omega"}
    for count in rng.choice([1, 2, 2, 3], 4):
        sensors = any_sensors(rng, rig, told, count)
        assert left(sensors) < 1.5 * bare + 0.3, sensors
