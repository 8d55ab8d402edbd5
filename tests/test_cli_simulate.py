"""`omnijax simulate` as a user runs it: files, exit codes and messages."""

import json
import sys
from shutil import copytree

import numpy as np
import pytest

from omnijax import cli, evaluate, load_rig, load_trajectory, read_recording, simulation
from omnijax._files import pieces_folder
from omnijax.cli._inputs.drive import asked
from omnijax.cli._inputs.motion import MotionOptions
from omnijax.cli._simulate.summary import not_believed
from omnijax.dynamics import mobility
from omnijax.simulation import SpeedDrive
from omnijax.simulation._solve import solve as _solve

pytestmark = pytest.mark.brief

SHORT = ["--duration", "100ms", "--rate", "1kHz"]


def run(capsys, *arguments):
    code = cli.run(["simulate", *map(str, arguments)])
    captured = capsys.readouterr()
    return code, captured.out, captured.err


def test_a_run_is_summarised_saved_and_drawn(capsys, tmp_path):
    out, plot = tmp_path / "new" / "run.nc", tmp_path / "run.svg"
    speed = ["--speed", "0.1,30 rpm,0.3"]
    code, said, _ = run(capsys, "atlas", *speed, *SHORT, "--out", out, "--plot", plot, "--json")
    summary = json.loads(said)
    trajectory = load_trajectory(out)
    assert code == 0
    assert summary["status"] == "ok"
    assert summary["samples"] == len(trajectory.t) == 101
    np.testing.assert_allclose(trajectory.omega[5], [0.1, np.pi, 0.3], rtol=1e-12)
    assert summary["peak"] >= float(np.max(trajectory.distance))  # it may lie between samples
    assert summary["peak"] == pytest.approx(
        float(evaluate(trajectory, load_rig("atlas"), ("peak",))["peak"]), rel=1e-12
    )
    assert "ΔR (µm)" in plot.read_text(encoding="utf-8")


@pytest.mark.full  # in the gate: test_trajectory_files, test_files
def test_a_recording_drives_and_the_run_is_a_recording_again(capsys, tmp_path):
    given = tmp_path / "given.csv"
    t = np.arange(21) * 2e-3
    rows = [f"{x},{0.2 * x},0.1,-0.1,1.0,2.0,3.0" for x in t]
    header = "t,torque_1,torque_2,torque_3,theta_1,theta_2,theta_3"
    given.write_text("\n".join([header, *rows]))
    out = tmp_path / "out.csv.gz"
    code, _, _ = run(capsys, "atlas", "--drive", given, "--out", out)
    again = read_recording(out)
    assert code == 0
    assert again.faults == []
    np.testing.assert_allclose(again.time, t)
    np.testing.assert_allclose(again.group("theta")[0], [1.0, 2.0, 3.0])
    np.testing.assert_allclose(again.torque[:, 0], 0.2 * t)
    assert again.declared_noise("dR_x") == 0
    assert again.rig_path.is_file()  # of a bundled rig, a copy beside the run


@pytest.mark.full  # in the gate a design that ends at the step limit, run again: test_sweep
def test_a_failed_run_keeps_what_was_computed(capsys, tmp_path):
    out = tmp_path / "run.nc"
    arguments = ["--torque", "0.1,0.2,0.3", "--duration", "0.5", "--max-steps", "40"]
    code, said, error = run(capsys, "atlas", *arguments, "--out", out)
    kept = load_trajectory(out)
    assert code == 1
    assert "step limit after" in said
    assert "raise `max_steps`" in error
    assert 0 < kept.time_reached < 0.5


