"""What `case new` guesses of an axis from all its logs, and the schema of what it writes."""

import re
import tomllib
from importlib import resources
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest

from omnijax import cli
from omnijax.machine import (
    guess,
    load_machine,
    machine_schema,
    machine_text,
    parse_machine,
    read_machine_case,
)
from omnijax.rig import InputError
from tests.seeds import drawn_anew

STEP = 5e-3
VALIDATOR = jsonschema.Draft202012Validator(machine_schema())


def stepped(rate, start, inputs, fine=8):
    """States (t, n) by Runge-Kutta steps, the inputs (t,) held: no code of the library."""
    x, out, h = np.array(start, float), [], STEP / fine
    for u in inputs:
        out.append(x)
        for _ in range(fine):
            k1 = rate(x, u)
            k2 = rate(x + h / 2 * k1, u)
            k3 = rate(x + h / 2 * k2, u)
            x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + rate(x + h * k3, u))
    return np.array(out)


def written(path, columns):
    """A log as CSV."""
    names = ",".join(columns)
    np.savetxt(path, np.stack(list(columns.values()), 1), delimiter=",", header=names, comments="")
    return str(path)


def new_case(folder, logs, *more) -> Any:
    """The machine file of `case new`."""
    assert cli.run(["case", "new", *logs, "--out", str(folder / "case"), "--yes", *more]) == 0
    text = (folder / "case" / "machine.toml").read_text()
    assert text.startswith("#:schema ./machine.schema.json\n")
    VALIDATOR.validate(tomllib.loads(text))
    return load_machine(folder / "case" / "machine.toml").machine


def test_a_servo_that_saturates_and_rubs_is_guessed_from_all_its_logs(tmp_path):
    rng = drawn_anew("guessed servo")
    w, d, g, c = rng.uniform(8, 14), rng.uniform(3, 6), rng.uniform(20, 50), rng.uniform(3, 6)
    limit, t, logs = rng.uniform(40, 60), np.arange(1200) * STEP, []
    for k, kp in enumerate((1.0, 2.0, 4.0)):
        goal = rng.uniform(0.7, 1.2) * np.sin(2 * np.pi * rng.uniform(0.3, 0.5) * t + 0.25 * t**2)
        goal = goal + 0.4 * np.sign(np.sin(2 * np.pi * rng.uniform(0.3, 0.5) * t))
        if k == 0:  # a log in which next to nothing happens spoils nothing
            goal = 0.02 * goal

        def rate(x, u, kp=kp):
            motor = np.clip(kp * w**2 * (u - x[0]), -limit, limit)
            return np.array([x[1], motor - d * x[1] - g * np.sin(x[0]) - c * np.tanh(x[1] / 0.05)])

        q = stepped(rate, [0.0, 0.0], goal)[:, 0] + 1e-4 * rng.normal(size=len(t))
        columns = {"time": t, "goal_rad": goal, "angle_rad": q, "kp": np.full(len(t), 100 * kp)}
        logs.append(written(tmp_path / f"{k}.csv", columns))
    axis = new_case(tmp_path, logs)
    for field, true in (("gain", w**2 / 100), ("limit", limit), ("gravity", g)):
        assert float(getattr(axis, field)) == pytest.approx(true, rel=0.5), field
    assert float(axis.coulomb) == 0  # the diagnosis names it


