"""Tables as strangers' programs write them: text above a header, units, dates, decimal commas."""

import datetime
import io
import json
import re

import numpy as np
import pandas as pd
import pyarrow
import pyarrow.parquet
import pytest
import scipy.io
from scipy.io.matlab._mio5 import MatFile5Writer

from omnijax import InputError, cli
from omnijax.machine import guess, read_machine_case
from omnijax.recording import read_recording, read_table

COUNT, STEP, TURN = 120, 0.01, 2 * np.pi
BEGIN = datetime.datetime(2024, 5, 31, 23, 59, 59, 500000)  # a month ends in the log


@pytest.fixture
def signals():
    """Time, torque and angle (t,)."""
    t = np.arange(COUNT) * STEP
    rng = np.random.default_rng(4)
    u, q = rng.normal(size=(2, COUNT))
    return t, np.round(u, 6), np.round(np.cumsum(q), 6)


def rows(signals, mark=",", comma=False, stamp=None):
    """The lines of a table; `stamp` writes the time of a date."""
    out = []
    for k, values in enumerate(zip(*signals, strict=True)):
        cells = [f"{x:.9g}".replace(".", "," if comma else ".") for x in values]
        if stamp is not None:
            cells[0] = stamp(BEGIN + datetime.timedelta(milliseconds=10 * k))
        out.append(mark.join(cells))
    return "\n".join(out)


def german(t):
    return f"{t:%d.%m.%Y %H:%M:%S},{t.microsecond // 1000:03d}"


def american(t):
    return f"{t:%m/%d/%Y %I:%M:%S.%f} {t:%p}"


TEXTS = {
    "preamble.csv": lambda s: "Bench 3\nMade: 1 May, by me\n\nt,u,q\ns,Nm,deg\n" + rows(s),
    "units.csv": lambda s: "t;u;q\n[s];[Nm];[°]\n" + rows(s, ";", True),
    "tabs.txt": lambda s: "t\tu\tq\n" + rows(s, "\t", True),
    "blanks.dat": lambda s: "  t   u   q\n" + rows(s, "   "),
    "iso.csv": lambda s: "t,u,q\n" + rows(s, stamp=lambda t: t.isoformat() + "Z"),
    "german.csv": lambda s: "t;u;q\n" + rows(s, ";", True, german),
    "american.csv": lambda s: "t,u,q\n" + rows(s, stamp=american),
    "midnight.csv": lambda s: "t;u;q\n" + rows(s, ";", True, lambda t: f"{t:%H:%M:%S.%f}"),
}


@pytest.mark.parametrize("encoding", ["utf-8", "cp1252", "utf-16"])
@pytest.mark.parametrize("name", TEXTS)
def test_text_tables_of_any_shape_are_columns(tmp_path, signals, name, encoding):
    path = tmp_path / name
    path.write_bytes(TEXTS[name](signals).encode(encoding))
    found = read_table(path)
    for key, values in zip("tuq", signals, strict=True):
        np.testing.assert_allclose(found.columns[key], values, atol=2e-6)
    if "Nm" in TEXTS[name](signals):
        assert found.units == {"t": "s", "u": "Nm", "q": "°" if name == "units.csv" else "deg"}


def test_columns_of_pandas_and_matlab(tmp_path, signals):
    t, u, q = signals
    stamps = pd.Timestamp(BEGIN) + pd.to_timedelta(np.round(1e3 * t), unit="ms")
    table = pd.DataFrame({"t": stamps, "u": u, "q": q})
    table.set_index("t").to_parquet(tmp_path / "index.parquet")
    seconds = table.assign(t=t)
    seconds.to_json(tmp_path / "columns.json")
    seconds.to_json(tmp_path / "split.json", orient="split")
    table.to_json(tmp_path / "lines.json", orient="records", lines=True, date_format="iso")
    scipy.io.savemat(tmp_path / "struct.mat", {"run": {"t": t, "motor": {"u": u}, "q": q}})
    for path in tmp_path.iterdir():
        found = read_table(path).columns
        for key, values in zip("tuq", signals, strict=True):
            np.testing.assert_allclose(found[key], values, atol=2e-6, err_msg=path.name)