@pytest.mark.full  # in the gate killed runs that go on: test_files
def test_an_interrupted_run_is_kept_and_goes_on(capsys, tmp_path, monkeypatch):
    whole, parts = tmp_path / "whole.nc", tmp_path / "parts.nc"
    arguments = ["atlas", "--torque", "0.1,0.2,0.3", "--duration", "60ms", "--rate", "20kHz"]
    one = ["simulate", *arguments, "--out", str(whole)]
    two = ["simulate", *arguments, "--out", str(parts)]
    monkeypatch.setattr("sys.argv", ["omnijax", *two])
    assert cli.run(one) == 0
    with monkeypatch.context() as patch:
        patch.setattr(simulation, "solve_in_pieces", interrupted_after(2, _solve.solve_in_pieces))
        code = cli.run(two)
    said = capsys.readouterr().err
    assert (code, parts.exists()) == (130, False)
    assert f"Interrupted after 0.04995 s: what was computed is in {parts}.pieces" in said
    assert f"{parts} --resume" in said
    pieces = copytree(pieces_folder(parts), tmp_path / "pieces")
    capsys.readouterr()
    assert cli.run([*two, "--resume"]) == 0
    summary = capsys.readouterr().out
    left, right = load_trajectory(whole), load_trajectory(parts)
    for name in left.UNITS:
        np.testing.assert_array_equal(getattr(left, name), getattr(right, name))
    stamp = parts.stat().st_mtime_ns
    assert cli.run([*two, "--resume"]) == 0  # whole: it is shown, as a study's result is
    assert capsys.readouterr().out == summary
    assert parts.stat().st_mtime_ns == stamp
    copytree(pieces, pieces_folder(parts))  # a kill came before they were removed
    assert cli.run([*two, "--resume"]) == 0
    assert capsys.readouterr().out == summary
    assert not pieces_folder(parts).exists()


@pytest.mark.full  # in the gate killed runs: test_files
def test_an_interruption_behind_the_run_says_which_file_is_missing(capsys, tmp_path, monkeypatch):
    """It said `Interrupted after 8 s` of a run of 8 s."""
    out, plot = tmp_path / "run.nc", tmp_path / "run.svg"
    arguments = ["atlas", "--torque", "0.1,0.2,0.3", "--duration", "60ms", "--rate", "20kHz"]
    command = ["simulate", *arguments, "--out", str(out), "--plot", str(plot)]
    monkeypatch.setattr("sys.argv", ["omnijax", *command])

    def interrupted(*_, **__):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(simulation, "save_trajectory", interrupted)
        assert cli.run(command) == 130
    said = capsys.readouterr().err
    assert f"Interrupted: the run is whole in {out}.pieces. Missing: {out}, {plot}. This" in said
    with monkeypatch.context() as patch:
        patch.setattr(sys.modules["omnijax.cli.simulate"], "_plot", interrupted)
        assert cli.run([*command, "--resume"]) == 130
    said = capsys.readouterr().err
    assert f"Interrupted: {out} is written. Missing: {plot}. This writes it: " in said
    assert said.rstrip().endswith(f"--plot {plot} --resume")
    assert cli.run([*command, "--resume"]) == 0 and plot.exists()


def test_a_run_that_loses_contact_says_from_when_on_it_is_not_to_be_believed():
    """The figures of the whole run stood there without a word."""
    lifts, slips = ({"kind": k, "wheel": "w2"} for k in ("lifts off", "slips"))
    law = [{"id": "lift-off", "place": "w2"}]

    def told(*contacts, effects=()):
        return not_believed({"contacts": list(contacts), "effects": list(effects)})

    alone = told(lifts | {"time": 0.25}, slips | {"time": 0.5})
    assert alone.startswith("From t = 0.25 s on this run is not to be believed")
    assert alone.endswith("Add the effect `lift-off` at w2.")
    assert told(lifts | {"time": 0.25}, slips | {"time": 0.25}, effects=law) == ""
    early = told(slips | {"time": 0.1}, lifts | {"time": 0.25}, effects=law)
    assert early.startswith("From t = 0.1 s on") and "lift-off" not in early
    other = [{"id": "lift-off", "place": "w1"}]
    assert told(lifts | {"time": 0.25}, effects=other) == told(lifts | {"time": 0.25})
    assert told() == ""


def interrupted_after(count, pieces):
    def interrupted(*arguments, **options):
        for i, piece in enumerate(pieces(*arguments, **options)):
            if i == count:
                raise KeyboardInterrupt
            yield piece

    return interrupted


