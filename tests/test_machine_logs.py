"""Strangers' logs: JSON and MCAP in any layout, and what `case new` guesses of them."""

import gzip
import inspect
import json
import shlex
from pathlib import Path

import numpy as np
import pytest
from seeds import drawn_anew

from omnijax import cli, diagnose
from omnijax.cli.diagnose import diagnose as command
from omnijax.machine import (
    Axis,
    LogFile,
    free_run,
    guess,
    numbers_of_logs,
    read_log,
    read_machine_case,
)
from omnijax.recording import read_table
from omnijax.rig import InputError

STEP = 5e-3


def columns(seed: int, count: int = 120) -> dict[str, np.ndarray]:
    """Time and two signals of random sizes."""
    rng = np.random.default_rng(seed)
    t = np.arange(count) * STEP
    return {
        "stamp": t,
        "torque_cmd": rng.normal(size=count),
        "pos": np.cumsum(rng.normal(size=count)),
    }


def document(seed: int, table: dict[str, np.ndarray]):
    """The table in a layout that hangs on `seed`."""
    names = list(table)
    rows = [dict(zip(names, map(float, r), strict=True)) for r in np.stack(list(table.values()), 1)]
    lists = {k: x.tolist() for k, x in table.items()}
    return [rows, lists, {"kp": 4.5, "entries": rows}, {"meta": {"tags": [1, 2]}, "data": lists},
            {"kp": 4.5, "runs": [{"entries": rows}]}][seed]  # fmt: skip


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("packed", [False, True])
def test_json_logs_of_any_layout_are_columns(tmp_path, seed, packed):
    table = columns(seed)
    text = json.dumps(document(seed, table)).encode()
    path = tmp_path / ("a.json.gz" if packed else "a.json")
    path.write_bytes(gzip.compress(text) if packed else text)
    found = read_table(path).columns
    for name, values in table.items():
        np.testing.assert_array_equal(found[name], values)
    beside = seed in (2, 4)  # the number that stands above the table
    assert ("kp" in found) == beside
    if beside:
        assert set(found["kp"]) == {4.5}


def test_nested_samples_with_gaps_and_words(tmp_path):
    rows = [{"t": i * STEP, "motor": {"q": None if i == 3 else i, "mode": "run"}, "on": i > 1}
            for i in range(70)]  # fmt: skip
    path = tmp_path / "a.json"
    path.write_text(json.dumps({"log": rows}))
    found = read_table(path).columns
    assert set(found) == {"t", "motor.q", "on"}
    assert np.flatnonzero(~np.isfinite(found["motor.q"])).tolist() == [3]
    assert found["on"][:3].tolist() == [0, 0, 1]


@pytest.mark.parametrize("text", ["{}", "[1, 2, 3]", '{"a": 1}', '{"a": [{"b": 1', "null"])
def test_json_without_a_table_is_one_sentence(tmp_path, text):
    path = tmp_path / "a.json"
    path.write_text(text)
    with pytest.raises(InputError, match=r"a\.json"):
        read_table(path)


