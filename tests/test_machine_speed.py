"""Axes whose log has a speed and no position: tachometers, rates of a drive's controller."""

from types import SimpleNamespace
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.signal import lfilter

from omnijax import cli
from omnijax.diagnosis import Point, Prior, Search, SmallModel, diagnose
from omnijax.diagnosis._search.fit import refit
from omnijax.diagnosis._search.starts import at_finite_strength, promising, without_strength
from omnijax.laws import BearingCoulomb, SensorRectified, SensorSignal
from omnijax.machine import (
    Axis,
    guess,
    loses_sign,
    numbers_of_logs,
    read_machine_case,
    travelled,
)
from omnijax.rig import InputError
from tests.seeds import drawn_anew

STEP = 4e-3
NOISE = 0.02  # rad/s


def rubbing_motor(rng, coulomb=0.12, count=2500):
    """(t, input, speed): v' = (u - v/2)/J less dry friction, J = 0.04, exactly by small steps."""
    t = np.arange(count) * STEP
    f, p = np.exp(rng.uniform(np.log(0.15), np.log(1.2), 5)), rng.uniform(0, 6, 5)
    u, v, out = np.sin(2 * np.pi * np.outer(t, f) + p).sum(1) / 2, 0.0, []
    for k in range(count):
        out.append(v)
        for j in range(8):  # linear between samples
            now = u[k] + (u[min(k + 1, count - 1)] - u[k]) * j / 8
            v += STEP / 8 * (now - v / 2 - coulomb * np.tanh(v / 0.02)) / 0.04
    return t, u, np.array(out)


def written(path, t, u, speed_rpm):
    """A log with milliseconds and revolutions a minute."""
    table = np.stack([1e3 * t, u, speed_rpm], 1)
    np.savetxt(path, table, delimiter=",", header="Time [ms],Voltage [V],Motor speed [rpm]",
               comments="", fmt="%.9g")  # fmt: skip
    return path


def new_case(tmp_path, *more):
    rng = drawn_anew("speed alone")
    t, u, v = rubbing_motor(rng)
    rpm = (v + NOISE * rng.normal(size=len(v))) * 60 / (2 * np.pi)
    log = written(tmp_path / "motor.csv", t, u, rpm)
    out = tmp_path / "case"
    assert cli.run(["case", "new", str(log), "--out", str(out), "--yes", *more]) == 0
    return out, v


def test_a_log_of_a_speed_alone_is_guessed(tmp_path):
    folder, v = new_case(tmp_path)
    one = guess(tmp_path / "motor.csv")
    assert (one.position, one.velocity, one.units["velocity"]) == (None, "Motor speed [rpm]", "rpm")
    assert one.noise == pytest.approx(NOISE, rel=0.1)
    case = read_machine_case(folder)
    axis: Any = case.file.machine
    assert float(axis.inertia) == pytest.approx(0.04, rel=0.3)
    log = case.logs[0]
    assert log.measured == "velocity"
    shown = log.shown
    assert np.std(shown - v[: len(shown)]) == pytest.approx(NOISE, rel=0.1)
    np.testing.assert_allclose(log.outputs["position"], travelled(shown, STEP))
    assert log.start["position"] == (0.0, shown[0])


def test_dry_friction_is_named_from_a_speed_alone(tmp_path):
    found = diagnose(new_case(tmp_path)[0])
    assert [e.id for e in found.effects] == ["bearing-coulomb"], found
    torque = found.effects[0].parameters["torque"]
    assert abs(torque["value"] - 0.12) < 4 * torque["sigma"] + 0.004
    runs = found.free_runs
    assert {r["unit"] for r in runs} == {"rad/s"}
    assert runs[0]["after"]["rms"] < 2 * NOISE < runs[0]["before"]["rms"] / 2


def test_a_speed_forgets_its_start_where_the_position_does_not():
    numbers: Any = {"inertia": 2.0, "damping": 0.5}
    axis = Axis(**numbers)
    assert axis.memory() == np.inf
    assert axis.speed_memory() == pytest.approx(7 * 4.0)
    pulled = Axis(**numbers, stiffness=jnp.asarray(3.0))
    assert pulled.speed_memory() == pytest.approx(pulled.memory())


def test_columns_that_are_named_leave_the_others_to_be_looked_for(tmp_path):
    """The time is still found where input and output are named: it was taken for 1 s a row."""
    folder, _ = new_case(tmp_path, "--input", "Voltage [V]", "--velocity", "Motor speed [rpm]")
    assert read_machine_case(folder).logs[0].step == pytest.approx(STEP)


def test_stamps_of_a_coarse_clock_repeat(tmp_path):
    t = np.round(np.arange(800) * 1.6e-3, 3)
    t[300] = t[299]
    table = np.stack([t, np.sin(t), np.cos(3 * t)], 1)
    np.savetxt(tmp_path / "a.csv", table, delimiter=",", header="stamp,u,angle", comments="")
    assert guess(tmp_path / "a.csv").time == "stamp"
    table[:, 0] = np.floor(t)
    np.savetxt(tmp_path / "a.csv", table, delimiter=",", header="stamp,u,angle", comments="")
    with pytest.raises(InputError, match=r"'stamp'.*does not increase.*--rate"):
        guess(tmp_path / "a.csv")