def coupled_drive(rng, ratio, fastest=2.5, dry=0.0):
    """(columns, J, J2, k): motor and load of an elastic drive, the load by a gear `ratio`.

    The torque's sines have up to `fastest` Hz; `dry` friction of the motor is in their size.
    """
    J, d = 10 ** rng.uniform(-3, -2), rng.uniform(0.5, 2)
    J2, k = J * rng.uniform(0.7, 3), J * (2 * np.pi * rng.uniform(6, 12)) ** 2
    t = np.arange(2400) * STEP
    f, p = rng.uniform(0.2, fastest, 5), rng.uniform(0, 6, 5)
    u = 40 * J * np.sin(2 * np.pi * np.outer(t, f) + p).sum(1)

    def rate(x, u):
        drive = k * (x[0] - x[2]) + 1e-3 * k * (x[1] - x[3])
        rubs = 60 * J * dry * np.tanh(x[1] / 0.3)
        return np.array([x[1], (u - d * J * x[1] - rubs - drive) / J, x[3], drive / J2])

    q, _, q2, _ = stepped(rate, np.zeros(4), u).T
    q, q2 = (np.round(x / 1e-4) * 1e-4 for x in (q, 0.3 + q2 / ratio))
    return {"t": t, "torque": u, "pos_load": q2, "pos_motor": q}, J, J2, k


@pytest.mark.parametrize(("ratio", "dry"), [(1.0, 0.0), (4.0, 0.0), (1.0, 0.4)])
def test_motor_and_load_of_one_log_are_a_coupled_drive(tmp_path, capsys, ratio, dry):
    columns, J, J2, k = coupled_drive(drawn_anew("guessed drive"), ratio, dry=dry)
    log = written(tmp_path / "drive.csv", columns)
    axis = new_case(tmp_path, [log])
    assert "load behind a drive  pos_load" in capsys.readouterr().out
    one = guess(tmp_path / "drive.csv")
    assert (one.position, one.second) == ("pos_motor", "pos_load")  # the load's came first
    for field, true, some in (
        ("inertia", J, 0.5), ("second_inertia", J2, 0.3), ("second_stiffness", k, 0.3)
    ):  # fmt: skip
        assert float(getattr(axis, field)) == pytest.approx(true, rel=some), field


def test_a_second_reading_of_one_shaft_is_no_drive(tmp_path):
    """A coarse encoder beside a fine one moves against it, but by nothing that a torque does."""
    rng = drawn_anew("two encoders")
    columns, *_ = coupled_drive(rng, 1.0)
    coarse = np.round(columns["pos_motor"] / 5e-3) * 5e-3
    also = 1.003 * columns["pos_motor"] + 1e-3 * rng.normal(size=len(coarse))
    for name, second in (("coarse", coarse), ("also", also)):
        table = {k: columns[k] for k in ("t", "torque", "pos_motor")} | {"pos_2": second}
        written(tmp_path / f"{name}.csv", table)
        assert guess(tmp_path / f"{name}.csv").second is None, name


def test_a_servo_that_is_always_on_may_lose_its_speed_in_motor_or_bearing(tmp_path):
    """A back EMF lessens the load of the gear, a damping does not: both are left open."""
    rng = drawn_anew("guessed back EMF")
    w, e, t = rng.uniform(10, 16), rng.uniform(10, 20), np.arange(1500) * STEP
    goal = 0.8 * np.sign(np.sin(2 * np.pi * rng.uniform(0.3, 0.5) * t))
    q = stepped(lambda x, u: np.array([x[1], w**2 * (u - x[0]) - e * x[1]]), [0.0, 0.0], goal)[:, 0]
    q = q + 1e-5 * rng.normal(size=len(t))
    log = written(tmp_path / "a.csv", {"time": t, "goal_rad": goal, "angle_rad": q})
    axis = new_case(tmp_path, [log])
    assert float(axis.damping) + float(axis.back_emf) == pytest.approx(e, rel=0.2)
    assert min(float(axis.damping), float(axis.back_emf)) > 0.3 * e
    unsure = load_machine(tmp_path / "case" / "machine.toml").uncertainty
    assert {"damping", "back_emf"} <= set(unsure)