@pytest.mark.full  # in the gate: test_files, and of studies test_study_resume
def test_only_the_same_run_goes_on(capsys, tmp_path, monkeypatch):
    out = tmp_path / "run.nc"
    times = ["--duration", "60ms", "--rate", "20kHz", "--out", out]
    monkeypatch.setattr("sys.argv", ["omnijax", "simulate", "atlas", "and", "more"])
    with monkeypatch.context() as patch:
        patch.setattr(simulation, "solve_in_pieces", interrupted_after(1, _solve.solve_in_pieces))
        assert run(capsys, "atlas", "--torque", "0.1,0.2,0.3", *times)[0] == 130
    code, _, error = run(capsys, "atlas", "--torque", "0.1,0.2,0.4", *times, "--resume")
    assert code == 2
    assert "run.nc.pieces: holds another run and is left as it is" in error
    assert "drive.torque.values: [[0.1, 0.2, 0.3]] -> [[0.1, 0.2, 0.4]]" in error


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--speed", "0.1,1e30,1"], "`speed` must lie in [-1e+06, 1e+06] rad/s, but is 1e+30."),
        (["--speed", "0.1,1.2"], "`speed` has 2 values, but the rig has 3 wheels."),
        (["--speed", "0.1,1.2,x"], "`speed` must be a number in rad/s"),
        (["--speed", "1 m,1,1"], "`speed` must be a number in rad/s"),
        (["--torque", "1,1,1", "--force", "1,2"], "`force` has 2 values, but it needs 3"),
        (["--speed", "1,1,1", "--duration", "-1"], "`duration` must lie in (0, inf) s, but is -1."),
        (["--speed", "1,1,1", "--out", "run.txt"], "`run.txt` must end in one of .nc, .csv"),
        (["--speed", "1,1,1", "--plot", "run.bmp"], "`run.bmp` must end in one of .png"),
        (["--speed", "1,1,1", "--torque", "1,1,1"], "but --speed and --torque are given"),
        (["--torque", "1,1,1", "--solver", "exact"], "`solver` cannot be exact"),
        (["--speed", "1,1,1", "--rtol", "-1"], "`rtol` must lie in (0, 0.01], but is -1."),
        (["--speed", "1,1,1", "--max-steps", "0"], "`max-steps` must be at least 1, but is 0."),
        (["--torque", "1,1,1", "--resume"], "`resume` needs the interrupted run"),
        (["--drive", "nowhere.csv"], "nowhere.csv: there is no such file"),
        (["--drive", "."], ".: is a folder, not a file."),
        (
            ["--speed", "0..x,1,1"],
            "`speed` must be a number in rad/s or text with such a unit, but is 'x'.",
        ),
        (["--speed", "1,1,1", "extra"], "not expected here: extra."),
    ],
)
def test_wrong_input_is_one_message_and_code_2(capsys, arguments, message):
    code, _, error = run(capsys, "atlas", *arguments)
    assert code == 2
    assert message in error
    assert "Traceback" not in error


def test_the_sphere_a_ramp_and_a_table_of_speeds_are_the_same_speeds(tmp_path):
    """Atlas: wheel i turns axis i alone, omega_i = R / r_b Omega_i up to the axis."""
    rig, up = load_rig("atlas"), tmp_path / "up.csv"
    up.write_text("t (ms),speed_w1 [rpm],speed_2,speed_w3\n0,0,1,-2\n100,30,1,2\n")
    ends = [mobility(rig).to_sphere @ [x, 1, y] for x, y in ((0, -2), (np.pi, 2))]
    omega = ",".join(f"{a!r}..{b!r}" for a, b in zip(*(e.tolist() for e in ends), strict=True))
    for motion, file in (
        (MotionOptions(speed="0..30 rpm,1,-2..2", duration="100 ms"), None),
        (MotionOptions(omega=omega, duration="100 ms"), None),
        (MotionOptions(), up),
    ):
        drive = asked(rig, motion, file).drive
        assert isinstance(drive, SpeedDrive)
        for share in (0.0, 0.3, 1.0):
            wanted = [share * np.pi, 1, -2 + 4 * share]
            np.testing.assert_allclose(drive.speed(0.1 * share), wanted, rtol=1e-9, atol=1e-12)


