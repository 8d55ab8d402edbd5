"""Runs in files: everything back from NetCDF, recordings from CSV, sensors, recorded drives."""

import dataclasses
import warnings
from types import SimpleNamespace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from references import REFERENCES
from seeds import drawn_anew
from tiers import more

from omnijax import (
    InputError,
    Trajectory,
    drive_from_recording,
    laws,
    load_rig,
    measured,
    propagate,
    read_recording,
    simulate,
    speeds,
    torques,
)
from omnijax._errors import DataWarning
from omnijax._netcdf import load_netcdf
from omnijax.cli._simulate.run import perform, planned
from omnijax.dynamics import Coupled, Inputs, Model, instant, motor_torque, prescribed_instant
from omnijax.simulation import ramp, start_vector, state_of, table, to_recording
from omnijax.simulation._run import PER_WHEEL

pytestmark = [pytest.mark.long, pytest.mark.brief]


@pytest.fixture(scope="module")
def rig():
    return load_rig("atlas")


@pytest.fixture(scope="module")
def run(rig):
    return propagate(rig, speeds([0.7, 2.1, -0.4]), np.arange(60) * 2e-3)


def test_netcdf_gives_everything_back_to_the_last_bit(run, rig, tmp_path):
    path = run.save(tmp_path / "run.nc", rig, command="omnijax simulate atlas")
    again = Trajectory.load(path)
    assert eqx.tree_equal(again, run)
    cut = eqx.tree_at(
        lambda r: (r.dR, r.status), run, (run.dR.at[40:].set(jnp.nan), jnp.asarray(2))
    )
    again = Trajectory.load(cut.save(tmp_path / "cut.nc"))
    assert again.message() == cut.message()
    np.testing.assert_array_equal(again.dR, cut.dR)


def test_a_netcdf_file_says_what_it_is(run, rig, tmp_path):
    import xarray

    path = run.save(tmp_path / "run.nc", rig, command="omnijax simulate atlas")
    with xarray.open_dataset(path, engine="h5netcdf") as data:
        assert {name: data[name].attrs["units"] for name in run.UNITS} == run.UNITS
        assert data["theta"].dims == ("t", "wheel")
        assert data["dR"].dims == ("t", "axis")
        assert data.attrs["status"] == "ok"
        assert data.attrs["command"] == "omnijax simulate atlas"
        assert "[sphere]" in data.attrs["rig"]
        assert "omnijax 0" in data.attrs["versions"]
        np.testing.assert_array_equal(data["dR"].sel(axis="y"), run.dR[:, 1])


@pytest.mark.parametrize("name", ["run.csv", "run.csv.gz", "run.parquet", "run.nc"])
def test_every_kind_of_file_is_a_noise_free_recording(run, rig, tmp_path, name):
    if name.endswith("parquet"):
        pytest.importorskip("pyarrow")
    recording = read_recording(run.save(tmp_path / name, rig, tmp_path / "rig.toml"), rig)
    assert recording.faults == []
    for group in ("dR", "theta", "Omega", "a", "torque", "force"):
        np.testing.assert_array_equal(recording.group(group), getattr(run, group))
    if not name.endswith("nc"):
        assert recording.rig_path == tmp_path / "rig.toml"
        assert recording.declared_noise("theta_2") == 0


def test_rows_after_a_failure_are_left_out_of_a_recording(run):
    cut = eqx.tree_at(lambda r: r.dR, run, run.dR.at[40:].set(jnp.nan))
    assert len(to_recording(cut)) == 40