def test_a_pendulum_is_told_from_a_spring(tmp_path):
    rng = drawn_anew("guessed pendulum")
    J, w, t = 10 ** rng.uniform(-3, 0), rng.uniform(4, 8), np.arange(2000) * STEP
    u = J * w**2 * sum(0.4 * np.sin(2 * np.pi * f * t) for f in rng.uniform(0.2, 1.5, 3))
    for name, pull in (("gravity", np.sin), ("stiffness", lambda q: q)):

        def rate(x, u, pull=pull):
            return np.array([x[1], u / J - w**2 * pull(x[0]) - 0.8 * x[1]])

        q = stepped(rate, [0.0, 0.0], u)[:, 0] + 1e-4 * rng.normal(size=len(t))
        folder = tmp_path / name
        folder.mkdir()
        axis = new_case(folder, [written(folder / "a.csv", {"t": t, "torque": u, "angle": q})])
        other = {"gravity": "stiffness", "stiffness": "gravity"}[name]
        assert float(getattr(axis, name)) == pytest.approx(J * w**2, rel=0.1)
        assert float(getattr(axis, other)) == 0
        assert float(axis.inertia) == pytest.approx(J, rel=0.1)


def test_a_slide_in_millimetres_is_read_in_metres(tmp_path, capsys):
    rng = drawn_anew("guessed slide")
    M, d, t = 10 ** rng.uniform(0, 2), rng.uniform(0.5, 2), np.arange(800) * STEP
    u = 4 * M * np.sin(rng.uniform(2, 4) * t)
    q = stepped(lambda x, u: np.array([x[1], u / M - d * x[1]]), [0.0, 0.0], u)[:, 0]
    log = written(tmp_path / "a.csv", {"time_ms": 1e3 * t, "force_N": u, "pos_mm": 1e3 * q})
    axis = new_case(tmp_path, [log])
    assert (axis.motion, axis.outputs["position"]) == ("translation", "m")
    assert float(axis.inertia) == pytest.approx(M, rel=0.05)
    capsys.readouterr()
    machine = str(tmp_path / "case" / "machine.toml")
    assert cli.run(["simulate", machine, "--drive", str(tmp_path / "case" / "a.toml")]) == 0
    assert capsys.readouterr().out.strip().endswith(" m")


def test_numbers_of_a_log_in_milliamperes_are_those_of_one_in_amperes(tmp_path):
    rng = drawn_anew("milliamperes")
    t, current = np.arange(800) * STEP, np.cumsum(rng.normal(size=800)) / 10
    q = stepped(lambda x, u: np.array([x[1], 20 * u - x[1]]), (0.0, 0.0), current)[:, 0]
    found = []
    for column, factor in (("current_A", 1.0), ("current_mA", 1e3)):
        folder = tmp_path / column
        folder.mkdir()
        log = written(folder / "log.csv", {"t": t, column: factor * current, "angle": q})
        found.append(float(new_case(folder, [log]).inertia))
    assert found[1] == pytest.approx(found[0])


def test_effects_of_a_slide_have_the_units_of_a_slide():
    data = {"kind": "axis", "motion": "translation", "axis": {"inertia": 2.0},
            "motor": {"input": "torque"}}  # fmt: skip
    effect = {"id": "bearing-coulomb", "parameters": {"torque": "300 mN", "width": "2 mm/s"}}
    law: Any = parse_machine(data | {"effect": [effect]}).placed[0].law
    assert (float(law.torque), float(law.width)) == pytest.approx((0.3, 2e-3))
    with pytest.raises(InputError, match=r"effect.bearing-coulomb.torque.*N"):
        parse_machine(data | {"motion": "rotation", "effect": [effect]})


def test_the_schema_is_one_and_takes_what_the_reader_takes():
    jsonschema.Draft202012Validator.check_schema(machine_schema())
    text = (resources.files("omnijax") / "machine" / "data" / "machine.toml").read_text()
    assert text.startswith("#:schema ./machine.schema.json\n")
    every = "\n".join(re.sub(r"^# (?=\[|\w+ = )", "", x) for x in text.splitlines())
    for whole in (text, every):
        VALIDATOR.validate(tomllib.loads(whole))
        VALIDATOR.validate(tomllib.loads(machine_text(parse_machine(tomllib.loads(whole)))))
    assert set(tomllib.loads(every)) >= {"servo", "second"}