def test_one_case_has_positions_or_speeds(tmp_path, capsys):
    folder, v = new_case(tmp_path)
    t = np.arange(len(v)) * STEP
    table = np.stack([t, np.sin(t), travelled(v, STEP)], 1)
    np.savetxt(folder / "b.csv", table, delimiter=",", header="t,input,position", comments="")
    with pytest.raises(InputError, match="some logs give the position"):
        diagnose(folder)
    logs = [str(tmp_path / "motor.csv"), str(folder / "b.csv")]
    assert cli.run(["case", "new", *logs, "--out", str(tmp_path / "c"), "--yes"]) == 2
    assert "some logs give a position" in capsys.readouterr().err


def test_a_goal_of_a_speed_is_no_goal_of_a_position(tmp_path, capsys):
    t = np.arange(200) * STEP
    table = np.stack([t, np.sin(t), np.cos(t)], 1)
    for header in ("t,speed_ref,speed", "t,omega_setpoint,angle"):
        np.savetxt(tmp_path / "a.csv", table, delimiter=",", header=header, comments="")
        assert cli.run(["case", "new", str(tmp_path / "a.csv"), "--yes"]) == 2
        shown = capsys.readouterr().err
        assert "not for a speed" in shown and len(shown.strip().splitlines()) == 1


def counted(path, rng):
    """A log of a counter of pulses, 600 samples at 50 Hz: |v| of J v' + d v = u, J = 0.5, d = 1."""
    t = np.arange(600) * 0.02
    u = np.repeat(rng.uniform(-1, 1, 60), 10)  # held: exact from sample to sample
    v = np.asarray(lfilter([0, 1 - np.exp(-0.04)], [1, -np.exp(-0.04)], u))
    z = np.abs(v) + 2e-3 * rng.normal(size=len(v))
    header = "time,Vin,z1"
    np.savetxt(path, np.stack([t, u, z], 1), delimiter=",", header=header, comments="")
    return u, v, z


def test_a_counter_that_loses_the_sign_is_told_and_still_gives_numbers(tmp_path):
    rng = drawn_anew("counter")
    u, v, z = counted(tmp_path / "a.csv", rng)
    assert loses_sign(z, u) and not loses_sign(v, u)
    assert not loses_sign(np.abs(v) + 1, u)  # turned one way by something else: never at rest
    assert not loses_sign(z, np.abs(u))
    numbers = numbers_of_logs([guess(tmp_path / "a.csv")])
    assert numbers["inertia"] == pytest.approx(0.5, rel=0.1)
    assert numbers["damping"] == pytest.approx(1.0, rel=0.1)


def test_what_has_no_strength_and_changes_nothing_where_a_fit_ends_is_tried_all_the_same():
    def scored(id, dead, gain):
        candidate = SimpleNamespace(id=id, name=id)
        return SimpleNamespace(dead=dead, allowed=not dead, gain=gain, candidate=candidate)

    model: Any = SimpleNamespace(
        laws={"sensor-rectified": SensorRectified, "bearing-coulomb": BearingCoulomb}
    )
    ids = without_strength(model)
    assert ids == {"sensor-rectified"}
    scores = [scored("sensor-rectified", True, 0.0), scored("bearing-coulomb", False, 9.0)]
    scan: Any = SimpleNamespace(scores=scores)
    assert promising(scan, ids, 0.5) == scores[:1]


@pytest.mark.parametrize("weaker", [1.0, 0.4])
def test_a_calibration_that_foretells_one_sign_hides_no_sensor_that_loses_it(weaker):
    """A small gain beside an offset fits |s| best: there losing the sign changes nothing.

    Little, where the speed is weaker that way: some samples are then foretold of the other sign.
    """
    rng = drawn_anew("one sign") if weaker == 1 else np.random.default_rng(11)
    t, f, p = 0.02 * np.arange(400), rng.uniform(0.1, 0.6, 4), rng.uniform(0, 6, 4)
    s = np.sin(2 * np.pi * np.outer(t, f) + p).sum(1)
    s = np.where(s < 0, weaker * s, s)
    shown = np.abs(s) + 0.01 * rng.normal(size=len(t))

    def residual(numbers, laws, split):
        speed = numbers["gain"] * s + numbers["offset"]
        for law in laws:
            speed = speed + np.asarray(law(SensorSignal(t, speed[:, None])))[:, 0]
        return (shown - speed) / 0.01

    priors = [Prior("gain", 1.0, 1.0, relative=False), Prior("offset", 0.0, 1.0, relative=False)]
    model = SmallModel(residual, priors, {"sensor-rectified": SensorRectified}, "velocity")
    fit = refit(model, Point(np.zeros(2)))
    assert np.max(np.abs(fit.point.u)) < model.settings.bent_sigmas
    scan, _ = Search(model).scan(fit)
    assert [score.dead for score in scan.scores] == [weaker == 1]
    (start,) = at_finite_strength(model, fit, scan.scores, set(model.laws))
    assert start.cost < 1e-2 * fit.cost


@pytest.mark.full
def test_a_sensor_that_loses_the_sign_is_named(tmp_path):
    counted(tmp_path / "a.csv", drawn_anew("counter named"))
    out = tmp_path / "case"
    assert cli.run(["case", "new", str(tmp_path / "a.csv"), "--out", str(out), "--yes"]) == 0
    found = diagnose(out)
    assert [(e.id, e.place) for e in found.effects] == [("sensor-rectified", "velocity")], found