def test_sensors_act_on_their_group_or_channel_one_after_the_other(run, rig):
    sensed = (
        rig.add(laws.SensorGain(jnp.array(0.05)), "dR")
        .add(laws.SensorDrift(jnp.array(1e-5), jnp.array(1e-4)), "dR_z")
        .add(laws.SensorDelay(jnp.array(3 * 2e-3)), "theta")
        .add(laws.SensorCrosstalk(X_xy=jnp.array(0.1)), "dR")
    )
    seen = measured(run, sensed)
    gained = 1.05 * run.dR
    drifted = gained[:, 2] + 1e-5 + 1e-4 * run.t
    np.testing.assert_allclose(seen["dR"][:, 0], gained[:, 0] + 0.1 * gained[:, 1], rtol=1e-12)
    np.testing.assert_allclose(seen["dR"][:, 2], drifted, rtol=1e-12)
    np.testing.assert_allclose(seen["theta"][3:], run.theta[:-3], atol=1e-12)
    np.testing.assert_array_equal(seen["Omega"], run.Omega)
    np.testing.assert_array_equal(measured(run, rig)["dR"], run.dR)


@pytest.fixture(scope="module")
def slow(rig):
    """A rig with sensors that remember."""
    return (
        rig.add(laws.SensorLag(jnp.array(2e-3)), "a")
        .add(laws.SensorSaturation(jnp.array(2e-5)), "dR_y")
        .add(laws.SensorDelay(jnp.array(1.3e-3)), "dR")
    )


def test_sensors_that_remember_have_seen_the_run_between_its_samples(slow, rig):
    """As the same run at eight times the rate."""
    speed, times = [0.7, 2.1, -0.4], np.arange(60) * 2e-3
    run, fine = simulate(slow, speeds(speed), times), np.arange(8 * 59 + 1) * 2.5e-4
    np.testing.assert_allclose(run.t, times, atol=1e-15)
    wanted, seen = measured(propagate(rig, speeds(speed), fine), slow), measured(run, slow)
    for group in ("dR", "a", "theta", "Omega"):
        largest = np.abs(wanted[group]).max()
        np.testing.assert_allclose(seen[group], wanted[group][::8], atol=1e-7 * largest)
    by_samples = measured(propagate(rig, speeds(speed), times), slow)
    assert np.abs(by_samples["a"] - seen["a"]).max() > 0.02 * np.abs(seen["a"]).max()
    assert np.abs(by_samples["dR"] - seen["dR"]).max() > 1e-7  # m, more than any tolerance above


@pytest.mark.full  # in the gate what they have seen, above, and the command: test_cli_simulate
def test_files_and_the_command_keep_what_such_sensors_have_seen(slow, tmp_path):
    speed, times = [0.7, 2.1, -0.4], np.arange(60) * 2e-3
    run = simulate(slow, speeds(speed), times)
    again = Trajectory.load(run.save(tmp_path / "run.nc", slow))
    assert eqx.tree_equal(again, run)
    seen = measured(run, slow)
    numerics = SimpleNamespace(model="coupled", solver="auto", rtol=None, max_steps=None)
    commanded = perform(planned(slow, speeds(speed), times, numerics), None)
    for group, values in measured(commanded, slow).items():  # programs of other lengths round
        rounding = 1e-14 * np.abs(seen[group]).max()
        np.testing.assert_allclose(values, seen[group], rtol=1e-13, atol=rounding)


def test_a_delay_behind_a_lost_sign_has_no_corner_in_it(run, rig):
    """|y| of half a sample before, not the curve through |y| of the samples."""
    late = laws.SensorDelay(jnp.array(1e-3))
    behind = measured(run, rig.add(laws.SensorRectified(), "dR_x").add(late, "dR"))["dR"]
    delayed = measured(run, rig.add(late, "dR"))["dR"]
    np.testing.assert_array_equal(behind[:, 0], np.abs(delayed[:, 0]))
    drifting = rig.add(laws.SensorDrift(jnp.array(0.0), jnp.array(2.0)), "dR_x").add(late, "dR")
    moved = measured(run, drifting)["dR"] - delayed
    np.testing.assert_allclose(moved[5:, 0], 2.0 * (run.t[5:] - 1e-3), rtol=1e-9)