@pytest.mark.parametrize(
    "change",
    [
        {"axis": {"inertia": 0}}, {"axis": {}}, {"axis": {"inertia": 1, "mass": 2}},
        {"motor": {"input": "volts"}}, {"motor": {"input": "voltage"}},
        {"motor": {"input": "goal", "resistance": 1}}, {"uncertainty": {"axis.mass": 1}},
        {"effect": [{"id": "no-such"}]}, {"effect": [{"id": "bearing-coulomb"}]},
        {"effect": [{"id": "bearing-coulomb", "parameters": {"torque": 1, "speed": 1}}]},
        {"compare": {"criterion": "eye"}}, {"motion": "both"},
    ],
)  # fmt: skip
def test_what_the_reader_refuses_the_schema_refuses(change):
    good = {"kind": "axis", "axis": {"inertia": 1.0}, "motor": {"input": "torque"}}
    VALIDATOR.validate(good)
    parse_machine(good)
    assert not VALIDATOR.is_valid(good | change)
    with pytest.raises(InputError):
        parse_machine(good | change)


@pytest.mark.parametrize(
    ("rows", "still", "said"),
    [
        (30, None, "30 usable rows, but at least 64"), (400, "angle", "'angle'.*never changes"),
        (400, "torque", "'torque'.*never changes"), (400, "t", "looks like time.*--rate"),
    ],
)  # fmt: skip
def test_logs_that_say_nothing_are_one_sentence(tmp_path, capsys, rows, still, said):
    t = np.arange(rows) * STEP
    columns = {"t": t, "torque": np.sin(t), "angle": np.cos(3 * t)}
    if still is not None:
        columns[still] = np.ones(rows)
    log = written(tmp_path / "a.csv", columns)
    assert cli.run(["case", "new", log, "--out", str(tmp_path / "case"), "--yes"]) == 2
    shown = capsys.readouterr().err
    assert re.search(said, shown) and len(shown.strip().splitlines()) == 1, shown
    assert not (tmp_path / "case").exists()


@pytest.mark.parametrize(
    "names",
    [("t_s", "u_V", "x_mm"), ("t [s]", "u [V]", "q [deg]"), ("t[s]", "Vin", "encoder_counts")],
)
def test_short_names_with_units_are_known(tmp_path, names):
    rng, path = drawn_anew("short names"), tmp_path / "log.csv"
    t = np.arange(200) * 0.01
    table = np.stack([t, rng.normal(size=200), np.cumsum(rng.normal(size=200))], 1)
    np.savetxt(path, table, delimiter=",", header=",".join(names), comments="")
    one = guess(path)
    assert (one.time, one.input, one.position) == names


def test_an_inertia_is_guessed_right_from_a_coarse_encoder_at_a_high_rate(tmp_path):
    rng = drawn_anew("coarse")
    J, step = 10 ** rng.uniform(-4, -1), 5e-4
    t = np.arange(12000) * step
    w, p = 2 * np.pi * rng.uniform(0.2, 1.0, 3), rng.uniform(0, 6, 3)
    u, q, v = 30 * J * np.sin(np.outer(t, w) + p).sum(axis=1), [0.0], 0.0
    for k in range(len(t) - 1):  # held inputs and a damping of 1/s, exactly
        f, fade = u[k] / J, np.exp(-step)
        q.append(q[-1] + (v - f) * (1 - fade) + f * step)
        v = f + (v - f) * fade
    coarse = 2e-3 * np.std(q)
    log = written(tmp_path / "a.csv", {"t": t, "torque": u, "angle": np.round(q / coarse) * coarse})
    machine = new_case(tmp_path, [log])
    assert machine.inertia == pytest.approx(J, rel=0.1)
    assert machine.damping == pytest.approx(J, rel=0.2)