def test_mcap_topics_are_laid_on_one_clock(tmp_path):
    writer = pytest.importorskip("mcap.writer")
    path, rng = tmp_path / "a.mcap", np.random.default_rng(0)
    q, u = rng.normal(size=100), rng.normal(size=20)
    with path.open("wb") as file:
        out = writer.Writer(file)
        out.start()
        schema = out.register_schema(name="s", encoding="jsonschema", data=b"{}")
        topic = [out.register_channel(topic=x, message_encoding="json", schema_id=schema)
                 for x in ("/motor", "/command")]  # fmt: skip
        for i in range(100):
            now = int(1e18) + i * 5_000_000
            if i % 5 == 0:
                data = json.dumps({"torque": u[i // 5]}).encode()
                out.add_message(topic[1], log_time=now, publish_time=now, data=data)
            data = json.dumps({"state": {"q": q[i]}, "name": "m"}).encode()
            out.add_message(topic[0], log_time=now, publish_time=now, data=data)
        out.finish()
    found = read_table(path).columns
    np.testing.assert_allclose(found["t"], np.arange(100) * STEP, atol=1e-9)
    np.testing.assert_array_equal(found["motor.state.q"], q)
    np.testing.assert_array_equal(found["command.torque"], np.repeat(u, 5))


def servo(seed: int) -> dict[str, np.ndarray]:
    """A log of a random servo that lifts a pendulum, with a supply's voltage beside it."""
    rng, count = np.random.default_rng(seed), 1200
    t = np.arange(count) * STEP
    axis = Axis(1.0, damping=rng.uniform(3, 8), gravity=rng.uniform(20, 60),
                gain=rng.uniform(0.5, 2), limit=1e9, back_emf=0.0, drives="goal")  # fmt: skip
    goal = rng.uniform(0.5, 1.2) * np.sin(2 * np.pi * rng.uniform(0.3, 1.0) * t + 0.3 * t**2)
    given = {"input": goal, "gain": np.full(count, 100.0), "enable": np.ones(count)}
    q = free_run(axis, (), {"position": (0.0, 0.0)}, given, STEP)["position"]
    return {"timestamp": t, "input_volts": 7.4 + 0.05 * rng.normal(size=count), "kp": given["gain"],
            "torque_enable": given["enable"], "goal_position": goal,
            "position": q + 1e-4 * rng.normal(size=count), "gravity": float(axis.gravity),
            "gain": float(axis.gain)}  # fmt: skip


@pytest.mark.parametrize("seed", range(3))
def test_a_servo_is_guessed_with_its_gain_and_gravity(tmp_path, seed, capsys):
    table = servo(seed)
    gravity, gain = table.pop("gravity"), table.pop("gain")
    names, one = list(table), np.stack(list(table.values()), 1)
    other = np.stack([servo(seed + 10)[name] for name in names], 1)
    for name, values in (("one.json", one), ("two.json", other), ("copy.json", one)):
        rows = [dict(zip(names, map(float, r), strict=True)) for r in values]
        (tmp_path / name).write_text(json.dumps({"mass": 0.5, "entries": rows}))
    found = guess(tmp_path / "one.json")
    assert (found.drives, found.input, found.position) == ("goal", "goal_position", "position")
    assert found.beside == {"gain": "kp", "enable": "torque_enable"}
    numbers = numbers_of_logs([found])
    assert numbers["gravity"] == pytest.approx(gravity, rel=0.2)
    assert numbers["gain"] == pytest.approx(gain, rel=0.2)
    assert (
        "coulomb" not in numbers
    )  # left to the diagnosis; a limit that does not show is left open
    logs = [str(tmp_path / x) for x in ("one.json", "two.json")]
    line = ["case", "new", *logs, "--held-out", logs[1], "--out", str(tmp_path / "case"), "--yes"]
    assert cli.run(line) == 0
    case = read_machine_case(tmp_path / "case")
    assert [log.role for log in case.logs] == ["train", "held-out"]
    assert set(case.logs[0].inputs["gain"]) == {100.0}
    assert "goal_position" in capsys.readouterr().out
    again = (tmp_path / "case" / "one.toml").read_text().replace('"train"', '"held-out"')
    (tmp_path / "case" / "copy.toml").write_text(again.replace("one.json", "copy.json"))
    with_copy = read_machine_case(tmp_path / "case")  # a copy was taken as a run that confirms
    assert [log.name for log in with_copy.logs] == [log.name for log in case.logs]
    told = "copy holds the same samples as one: it confirms nothing, and is not used as held-out."
    assert told in with_copy.faults


def case_of_parts(folder, table, parts: dict[str, str]):
    """The case of an axis with one log, `table` (t, input, position), and what NAME.toml say."""
    (folder / "machine.toml").write_text(
        'kind = "axis"\n[axis]\ninertia = 0.01\n[motor]\ninput = "torque"\n'
    )
    header = "t,input,position"
    np.savetxt(folder / "run.csv", table, "%.9g", ",", header=header, comments="")
    for name, text in parts.items():
        (folder / f"{name}.toml").write_text(text)
    return read_machine_case(folder)


def wandering(rng, count: int, step: float = STEP) -> np.ndarray:
    """Time, input and position (count, 3) of something that wanders."""
    return np.stack([step * np.arange(count), *np.cumsum(rng.normal(size=(2, count)), 1)], 1)


@pytest.mark.parametrize("rows, share", [((100, 400), 100), ((300, 600), 33), ((390, 600), 0)])
@pytest.mark.parametrize("jitter", [0.0, 0.1])
def test_a_held_out_part_of_a_fitted_log_is_noticed_by_its_rows(tmp_path, rows, share, jitter):
    """Each log counts its time from 0: a later part of another one was taken for a new log."""
    rng = drawn_anew("rows")
    table = wandering(rng, 600)
    table[:, 0] += jitter * STEP * rng.random(600)  # and each part is laid on a grid of its own
    parts = {
        "run": "rows = [0, 400]",
        "tail": f'log = "run.csv"\nrole = "held-out"\nrows = {[*rows]}',
    }
    case = case_of_parts(tmp_path, table, parts)
    assert case.blocks == (share > 0)
    said = "holds the same samples as" if share == 100 else f"shares {share} % of its samples with"
    told = f"tail {said} run: it confirms nothing, and is not used as held-out."
    assert (told in case.faults) == (share > 0)


def test_a_copied_log_counts_once_whatever_its_file(tmp_path):
    table = wandering(drawn_anew("copied"), 600)
    for name, part in (("copy", (0, 600)), ("later", (250, 550))):
        rows = table[slice(*part)] - [table[part[0], 0], 0, 0]
        np.savetxt(
            tmp_path / f"{name}.csv", rows, "%.9g", ",", header="t,input,position", comments=""
        )
    case = case_of_parts(tmp_path, table, {"later": 'role = "held-out"'})
    assert {log.name for log in case.logs} == {"copy train", "copy held-out"}
    assert (
        "later holds the same samples as copy: it confirms nothing, and is not used as held-out."
        in case.faults
    )
    assert "run holds the same samples as copy: they count once, and it is not used." in case.faults


def test_a_log_of_another_machine_is_refused(tmp_path):
    """`machine` was read and never looked at."""
    table = wandering(drawn_anew("another"), 300)
    np.savetxt(tmp_path / "other.csv", table, "%.9g", ",", header="t,input,position", comments="")
    parts = {"run": 'machine = "machine.toml"', "other": 'machine = "no-such.toml"'}
    case = case_of_parts(tmp_path, wandering(drawn_anew("own"), 300), parts)
    assert {log.name for log in case.logs} == {"run train", "run held-out"}
    (told,) = (x for x in case.faults if "no-such.toml" in x)
    assert told.startswith("other.toml: `machine` names ") and told.endswith("The run is not used.")
    own = read_machine_case(tmp_path, case.file)  # a machine that is given stands for all of them
    assert len(own.logs) == 4


@pytest.mark.parametrize("off, told", [(0.005, False), (0.02, True), (-0.5, True)])
def test_a_rate_that_is_not_that_of_the_times_is_said(tmp_path, off, told):
    """It took the place of a column of times without a word."""
    rate = (1 + off) / STEP
    table = wandering(drawn_anew("rate"), 300)
    case = case_of_parts(tmp_path, table, {"run": f'rate = "{rate!r} Hz"'})
    assert case.logs[0].step == pytest.approx(1 / rate)
    said = f"`rate` says {rate:g} Hz, the column `t` of run.csv {1 / STEP:.4g} Hz; `rate` counts."
    assert (f"run.toml: {said}" in case.faults) == told


def test_rows_that_a_log_does_not_have_are_said(tmp_path):
    """They were cut to the end of the file without a word."""
    table = wandering(drawn_anew("rows"), 300)
    case = case_of_parts(tmp_path, table, {"run": "rows = [100, 999]"})
    assert sum(len(log.time) for log in case.logs) == 200
    told = "run.toml: `rows` ends at 999, but run.csv has 300 rows; it is read to its end."
    assert told in case.faults
    with pytest.raises(InputError, match=r"`rows` begins at 300, but run\.csv has 300 rows"):
        case_of_parts(tmp_path, table, {"run": "rows = [300, 999]"})


def test_the_window_of_a_rig_is_none_of_an_axis(tmp_path, capsys):
    """It was taken, and did nothing."""
    case = case_of_parts(tmp_path, wandering(drawn_anew("window"), 300), {})
    with pytest.raises(InputError, match="`window` speaks of a rig's runs"):
        diagnose(case, window=7.0)
    line = ["diagnose", str(tmp_path), "--window", "7", "--out", str(tmp_path / "out")]
    assert cli.run(line) == 2
    assert "--window speaks of a rig's runs" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
    defaults = {inspect.signature(x).parameters["window"].default for x in (diagnose, command)}
    assert len(defaults) == 1


def test_a_constant_channel_is_in_its_unit(tmp_path):
    t = np.arange(100) * 1e-2
    table = np.stack([t, np.sin(t)], 1)
    path = tmp_path / "a.csv"
    np.savetxt(path, table, delimiter=",", header="t,position", comments="")
    units, inputs, outputs = {"input": "mN m"}, {"input": "N m"}, {"position": "rad"}
    file = LogFile(tmp_path / "a.toml", path, channels={"input": 500}, units=units)
    np.testing.assert_allclose(read_log(file, inputs, outputs).inputs["input"], 0.5)
    file.units["input"] = "kg"
    with pytest.raises(InputError, match=r"`units\.input` must be a unit of N m"):
        read_log(file, inputs, outputs)


def test_the_studies_of_the_page_run_as_they_stand(tmp_path, monkeypatch):
    """On a log as the page's first block has one: columns of any names."""
    text = (Path(__file__).parents[1] / "docs" / "howto" / "axis.md").read_text(encoding="utf-8")
    begin = next(x for x in text.splitlines() if x.startswith("$ omnijax case new motor.csv"))
    studies = text[text.index("## Studies of it") : text.index("## A machine of your own")]
    lines = [x for x in studies.splitlines() if x.startswith("$ omnijax ")]
    t = np.arange(1500) * 2e-3
    u = 0.04 * np.sin(3 * t + 4 * t**2)
    axis = Axis(2e-3, 1e-3)
    q = free_run(axis, (), {"position": (0.0, 0.0)}, {"input": u}, 2e-3)["position"]
    monkeypatch.chdir(tmp_path)
    np.savetxt("motor.csv", np.stack([t, u, q], 1), delimiter=",", header="t,torque,angle",
               comments="")  # fmt: skip
    assert len(lines) == 4
    for line in (begin, *lines):
        assert cli.run(shlex.split(line.removeprefix("$ omnijax "))) == 0


@pytest.mark.parametrize("unit, si", [("g", 9.80665), ("mg", 9.80665e-3), ("0.5 G", 4.903325)])
def test_an_acceleration_in_g_is_standard_gravity(tmp_path, unit, si):
    """`units.a` in g was refused of a machine's log, which a sphere's recordings take."""
    table = columns(3) | {"a": np.arange(120.0)}
    path = tmp_path / "run.csv"
    np.savetxt(path, np.stack(list(table.values()), 1), delimiter=",", header=",".join(table),
               comments="")  # fmt: skip
    file = LogFile(tmp_path / "run.toml", path, channels={"t": "stamp", "input": "torque_cmd",
                   "position": "pos"}, units={"a": unit})  # fmt: skip
    log = read_log(file, {"input": "N m"}, {"position": "rad", "a": "m/s^2"})
    np.testing.assert_allclose(log.outputs["a"], si * np.arange(120.0))
    with pytest.raises(InputError, match="must be a unit of N m"):
        read_log(LogFile(file.path, path, channels=file.channels, units={"input": unit}),
                 {"input": "N m"}, {"position": "rad"})  # fmt: skip


def test_a_column_of_a_strange_name_without_unit_is_said_to_be_read_in_si(tmp_path):
    """The numbers of a diagnosis, an order a radian, hung on a unit that nobody had said."""
    table, path = columns(3), tmp_path / "run.csv"
    inputs, outputs = {"input": "N m"}, {"position": "rad"}
    names = {"t": "stamp", "input": "torque_cmd", "position": "pos"}

    def faults(header, channels, units, wanted=inputs):
        np.savetxt(path, np.stack(list(table.values()), 1), delimiter=",", header=",".join(header),
                   comments="")  # fmt: skip
        file = LogFile(tmp_path / "run.toml", path, channels=channels, units=units)
        said = read_log(file, wanted, outputs).faults
        return [fault for fault in said if "no unit of it is said" in fault]

    said = faults(table, names, {})
    assert said == [
        f"run.csv, column `{column}`: no unit of it is said; it is read as {unit} ([units] in "
        "run.toml says another)."
        for column, unit in (("torque_cmd", "N m"), ("pos", "rad"))
    ]
    assert faults(table, names, {"input": "N m"}) == said[1:]
    assert faults(table, names, {}, {"input": "1"}) == said[1:]  # a command has any unit
    assert faults(table, names, {"input": "N m", "position": "deg"}) == []
    own = {"stamp": "t", "torque_cmd": "input", "pos": "position"}
    assert faults([own.get(k, k) for k in table], {}, {}) == []  # names of the format are in SI