def test_readings_of_sensors_are_differentiable(run, rig):
    def first(g):
        return measured(run, rig.add(laws.SensorGain(g), "a"))["a"][7, 1]

    assert jax.grad(first)(jnp.array(0.0)) == pytest.approx(float(run.a[7, 1]))


def test_files_hold_what_the_sensors_read_and_netcdf_the_truth_too(run, rig, tmp_path):
    sensed = rig.add(laws.SensorGain(jnp.array(0.05)), "dR")
    for name in ("run.csv", "run.nc"):
        recording = read_recording(run.save(tmp_path / name, sensed))
        np.testing.assert_allclose(recording.group("dR"), 1.05 * run.dR, rtol=1e-12)
    assert eqx.tree_equal(Trajectory.load(tmp_path / "run.nc"), run)


@pytest.mark.full  # in the gate other recordings: test_reference, test_plant
def test_a_recording_drives_the_machine_through_the_same_run():
    folder = REFERENCES / "ref-1"
    recording = read_recording(folder / "run-1.csv.gz")
    few = 60
    drive = drive_from_recording(recording)
    again = simulate(load_rig(folder / "rig.toml"), drive, recording.time[:few], solver="dopri8")
    assert drive.initial_velocity is None
    for group in ("dR", "theta", "Omega", "a"):
        size = np.ptp(recording.group(group), axis=0).max()
        error = np.abs(getattr(again, group) - recording.group(group)[:few]).max()
        assert error < 1e-6 * size


def opposed(rig, rng):
    """The rig with friction, ripple and a gain at drawn places, and start angles."""

    def drawn(id, *places, **low_and_high):
        values = {k: jnp.asarray(rng.uniform(*v)) for k, v in low_and_high.items()}
        return laws.EFFECTS[id](**values), str(rng.choice(places))

    wheels = (*rig.names, "all")
    for law, place in [
        drawn("bearing-viscous", *wheels, b=(0.01, 0.05)),
        drawn("bearing-coulomb", *wheels, torque=(0.05, 0.2)),
        drawn("motor-gain", *rig.names, g=(-0.3, 0.3)),
        drawn("load-friction", *wheels, mu=(0.1, 0.4)),
        drawn("current-ripple", *rig.names, g=(0.1, 0.4), order=(1, 9), phase=(0, 6)),
        drawn("rolling-resistance", "all", arm=(1e-4, 1e-3)),
    ]:
        rig = rig.add(law, place)
    return rig, rng.uniform(0, 6, 3)


def test_the_torques_of_prescribed_speeds_spin_the_machine_up_as_prescribed(rig):
    """They were those of a machine without friction in its bearings, nor motors off their gain."""
    rng = drawn_anew("torques of prescribed speeds at a moment")
    made, angles = opposed(rig, rng)
    model = Model(Coupled(made), keep_radius_rate=True)  # as the prescribed speeds have it
    still = Inputs(jnp.zeros(3), jnp.ones(3), jnp.zeros(()))
    state = state_of(made, start_vector(made, torques([0.0] * 3, initial_angle=angles)))
    turning = jnp.asarray(rng.uniform(-4, 4, 3)), jnp.asarray(rng.uniform(-40, 40, 3))
    now, _, omega = prescribed_instant(model, state, still, *turning)
    torque = motor_torque(made, now, state.angle, omega, state.attitude)
    under = instant(model, state._replace(angular_velocity=omega), still._replace(torque=torque))
    for name in ("shaft_torque", "angular_acceleration", "drive_force"):
        np.testing.assert_allclose(getattr(under, name), getattr(now, name), rtol=1e-8, atol=1e-10)
    assert np.abs(torque - now.shaft_torque).max() > 1e-3