def test_a_controller_that_shows_no_limit_may_have_one(tmp_path):
    rng = drawn_anew("no limit")
    w, t = rng.uniform(8, 14), np.arange(1200) * STEP
    goal = rng.uniform(0.5, 1.0) * np.sin(2 * np.pi * (0.4 * t + 0.1 * t**2))
    q = stepped(lambda x, u: np.array([x[1], w**2 * (u - x[0]) - 1.4 * w * x[1]]), (0, 0), goal)[
        :, 0
    ]
    q = q + 1e-5 * rng.normal(size=len(q))
    table = {"t": t, "goal": goal, "angle": q}
    machine = new_case(tmp_path, [written(tmp_path / "a.csv", table)])
    file = load_machine(tmp_path / "case" / "machine.toml")
    most = float(machine.gain) * np.max(np.abs(goal - q))
    assert 0.8 * most < float(machine.limit) < 1.01 * most and file.uncertainty["limit"] > 0.1


@pytest.mark.parametrize(
    ("names", "drives"),
    [
        (("timestamp_us", "vel_ref_rpm", "iq_A", "rotor_angle_deg"), "current"),
        (("t", "torque_ref", "target_deg", "phi_mrad"), "torque"),
        (("t", "speed", "position_cmd_mm", "position_mm"), "goal"),
        (("Zeit [ms]", "Drehzahl_soll", "Spannung [mV]", "th"), "command"),
        (("t", "temperature", "F_N", "s_mm"), "torque"),
    ],
)
def test_what_drives_a_motor_is_told_by_unit_and_name(tmp_path, names, drives):
    """A goal of a speed is no input of an axis where there is another, nor a goal an output."""
    rng, path = drawn_anew("drives"), tmp_path / "log.csv"
    t = np.arange(200) * {"timestamp_us": 1e4, "Zeit [ms]": 10}.get(names[0], 0.01)
    table = np.stack([t, *rng.normal(size=(2, 200)), np.cumsum(rng.normal(size=200))], 1)
    np.savetxt(path, table, delimiter=",", header=",".join(names), comments="")
    one = guess(path)
    assert one.drives == drives
    assert one.input == next(k for k in names if k.split("_")[0] in (
        "iq", "torque", "position", "Spannung [mV]", "F"))  # fmt: skip
    assert one.position == names[-1]
    assert one.rate == pytest.approx(100)


@pytest.mark.parametrize(
    ("given", "shown", "motion", "left"),
    [
        ("force [kN]", "position", "translation", {}),
        ("force [kN]", "speed", "translation", {}),
        ("torque [Nm]", "position", "rotation", {}),
        ("force [kN]", "angle [rad]", "rotation", {"input": "kN"}),
        ("torque [Nm]", "position [mm]", "translation", {"input": "Nm"}),
        ("current [A]", "position [V]", "rotation", {"position": "V"}),
        ("u [V]", "position [mm]", "translation", {}),  # a command may be of any unit
    ],
)
def test_the_motion_is_told_by_either_unit_and_a_unit_that_cannot_be_is_said(
    tmp_path, given, shown, motion, left
):
    t = STEP * np.arange(400.0)
    log = written(tmp_path / "log.csv", {"t": t, given: np.sin(20 * t), shown: np.cos(20 * t)})
    one = guess(log)
    assert (one.motion, one.left) == (motion, left)
    said = " ".join(text for _, text in one.rows())
    assert all(f"{unit!r} is no unit of a {motion}'s {k}" in said for k, unit in left.items())
    assert ("is no unit" in said) == bool(left)


@pytest.mark.parametrize(
    ("shown", "unit", "refused"),
    [
        ("angle [deg]", "furlong", True),
        ("place [mm]", "deg", True),
        ("angle [deg]", "rad", False),
        ("angle", "furlong", False),
        ("angle [counts]", "360/4096 deg", False),
    ],
)
def test_a_unit_of_another_motion_than_the_log_says_is_refused(tmp_path, shown, unit, refused):
    """`--unit position=furlong` made a slide of a rotation in degrees, without a word."""
    t = STEP * np.arange(400.0)
    log = written(tmp_path / "log.csv", {"t": t, "u": np.sin(20 * t), shown: np.cos(20 * t)})
    if not refused:
        assert guess(log, units={"position": unit}).units["position"] == unit
        return
    told = rf"--unit position='{unit}' is the unit of a \w+, but the log says that .* is in '"
    with pytest.raises(InputError, match=told):
        guess(log, units={"position": unit})