@pytest.mark.full  # in the gate their speeds, above
def test_the_sphere_a_ramp_and_a_table_of_speeds_are_the_same_drive(capsys, tmp_path):
    """Atlas: wheel i turns axis i alone, omega_i = R / r_b Omega_i up to the axis."""
    ramp, table, sphere = (tmp_path / f"{x}.nc" for x in ("ramp", "table", "sphere"))
    up = tmp_path / "up.csv"
    up.write_text("t (ms),speed_w1 [rpm],speed_2,speed_w3\n0,0,1,-2\n100,30,1,2\n")
    speed = ["--speed", "0..30 rpm,1,-2..2"]
    assert run(capsys, "atlas", *speed, *SHORT, "--out", ramp)[0] == 0
    assert run(capsys, "atlas", "--drive", up, "--rate", "1kHz", "--out", table)[0] == 0
    first, second = load_trajectory(ramp), load_trajectory(table)
    np.testing.assert_allclose(first.omega[-1], [np.pi, 1, 2], rtol=1e-9)
    np.testing.assert_allclose(first.dR, second.dR, atol=1e-12)
    rig = load_rig("atlas")
    ends = [mobility(rig).to_sphere @ [x, 1, y] for x, y in ((0, -2), (np.pi, 2))]
    omega = ",".join(f"{a!r}..{b!r}" for a, b in zip(*(e.tolist() for e in ends), strict=True))
    assert run(capsys, "atlas", "--omega", omega, *SHORT, "--out", sphere)[0] == 0
    np.testing.assert_allclose(load_trajectory(sphere).dR, first.dR, atol=1e-12)


def test_a_measured_run_is_laid_over(capsys, tmp_path):
    measured, plot = tmp_path / "m.csv", tmp_path / "both.svg"
    speed = ["--speed", "0.1,-1,0.3"]
    assert run(capsys, "atlas", *speed, *SHORT, "--out", measured)[0] == 0
    arguments = ["atlas", *speed, *SHORT, "--compare", measured, "--json"]
    code, said, _ = run(capsys, *arguments, "--plot", plot)
    found = json.loads(said)["differences"]
    assert code == 0 and "measured" in plot.read_text(encoding="utf-8")
    assert found["dR_x"]["rms"] <= 1e-15 < found["dR_x"]["rms_measured"]
    code, said, _ = run(capsys, *arguments[:1], "--speed", "0.1,-1.1,0.3", *arguments[3:], "--plot",
                        plot, "--overwrite")  # fmt: skip
    assert json.loads(said)["differences"]["theta_2"]["rms"] == pytest.approx(
        0.1 * np.sqrt(np.mean(np.linspace(0, 0.1, 101) ** 2)), rel=1e-6
    )
    assert run(capsys, *arguments)[0] == 2


@pytest.mark.parametrize(
    ("table", "sentence"),
    [
        (
            "t,speed_1,speed_2\n0,1,1\n1,1,1\n",
            "lacks the column `speed_3` of a table of speeds; columns: t, speed_1, speed_2.",
        ),
        ("t,speed_1,speed_2,speed_3\n0,1,1,1\n1,,1,1\n", "column `speed_1`, row 2 has no number"),
        (
            "t,speed_1,speed_2,speed_3\n1,1,1,1\n0,1,1,1\n",
            "must not decrease, but row 2 has 0 after 1.",
        ),
        ("t,speed_1,speed_2,speed_3\n3,1,1,1\n3,2,1,1\n", "`t` must reach beyond its first"),
        ("t,speed_1 (kg),speed_2,speed_3\n0,1,1,1\n1,1,1,1\n", "'kg' is no unit of rad/s"),
    ],
)
def test_a_table_that_is_no_drive_is_refused(capsys, tmp_path, table, sentence):
    (tmp_path / "up.csv").write_text(table)
    code, _, error = run(capsys, "atlas", "--drive", tmp_path / "up.csv")
    assert code == 2 and sentence in error