@pytest.mark.full  # in the gate at a moment, above
def test_the_torques_of_prescribed_speeds_drive_the_machine_at_these_speeds(rig):
    rng = drawn_anew("torques of prescribed speeds")
    made, angles = opposed(rig, rng)
    ends, after = rng.uniform(-4, 4, (2, 3))
    ts = np.linspace(0, 0.2, 801)
    drive = speeds(ramp(0.0, 0.2, ends, after), initial_angle=angles)
    run = simulate(made, drive, ts)
    again = simulate(
        made,
        torques(table(ts, run.torque), initial_angle=run.theta[0], initial_velocity=run.Omega[0]),
        ts,
    )
    assert np.abs(again.omega - run.omega).max() < 1e-2
    assert np.abs(run.torque - run.shaft_torque).max() > 0.05


def test_a_run_that_begins_rolling_says_so(run):
    recording = to_recording(run)
    rng = np.random.default_rng(5)
    for axis in "xyz":
        recording.channels[f"Omega_{axis}"] += 1e-4 * rng.standard_normal(60)
    drive = drive_from_recording(recording)
    np.testing.assert_allclose(drive.initial_velocity, run.Omega[0], atol=4e-4)
    for axis in "xyz":
        recording.channels[f"Omega_{axis}"] = 1e-4 * rng.standard_normal(60)
    assert drive_from_recording(recording).initial_velocity is None


def test_pictures_name_their_units(run):
    axes = run.plot_displacement()
    assert axes.get_ylabel() == "ΔR (µm)"
    np.testing.assert_allclose(axes.lines[0].get_ydata(), 1e6 * run.dR[:, 0])
    assert [line.get_label() for line in run.plot_channel("normal_force").lines] == list(run.names)
    with pytest.raises(ValueError, match="`name` must be one of"):
        run.plot_channel("torsion")


def test_wrong_files_are_refused(run, tmp_path):
    with pytest.raises(InputError, match=r"must end in one of \.nc, \.csv"):
        run.save(tmp_path / "run.txt")
    with pytest.raises(InputError, match=r"no such file"):
        Trajectory.load(tmp_path / "run.nc")
    with pytest.raises(InputError, match=r"is a recording, not a run"):
        Trajectory.load(run.save(tmp_path / "run.csv"))
    (tmp_path / "bad.nc").write_bytes(b"no")
    with pytest.raises(InputError, match=r"bad\.nc: is not a run of omnijax"):
        Trajectory.load(tmp_path / "bad.nc")


@pytest.mark.full  # in the gate three wheels, above; a run of four: test_afternoon
def test_machines_of_other_sizes_keep_their_wheels(run, tmp_path):
    two = {name: getattr(run, name)[:, :2] for name in PER_WHEEL}
    run = dataclasses.replace(run, names=run.names[:2], **two)
    recording = read_recording(run.save(tmp_path / "run.csv"))
    assert recording.wheels == 2
    np.testing.assert_array_equal(recording.torque, run.torque)


def one_bit(rng, content):
    """`content` with one bit flipped."""
    flipped = bytearray(content)
    flipped[rng.integers(len(content))] ^= 1 << int(rng.integers(8))
    return bytes(flipped)


@pytest.mark.parametrize("in_text, anywhere", [(1, 1), *more((2, 6))])
def test_a_bit_that_flips_in_a_file_is_noticed_wherever_it_stands(
    run, rig, tmp_path, capfd, in_text, anywhere
):
    rng = drawn_anew("a_bit_that_flips_in_a_file_is_noticed_wherever_it_stands")
    file = run.save(tmp_path / "a.nc", rig, command="omnijax simulate")
    right, content = load_netcdf(file), file.read_bytes()
    text = right.attrs["rig"].encode()  # of which HDF5 may leave a copy where nothing reads it
    cases = [(content.replace(text, one_bit(rng, text)), True) for _ in range(in_text)]
    cases += [(one_bit(rng, content), False) for _ in range(anywhere)]
    for flipped, surely in cases:
        file.write_bytes(flipped)
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always", DataWarning)
            try:
                found = load_netcdf(file)
            except InputError:
                continue
        assert told or (found.identical(right) and not surely)
    assert "ignored" not in capfd.readouterr().err