def test_a_folder_with_files_is_refused_before_the_logs_are_looked_at(tmp_path, capsys):
    """It was said behind the whole analysis, and behind the question."""
    (tmp_path / "case").mkdir()
    (tmp_path / "case" / "notes.txt").write_text("mine")
    log = written(tmp_path / "log.csv", {"t": np.arange(9.0), "u": np.zeros(9)})  # useless
    assert cli.run(["case", "new", log, "--out", str(tmp_path / "case")]) == 2
    assert "case: is a folder with files in it" in capsys.readouterr().err


@pytest.mark.parametrize("unit", [1e3, 1e6, 1e9])
def test_a_clock_of_a_smaller_unit_is_known_by_its_steps(tmp_path, unit):
    t, rng = np.arange(200) * 0.004, drawn_anew("clock")
    table = {
        "t": 7 * unit + t * unit,
        "torque": rng.normal(size=200),
        "angle": rng.normal(size=200),
    }
    one = guess(Path(written(tmp_path / "a.csv", table)))
    assert one.rate == pytest.approx(250, rel=1e-3)


def test_an_angle_within_one_turn_goes_on_and_missing_samples_are_bridged(tmp_path):
    rng, t = drawn_anew("wrapped"), np.arange(4000) * STEP
    J, f, p = 10 ** rng.uniform(-3, -1), rng.uniform(0.1, 0.6, 3), rng.uniform(0, 6, 3)
    u = 12 * J * np.sin(2 * np.pi * np.outer(t, f) + p).sum(axis=1)
    q = stepped(lambda x, u: np.array([x[1], u / J - x[1]]), [0.0, 0.0], u, 2)[:, 0]
    u, q = (10 * np.pi / np.ptp(q) * x for x in (u, q))  # five turns
    degrees = (np.rad2deg(q) + 1e-2 * rng.normal(size=len(t))) % 360
    kept = rng.random(len(t)) > 0.03
    table = {"t": t, "torque": u, "angle_deg": degrees}
    log = written(tmp_path / "a.csv", {k: x[kept] for k, x in table.items()})
    assert float(new_case(tmp_path, [log]).inertia) == pytest.approx(J, rel=0.1)
    logs = read_machine_case(tmp_path / "case").logs
    assert [read.name for read in logs] == ["a train", "a held-out"]
    for read in logs:
        assert np.max(np.abs(np.diff(read.outputs["position"]))) < 1


def test_one_log_in_which_a_drive_is_bent_tells_that_all_are_of_a_coupled_drive(tmp_path):
    seed = 3  # one in five plants has its drive bent too little beside the drift in all logs
    columns, J, J2, _ = coupled_drive(np.random.default_rng(seed), 1.0)
    slow = coupled_drive(np.random.default_rng(seed), 1.0, fastest=0.25)[0]
    drift = np.std(slow["torque"]) * np.sin(2 * np.pi * 0.37 * slow["t"])  # of a sensor
    slow |= {"torque": slow["torque"] + 2 * drift}
    slow |= {k: 0.01 * slow[k] for k in ("torque", "pos_load", "pos_motor")}
    logs = [written(tmp_path / f"{k}.csv", x) for k, x in (("slow", slow), ("fast", columns))]
    assert guess(tmp_path / "slow.csv").second is None
    axis = new_case(tmp_path, logs)
    assert float(axis.inertia) == pytest.approx(J, rel=0.5)
    assert float(axis.second_inertia) == pytest.approx(J2, rel=0.5)