def test_a_first_row_without_numbers_is_no_row_of_units(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("t,u\nnan,\n" + "\n".join(f"{k},{k}" for k in range(5)))
    found = read_table(path)
    assert (found.units, len(found.columns["t"])) == ({}, 6)


def test_counts_of_an_encoder_have_a_unit_of_their_own(tmp_path, signals, capsys):
    t, u, q = signals
    log = tmp_path / "m.csv"
    table = pd.DataFrame({"zeit": t, "strom": 1e3 * u, "enc_counts": np.round(100 * q)})
    log.write_text("zeit,strom,enc_counts\ns,mA,\n" + table.to_csv(index=False, header=False))
    assert '--unit position="360/4096 deg"' in dict(guess(log).rows())["position"]
    here = str(tmp_path / "case")
    said = ["--unit", "position=360/4096 deg"]
    assert cli.run(["case", "new", str(log), "--out", here, "--yes", *said]) == 0
    (one, _) = read_machine_case(here).logs
    np.testing.assert_allclose(
        one.outputs["position"], np.round(100 * q[: len(one.time)]) * 2 * np.pi / 4096, atol=1e-9
    )
    np.testing.assert_allclose(one.inputs["input"], u[: len(one.time)], rtol=1e-9)
    here = str(tmp_path / "another")  # a folder that is there is told before anything else
    for wrong in ("position=360/4096 kg", "position=1/0 deg", "speed=rpm", "position"):
        assert cli.run(["case", "new", str(log), "--out", here, "--yes", "--unit", wrong]) == 2
        assert capsys.readouterr().err.count("\n") <= 2
    assert cli.run(["case", "new", str(log), "--out", here, "--yes", "--rate", "-3"]) == 2
    assert capsys.readouterr().err == "`rate` must lie in (0, inf) Hz, but is -3.\n"
    assert cli.run(["case", "new", str(tmp_path), "--out", here, "--yes"]) == 2
    assert capsys.readouterr().err == f"{tmp_path}: is a folder, not a file.\n"


def test_a_goal_and_what_follows_it_have_one_unit(tmp_path):
    """Of angles in degrees whose unit stands at one alone the other was read as rad."""
    t = np.arange(200) * STEP
    goal = 20 * np.sign(np.sin(3 * t)) + np.sin(t)
    for names in (("goal.deg", "present.position"), ("target", "pos_deg")):
        table = pd.DataFrame(dict(zip(("t", *names), (t, goal, 0.8 * goal), strict=True)))
        table.to_json(tmp_path / "s.json", orient="records")
        one = guess(tmp_path / "s.json")
        assert one.drives == "goal"
        assert {k: one.units.get(k) for k in ("input", "position")} == dict.fromkeys(
            ("input", "position"), "deg"
        ), names


def test_a_unit_that_fits_no_position_is_none(tmp_path, signals):
    t, u, q = signals
    pd.DataFrame({"t (s)": t, "i (A)": u, "position (kg)": q}).to_csv(tmp_path / "a.csv")
    shown = dict(guess(tmp_path / "a.csv").rows())["position"]
    assert shown == "position (kg) (read as rad: no unit of it is said)"


@pytest.mark.parametrize("name", ["enc_counts", "Inkremente", "ticks", "increments"])
def test_counts_by_any_name_are_a_position(tmp_path, signals, name):
    t, u, q = signals
    pd.DataFrame({"Zeit": t, "PWM": u, name: np.round(100 * q)}).to_csv(tmp_path / "a.csv")
    assert "counts, read as rad" in dict(guess(tmp_path / "a.csv").rows())["position"]


def test_lines_of_json_that_end_too_early_are_refused_in_words(tmp_path, capsys):
    path = tmp_path / "a.json"
    path.write_text(json.dumps({"t": 1}) + "\n" + '{"t": ')
    assert cli.run(["case", "new", str(path), "--yes"]) == 2
    assert "cannot be read" in capsys.readouterr().err


def test_a_column_of_words_is_none_that_moves(tmp_path, signals, capsys):
    log = tmp_path / "log.csv"
    lines = [f"{line},idle" for line in rows(signals).splitlines()]
    log.write_text("\n".join(["t,torque,angle,state", *lines]))
    assert guess(log).input == "torque"
    log.write_text("t,torque,angle\ns,Nm,deg\nx,y,z\n")
    assert cli.run(["case", "new", str(log), "--yes"]) == 2
    assert "log.csv" in capsys.readouterr().err


@pytest.mark.parametrize("damaged, left", [(slice(30, 31), 1), (slice(0, 20), 20)])
def test_a_damaged_stamp_costs_no_more_rows_than_need_be(tmp_path, signals, damaged, left):
    """One stamp far ahead had cost all rows up to it, a clock set back all rows after that."""
    t, torque, angle = signals
    stamps = t.copy()
    stamps[damaged] += 0.9 * t[-1]
    path = tmp_path / "log.csv"
    table = np.stack([stamps, torque, angle], 1)
    np.savetxt(path, table, delimiter=",", header="t,torque,angle", comments="")
    assert cli.run(["case", "new", str(path), "--out", str(tmp_path / "case"), "--yes"]) == 0
    case = read_machine_case(tmp_path / "case")
    (fault,) = (x for x in case.faults if "column `t`, row" in x)
    assert re.search("row 31: time does not increase|rows 1-20: time goes back", fault)
    rows = sum(len(log.time) for log in case.logs)
    assert rows == len(t) - (0 if left == 1 else left)  # a straight line bridges one


def test_a_command_has_any_unit(tmp_path, signals):
    """A voltage of a motor whose resistance nobody states: "the file says 'V', no unit of 1"."""
    path = tmp_path / "log.csv"
    path.write_text("\n".join(["Zeit;Spannung;Winkel", "s;V;rad", *rows(signals, ";", True)
                               .splitlines()]))  # fmt: skip
    assert guess(path).drives == "command"
    assert cli.run(["case", "new", str(path), "--out", str(tmp_path / "case"), "--yes"]) == 0
    case = read_machine_case(tmp_path / "case")
    assert not [x for x in case.faults if "Spannung" in x]
    np.testing.assert_allclose(case.logs[0].inputs["input"], signals[1][: len(case.logs[0].time)])


def as_mcap(path, columns):
    file = io.BytesIO()
    out = pytest.importorskip("mcap.writer").Writer(file)
    out.start()
    schema = out.register_schema(name="s", encoding="jsonschema", data=b"{}")
    topic = out.register_channel(topic="/m", message_encoding="json", schema_id=schema)
    for k, values in enumerate(zip(*(x for _, x in columns), strict=True)):
        pairs = ", ".join(f'"{name}": {x}' for (name, _), x in zip(columns, values, strict=True))
        data = f"{{{pairs}}}".encode()
        out.add_message(topic, log_time=k * 10_000_000, publish_time=0, data=data)
    out.finish()
    path.write_bytes(file.getvalue())


def as_mat(path, columns):
    with path.open("wb") as file:
        writer = MatFile5Writer(file)
        for k, (name, x) in enumerate(columns):
            writer.put_variables({name: x}, write_header=k == 0)


def as_parquet(path, columns):
    names, values = zip(*columns, strict=True)
    pyarrow.parquet.write_table(pyarrow.Table.from_arrays([*values], [*names]), path)


def as_json(path, columns):
    path.write_text("{" + ", ".join(f'"{k}": {x.tolist()}' for k, x in columns) + "}")


def as_csv(path, columns):
    table = np.stack([x for _, x in columns], 1)
    header = ",".join(k for k, _ in columns)
    np.savetxt(path, table, delimiter=",", header=header, comments="", fmt="%.9g")


WRITERS = {"a.csv": as_csv, "a.parquet": as_parquet, "a.mat": as_mat, "a.json": as_json,
           "a.mcap": as_mcap}  # fmt: skip


@pytest.mark.parametrize("name", WRITERS)
def test_two_columns_of_one_name_are_one_sentence(tmp_path, signals, capsys, name):
    """Of two columns `q` one was taken, the first or the last, and nothing was said."""
    (t, u, q), path = signals, tmp_path / name
    WRITERS[name](path, [("t", t), ("torque_1", u), ("q", q), ("q", 2 * q)])
    assert cli.run(["case", "new", str(path), "--out", str(tmp_path / "case"), "--yes"]) == 2
    said = capsys.readouterr().err
    assert "two columns are named 'q'" in said and name in said and said.count("\n") == 1, said
    with pytest.raises(InputError, match=f"{name}: two columns are named 'q'"):
        read_recording(path)


@pytest.mark.parametrize("name", [x for x in WRITERS if x not in ("a.mat", "a.mcap")])
def test_copies_of_a_column_are_that_column(tmp_path, signals, name):
    """Recorders write the time beside every channel."""
    t, u, q = signals
    WRITERS[name](tmp_path / name, [("t", t), ("u", u), ("t", t), ("q", q)])
    found = read_table(tmp_path / name).columns
    assert set(found) == {"t", "u", "q"}
    np.testing.assert_allclose(found["q"], q, rtol=1e-8)


def test_fields_of_one_name_in_two_structs_are_told_by_their_structs(tmp_path, signals):
    """Of a motor's and a load's position the last one was read as `q`."""
    t, u, q = signals
    both = {"motor": {"t": t, "q": q, "u": u}, "load": {"t": t, "q": 0.5 * q}}
    scipy.io.savemat(tmp_path / "a.mat", both)
    found = read_table(tmp_path / "a.mat").columns
    assert set(found) == {"t", "u", "motor.q", "load.q"}
    np.testing.assert_allclose(found["load.q"], 0.5 * q)


@pytest.mark.parametrize(
    "text",
    ["t,u,q\n" + "\n".join(f"0,{k:02d},1,5,2,{k}" for k in range(80)),  # commas for points
     "t,u,q\n" + "\n".join(f"r{k},{0.01 * k},{k},5" for k in range(80))],  # names of rows
)  # fmt: skip
def test_rows_that_are_wider_than_their_header_are_one_sentence(tmp_path, capsys, text):
    """The surplus was not used: the time 0,01 was 0, and its hundredths were the input."""
    (tmp_path / "a.csv").write_text(text)
    assert cli.run(["case", "new", str(tmp_path / "a.csv"), "--yes"]) == 2
    said = capsys.readouterr().err
    assert "a.csv: rows have up to" in said and said.count("\n") == 1, said


def new_case(folder):
    """What `case new` makes of a.csv."""
    log, out = str(folder / "a.csv"), str(folder / "case")
    assert cli.run(["case", "new", log, "--out", out, "--yes"]) == 0
    return read_machine_case(out)


def test_a_log_is_not_bridged_over_what_is_missing_for_long(tmp_path, signals):
    """Half a second without numbers was a straight line, and a misfit of the machine."""
    u, q = (np.tile(x, 4) for x in signals[1:])
    t, q = np.arange(len(u)) * STEP, 0.1 * q
    q[100:150] = np.nan
    q[300:302] = np.nan
    as_csv(tmp_path / "a.csv", [("t", t), ("torque", u), ("angle", q)])
    assert (
        cli.run(["case", "new", str(tmp_path / "a.csv"), "--out", str(tmp_path / "c"), "--yes"])
        == 0
    )
    case = read_machine_case(tmp_path / "c")
    assert [round(float(log.time[-1]) / STEP) for log in case.logs] == [219, 329]
    np.testing.assert_allclose(case.logs[0].outputs["position"][:150], q[150:300], rtol=1e-8)
    (said,) = (x for x in case.faults if "longest stretch" in x)
    assert "from 1.5 s to 4.79 s, 328 rows" in said


def test_names_with_quotes_and_what_a_table_lacks_reach_the_case(tmp_path, signals):
    t, u, q = signals
    as_csv(tmp_path / "a.csv", [('t "s"', t), ("torque \\ shaft", u), ("angle", q)])
    lines = (tmp_path / "a.csv").read_text().splitlines()
    lines[50] = "0.49,much,1"
    (tmp_path / "a.csv").write_text("\n".join(lines))
    assert (
        cli.run(["case", "new", str(tmp_path / "a.csv"), "--out", str(tmp_path / "c"), "--yes"])
        == 0
    )
    case = read_machine_case(tmp_path / "c")
    np.testing.assert_allclose(case.logs[0].inputs["input"][:49], u[:49], rtol=1e-8)
    assert any("row 50: 'much' is not a number" in x for x in case.faults)


def test_a_clock_that_was_set_back_leaves_no_jump(tmp_path, signals):
    """Rows whose times came twice were left out, and those after them followed on those before."""
    u, q = (np.tile(x, 4) for x in signals[1:])
    t, q = np.arange(len(u)) * STEP, np.cumsum(0.1 * q) * STEP
    clock = np.where(t < 2, t, t - 1)
    as_csv(tmp_path / "a.csv", [("t", clock), ("torque", u), ("angle", q)])
    case = new_case(tmp_path)
    both = np.concatenate([log.outputs["position"] for log in case.logs])
    np.testing.assert_allclose(both, q[200:][: len(both)], rtol=1e-7)
    assert any("only the longest run is used, rows 201 to" in x for x in case.faults)


def test_marks_between_quotes_separate_nothing(tmp_path, signals):
    """Of the header "t, s","torque, Nm" six columns were read, and the torque as `s`."""
    (tmp_path / "a.csv").write_text('"t, s","torque, Nm","angle, rad"\n' + rows(signals))
    found = read_table(tmp_path / "a.csv").columns
    assert list(found) == ["t, s", "torque, Nm", "angle, rad"]
    np.testing.assert_allclose(found["angle, rad"], signals[2], rtol=1e-8)


@pytest.mark.parametrize("text", ["t,torque,angle\ns,Nm,rad\n", "a\x00b\n\x01\x02\x03\n"])
def test_a_table_without_numbers_is_one_sentence(tmp_path, capsys, text):
    (tmp_path / "a.csv").write_text(text)
    assert cli.run(["case", "new", str(tmp_path / "a.csv"), "--yes"]) == 2
    said = capsys.readouterr().err
    assert "a.csv holds no" in said and said.count("\n") == 1, said


def test_infinite_numbers_are_none(tmp_path, signals):
    t, u, q = signals
    q = np.where(np.arange(COUNT) % 40 == 7, np.inf, 0.1 * q)
    as_csv(tmp_path / "a.csv", [("t", t), ("torque", u), ("angle", q)])
    assert any("3 rows have no number" in x for x in new_case(tmp_path).faults)


def test_json_keeps_groups_as_rows_and_tells_of_a_channel_that_lost_its_end(tmp_path):
    """Both were gone without a word."""
    rng, path = np.random.default_rng(7), tmp_path / "r.json"
    t, torques = np.arange(20) / 100, {f"torque_{i}": list(rng.normal(size=20)) for i in (1, 2, 3)}
    dR = rng.normal(size=(20, 3))
    rows = [{"t": t[k], **{n: x[k] for n, x in torques.items()}, "dR": list(dR[k])}
            for k in range(20)]  # fmt: skip
    together = {"t": list(t), **torques}
    for document in ({"log": rows}, {**together, "dR": dR.tolist()},
                     {**together, "dR": dR.T.tolist()}):  # fmt: skip
        path.write_text(json.dumps(document))
        run = read_recording(path)
        assert run.groups == ("dR",) and not run.faults
        np.testing.assert_array_equal([run.channels[f"dR_{x}"] for x in "xyz"], dR.T)
    short = {"a_x": list(t), "a_y": list(t[:-3]), "axis": list(t[:-3])}
    path.write_text(json.dumps({**together, **short}))
    run = read_recording(path)
    (fault,) = run.faults
    assert run.groups == ("a",) and fault.column == "a_y" and "17 values, but `t` 20" in fault.what


@pytest.mark.parametrize(
    "column, si, motion",
    [("Position (rev)", TURN, "rotation"), ("angle_turns", TURN, "rotation"),
     ("angle [DEG]", TURN / 360, "rotation"), ("Winkel [arcsec]", TURN / 1296000, "rotation"),
     ("position [inch]", 0.0254, "translation"), ("speed_rps", TURN, "rotation"),
     ("speed [rev/s]", TURN, "rotation"), ("speed [deg/sec]", TURN / 360, "rotation"),
     ("position (raw)", 1.0, "rotation"), ("position (2)", 1.0, "rotation")],
)  # fmt: skip
def test_any_unit_in_brackets_behind_a_name_is_read(tmp_path, signals, column, si, motion):
    """A position in turns or inches was read as rad, and `no unit of it is said` stood beside."""
    t, u, q = signals
    shown = np.gradient(q, t) if "speed" in column else q
    log = tmp_path / "m.csv"
    table = {"Time (usec)": 1e6 * t, "Torque [N m]" if motion == "rotation" else "Force [kN]": u}
    pd.DataFrame(table | {column: shown / si}).to_csv(log, index=False)
    one = guess(log)
    assert one.motion == motion and one.rate == pytest.approx(1 / STEP)
    signal = one.signals.position if one.velocity is None else one.signals.velocity
    np.testing.assert_allclose(np.asarray(signal), shown, atol=1e-9)
    assert (one.measured in one.units) == (si != 1.0)
    np.testing.assert_allclose(one.signals.input, u * (1e3 if motion == "translation" else 1))
